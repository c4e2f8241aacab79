"""C99 for a controller: from readings to true heading, and a calibration that runs there."""

from agonic.exports.firmware.grid import DeclinationGrid as DeclinationGrid
from agonic.exports.firmware.grid import declination_grid as declination_grid
from agonic.exports.firmware.writer import Firmware as Firmware
from agonic.exports.firmware.writer import write_firmware as write_firmware
