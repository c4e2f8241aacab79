"""Files of other programs.

The public names of this wing, a line each; see `agonic.public`.
"""

from agonic.exports.ardupilot import write_ardupilot as write_ardupilot
from agonic.exports.c_header import write_c as write_c
from agonic.exports.csv import write_csv as write_csv
from agonic.exports.csv import write_sensors as write_sensors
from agonic.exports.firmware import DeclinationGrid as DeclinationGrid
from agonic.exports.firmware import declination_grid as declination_grid
from agonic.exports.firmware import write_firmware as write_firmware
from agonic.exports.matlab import write_matlab as write_matlab
from agonic.exports.motioncal import write_motioncal as write_motioncal
from agonic.exports.px4 import write_px4 as write_px4
from agonic.exports.ros import write_ros as write_ros
from agonic.exports.table import write_mr as write_mr
from agonic.exports.table import write_table as write_table
