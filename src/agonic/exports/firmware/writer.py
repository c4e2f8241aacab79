"""Writing the firmware of a setup."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from agonic.atomic import make_folder, write_atomically
from agonic.calibration import monitoring as m
from agonic.calibration.network import Network
from agonic.calibration.setup import Setup
from agonic.calibration.sources import parse_source
from agonic.calibration.steps import find_step
from agonic.errors import AgonicError
from agonic.exports.convert import Export
from agonic.exports.firmware.c_text import fill_files, require_identifier, write_comment
from agonic.exports.firmware.grid import DeclinationGrid
from agonic.exports.firmware.plan import Plan
from agonic.exports.firmware.selftest import write_selftest
from agonic.exports.firmware.sources import write_about, write_header, write_source
from agonic.health.evidence import NOISE_DOUBTFUL

COMPILERS = {
    "arm-none-eabi-gcc": (
        "-mcpu=cortex-m4",
        "-mthumb",
        "-mfloat-abi=hard",
        "-mfpu=fpv4-sp-d16",
    ),
    "cc": (),
}
"""Compilers in the order they are looked for, and what makes them aim at a usual controller."""


@dataclass(frozen=True, kw_only=True)
class Size:
    """Bytes of code, of constants, and of variables that outlive a call; by which compiler."""

    code: int
    constants: int
    variables: int
    compiler: str


def measure_sizes(source: Path) -> Size | None:
    """The size of one C file compiled for size; `None` without compiler or where it fails."""
    for compiler, flags in COMPILERS.items():
        reader = "arm-none-eabi-size" if compiler.startswith("arm") else "size"
        if shutil.which(compiler) and shutil.which(reader):
            sections = _sections(source, compiler, flags, reader)
            if sections:
                code, constants, variables = (
                    sum(size for name, size in sections.items() if name.startswith(starts))
                    for starts in (".text", ".rodata", (".data", ".bss"))
                )
                made_by = " ".join([compiler, *flags, "-Os"])
                return Size(code=code, constants=constants, variables=variables, compiler=made_by)
    return None


def _sections(source: Path, compiler: str, flags: tuple[str, ...], reader: str) -> dict[str, int]:
    """The bytes of each section of the object."""
    with TemporaryDirectory() as folder:
        target = str(Path(folder, "object.o"))
        compile_it = [compiler, *flags, "-std=c99", "-Os", "-c", str(source), "-o", target]
        try:
            subprocess.run(compile_it, check=True, capture_output=True, timeout=60)
            done = subprocess.run(
                [reader, "-A", target], check=True, capture_output=True, text=True, timeout=60
            )
        except (OSError, subprocess.SubprocessError):
            return {}
    return {name: int(size) for name, size in re.findall(r"^(\.\S+)\s+(\d+)", done.stdout, re.M)}


@dataclass(frozen=True, kw_only=True)
class Firmware(Export):
    """The C files of a setup: `path` is their folder; sizes by file, where they were compiled."""

    files: tuple[Path, ...] = ()
    constants: int = 0
    sizes: dict[str, Size]


def write_firmware(
    setup: Setup,
    folder: Path | str,
    *,
    name: str = "compass",
    declination: float | DeclinationGrid | None = None,
) -> Firmware:
    """Write a setup as C99 for a controller: readings in, compass, magnetic and true heading out.

        field = matrix (raw − bias − added x),   levelled by the tilt,   ψ = atan2(east, north),
        magnetic = ψ + deviation(ψ),   true = magnetic + declination

    in float32, without allocation, variables of its own, or a library but math.h. Written are
    `{name}.h`, `{name}.c`, `{name}_selftest.c` with known readings, and beside them a calibration
    that runs on the controller: `{name}_fit.h` and `{name}_fit.c` with one or three gains,
    `{name}_ellipsoid.h` and `{name}_ellipsoid.c` with the whole matrix; of a setup with two
    compasses and its field `{name}_watch.h` and `{name}_watch.c`, which find a fault of either.

    Parameters
    ----------
    setup : compasses, where the tilt comes from, in which order, and the limits beyond which the
        status says that a heading is not to be trusted. A tilt from "auto", "log" or "gyro" means
        that the controller is given roll and pitch.
    folder : made where it is not there.
    name : what the C names start with.
    declination : degrees east, or a table (`declination_grid`); default that of the setup.

    Raises `AgonicError` where no declination is known.

    >>> import numpy as np
    >>> from tempfile import TemporaryDirectory
    >>> from agonic.calibration.affine import Affine
    >>> from agonic.calibration.setup import Compass
    >>> mag = Affine(bias=[3000, 0, 0], matrix=np.eye(3), frame_in="b", frame_out="b")
    >>> with TemporaryDirectory() as folder:
    ...     written = write_firmware(Setup(compasses=(Compass(calibration=mag),)), folder,
    ...                              declination=2.5)
    >>> for path in written.files:
    ...     print(path.name)
    compass.h
    compass.c
    compass_selftest.c
    compass_fit.h
    compass_fit.c
    compass_ellipsoid.h
    compass_ellipsoid.c
    """
    for compass in setup.compasses:
        if find_step(compass.calibration, Network) is not None:
            raise AgonicError(
                "the firmware of a setup holds a bias and a matrix for each compass, and the "
                f"calibration of {compass.sensor} is a network: export it on its own (agonic "
                "export CAL --to c), or give the setup the base of the network"
            )
    plan = Plan(setup=setup, declination=_declination(setup, declination))
    values = {"name": require_identifier(name)}
    texts = {
        f"{name}.h": write_header(plan, name),
        f"{name}.c": write_source(plan, name),
        f"{name}_selftest.c": write_selftest(plan, name),
        **fill_files(f"{name}_fit", "fit", ("source",), values),
        **write_ellipsoid(name),
        **write_watch(plan, name),
    }
    return write_files(folder, texts, warnings=_warnings(plan), constants=plan.constants)


def write_files(
    folder: Path | str,
    texts: Mapping[str, str],
    *,
    warnings: tuple[str, ...] = (),
    constants: int = 0,
) -> Firmware:
    """Write C files, text by name, and measure the sources but for the self-test."""
    place = make_folder(folder)
    files = tuple(write_atomically(place / file, text) for file, text in texts.items())
    sources = [file for file in texts if file.endswith(".c") and "_selftest." not in file]
    sizes = {file: measure_sizes(place / file) for file in sources}
    return Firmware(
        path=place,
        target="c",
        warnings=warnings,
        files=files,
        constants=constants,
        sizes={file: size for file, size in sizes.items() if size is not None},
    )


def write_ellipsoid(name: str) -> dict[str, str]:
    """The whole ellipsoid fit that runs on a controller, text by file."""
    noisy = {"noisy": f"{100 * NOISE_DOUBTFUL:g}", "noisy_share": NOISE_DOUBTFUL}
    parts = ("sums", "solve", "result")
    return fill_files(f"{name}_ellipsoid", "ellipsoid", parts, {"name": name, **noisy})


def _declination(
    setup: Setup, declination: float | DeclinationGrid | None
) -> float | DeclinationGrid:
    chosen = setup.declination_deg if declination is None else declination
    if chosen is None:
        raise AgonicError(
            "the controller needs a declination and the setup has none: give one in degrees, or "
            "a table made with declination_grid for where the vehicle goes"
        )
    return chosen if isinstance(chosen, DeclinationGrid) else float(chosen)


def _warnings(plan: Plan) -> tuple[str, ...]:
    """What the controller cannot know or do."""
    said = []
    for compass, size in zip(plan.setup.compasses, plan.expected, strict=True):
        if size is None and plan.dip is None:
            said.append(
                f"the field to expect of {compass.sensor} is not known: disturbances will not be "
                "noticed; give the setup its horizontal and vertical intensity"
            )
        if compass.latency_s:
            said.append(
                f"the readings of {compass.sensor} are {1e3 * compass.latency_s:.0f} ms late: give "
                "the tilt of that long before they arrive"
            )
        if compass.calibration.frame_out == "m":
            said.append(
                f"the calibration of {compass.sensor} is in sensor axes, which were taken for "
                "forward, right, down; give it an alignment where they differ"
            )
    if plan.time_constants:
        said.append(
            f"{', '.join(plan.time_constants)}: a filter lies between the field and what is "
            "recorded; call the function _follow with each set of readings, before the heading"
        )
    late = [one for one in map(parse_source, plan.sources) if one.late_s > 0]
    if late:
        columns = dict.fromkeys(name for one in late for name in one.columns)
        by = max(one.late_s for one in late)
        said.append(
            f"{', '.join(columns)}: known up to {by:.2g} s late, which a controller cannot undo: "
            "what is taken out comes as late"
        )
    if plan.tilt == "acceleration":
        said.append("an accelerometer gives the tilt of a vehicle at rest only")
    return tuple(said)


def write_watch(plan: Plan, name: str) -> dict[str, str]:
    """The text of `{name}_watch.h` and `{name}_watch.c`; none where there are not two compasses."""
    if not plan.watched:
        return {}
    horizontal, vertical = plan.setup.horizontal, plan.setup.vertical
    assert horizontal is not None
    assert vertical is not None
    params = m.derive_monitor_params(plan.setup, float(np.hypot(horizontal, vertical)), horizontal)
    values = {
        "name": name,
        "about": write_comment(write_about(plan)),
        "block_s": round(m.BLOCK_S),
        "false_alarm": f"{params.false_alarm_h:g}",
        "block": m.BLOCK_S,
        "kept": m.KEPT,
        "longer": m.LENGTHS[1],
        "shorter": m.LENGTHS[0],
        "passing": float(m.PASSING),
        "field": params.field,
        "horizontal": float(params.horizontal),
        "sine": vertical / params.field,
        "quiet": m.QUIET,
        "both": m.BOTH**2,
        "turned": m.TURNED,
        "lasting": m.LASTING,
        "tails": m.TAILS,
        "log_odds": np.log(m.ODDS),
        "keep": 1.0 - 1.0 / m.MEMORY,
        "fade": 1.0 - 1.0 / m.NOISE_MEMORY,
        "prior_count": float(m.NOISE_PRIOR),
        "prior": np.array(params.prior_sd) ** -2.0,
        "noise": np.array(params.noise_sd) ** 2,
        "alarm": params.alarm,
    }
    return fill_files(f"{name}_watch", "watch", ("rows", "test", "block"), values)
