"""`TARGETS`: every program that a calibration can be written for, a line each.

Nothing of a target is imported before something is written for it, so that a command can list
them at no cost.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

from agonic.atomic import write_atomically
from agonic.errors import AgonicError, check_choice
from agonic.logs.formats import load_installed

if TYPE_CHECKING:
    from agonic.calibration.base import Calibration
    from agonic.exports.convert import Export


class Target(NamedTuple):
    """A program: its writer (`module:function`), the ending of its files, what it is told.
    `options` makes keywords of the writer from the number of the compass, from 1, and the device
    id; `thermal` says that the target follows the temperature by itself."""

    writer: str
    suffix: str
    options: Callable[[int, int | None], dict[str, int | None]] = lambda number, device_id: {}
    thermal: bool = False
    package: str = "agonic.exports."

    def write(self, calibration: Calibration, path: Path | str, **options: Any) -> Export:
        """Write a calibration with the writer's own options."""
        module, _, function = self.writer.partition(":")
        writer = getattr(import_module(self.package + module), function)
        written: Export = writer(calibration, path, **options)
        return written


TARGETS: dict[str, Target] = {
    "ardupilot": Target(
        "ardupilot:write_ardupilot", ".param", lambda number, device_id: {"compass": number}
    ),
    "px4": Target(
        "px4:write_px4",
        ".params",
        lambda number, device_id: {"slot": number - 1, "device_id": device_id},
        thermal=True,
    ),
    "c": Target("c_header:write_c", ".h", thermal=True),
    "motioncal": Target("motioncal:write_motioncal", ".bin"),
    "matlab": Target("matlab:write_matlab", ".mat", thermal=True),
    "ros": Target("ros:write_ros", ".yaml"),
    "table": Target("table:write_table", ".csv", thermal=True),
    "mr": Target("table:write_mr", ".csv"),
}

USE: Mapping[str, Callable[[int, bool], str]] = {
    "ardupilot": lambda number, used: f"COMPASS_USE{number if number > 1 else ''},{int(used)}",
    "px4": lambda number, used: f"1\t1\tCAL_MAG{number - 1}_PRIO\t{50 if used else 0}\t6",
}
"""Of each autopilot the row that has the compass of a number, from 1, used or not."""


EXPORTS = "agonic.exports"
"""The entry points by which an installed package adds a `Target`; its name is theirs."""


def find_target(name: str) -> Target:
    """The target of that name, of agonic or an installed package; `AgonicError` without one."""
    if name in TARGETS:
        return TARGETS[name]
    installed = load_installed(EXPORTS)
    check_choice("target", name, (*TARGETS, *installed))
    target: Target = installed[name]
    return target


def list_words(names: list[str], last: str) -> str:
    """Names as a sentence has them."""
    return f"{', '.join(names[:-1])} {last} {names[-1]}"


def write(
    target: str,
    calibration: Calibration,
    path: Path | str,
    *,
    number: int | None = None,
    device_id: int | None = None,
    temperature_C: float | None = None,
    voltage_V: float | None = None,
    name: str | None = None,
) -> Export:
    """Write a calibration for a target, for the vehicle's compass of that number, from 1.

    `temperature_C` is where one that changes with temperature is held: it must be given for a
    target that knows no temperature. The number is that of the sensor's name and the device id the
    calibration's own, unless given. `voltage_V` is the battery's in the log, for ArduPilot's terms
    of each motor. `name` is what the identifiers of C begin with.
    """
    from agonic.calibration.base import has_two_axes
    from agonic.exports.convert import require_uncorrected

    into = find_target(target)
    if target in USE:
        require_uncorrected(calibration)
    if has_two_axes(calibration):
        raise AgonicError(
            f"the calibration of {calibration.sensor} is that of a two-axis compass, and {target} "
            "needs three; export the setup that agonic calibrate wrote beside it (--to c)"
        )
    which = compass_number(calibration.sensor) if number is None else number
    device = getattr(calibration, "device_id", None) if device_id is None else device_id
    options: dict[str, Any] = {**into.options(which, device)}
    if voltage_V is not None:
        if target != "ardupilot":
            raise AgonicError(
                f"{target} has no terms that go with the voltage; it is for ardupilot"
            )
        options["voltage_V"] = voltage_V
    if name is not None:
        if target != "c":
            raise AgonicError(f"{target} has no identifiers to name {name}; --name is for c")
        options["name"] = name
    return into.write(calibration, path, temperature_C=temperature_C, **options)


def write_vehicle(
    target: str,
    calibrations: Mapping[str, Calibration],
    path: Path | str,
    *,
    unused: tuple[str, ...] = (),
) -> Export:
    """Write the parameters of all compasses of a vehicle into one file, as its autopilot loads it.
    Source: ArduPilot AP_Compass.cpp; PX4 sensor_calibration/Magnetometer.cpp."""
    from agonic.exports.convert import Export

    texts, warnings = list[str](), list[str]()
    with TemporaryDirectory() as folder:
        for name, calibration in calibrations.items():
            number = compass_number(name)
            one = write(target, calibration, Path(folder, "one"), number=number)
            row = USE[target](number, True)
            texts.append(f"# {name}\n{one.path.read_text('utf-8')}{row}\n")
            warnings += [f"{name}: {text}" for text in one.warnings]
    for name in unused:
        texts.append(f"# {name}: not calibrated\n{USE[target](compass_number(name), False)}\n")
    written = write_atomically(path, "\n".join(texts))
    return Export(path=written, target=target, warnings=tuple(warnings))


def compass_number(sensor: str) -> int:
    """Which compass of its vehicle a sensor's name means, from 1."""
    if found := re.search(r"\[(\d+)\]$", sensor):
        return int(found[1]) + 1
    found = re.search(r"(\d)$", sensor)
    return max(int(found[1]), 1) if found else 1
