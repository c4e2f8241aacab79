"""One parameter file for all compasses of a vehicle, as its autopilot loads it.

ArduPilot numbers compasses from 1 and uses those with COMPASS_USE 1; PX4 numbers slots from 0 and
takes a slot by its device id, with CAL_MAGn_PRIO 50 (0: not used).
Source: ArduPilot AP_Compass.cpp; PX4 sensor_calibration/Magnetometer.cpp.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from agonic.atomic import write_atomically
from agonic.calibration.base import Calibration
from agonic.exports.convert import Export
from agonic.exports.targets import TARGETS, USE, compass_number, write


def write_vehicle(
    target: str,
    calibrations: Mapping[str, Calibration],
    path: Path | str,
    *,
    unused: tuple[str, ...] = (),
) -> Export:
    """Write the parameters of several compasses into one file."""
    texts, warnings = list[str](), list[str]()
    with TemporaryDirectory() as folder:
        for name, calibration in calibrations.items():
            path_of_one = Path(folder, f"one{TARGETS[target].suffix}")
            one = write(target, calibration, path_of_one, number=compass_number(name))
            texts.append(f"# {name}\n{one.path.read_text('utf-8')}{_use(target, name, True)}\n")
            warnings += [f"{name}: {text}" for text in one.warnings]
    texts += [f"# {name}: not calibrated\n{_use(target, name, False)}\n" for name in unused]
    written = write_atomically(path, "\n".join(texts))
    return Export(path=written, target=target, warnings=tuple(warnings))


def _use(target: str, name: str, used: bool) -> str:
    """The row that has a compass used or not."""
    parameter, yes, no = USE[target]
    number = compass_number(name)
    if target == "ardupilot":
        return f"{parameter.format('' if number == 1 else number)},{yes if used else no}"
    return f"1\t1\t{parameter.format(number - 1)}\t{yes if used else no}\t6"
