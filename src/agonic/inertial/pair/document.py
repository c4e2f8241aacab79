"""What is said and shown of two calibrations by shots."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.inertial.pair.check import Change, PairCheck
from agonic.inertial.pair.result import PairFit
from agonic.readable import make_record
from agonic.report.digits import group_digits, quantity, significant
from agonic.report.document import Document
from agonic.report.section import Section, Table, tabulate

SHOT_HEAD = ("Shot", "Target", "Gravity", "Field", "Dip", "Slope", "Azimuth", "")
TERM_HEAD = ("", "x", "y", "z")


def describe_pair(fit: PairFit, sensor: str, following: str = "") -> Document:
    """The calibrations of a sensor and its accelerometer, how each shot fits, and what to add; the
    command `following` is told.
    """
    refused = fit.verdict == "refused"
    said = ["These shots would add most: " + "; ".join(fit.to_add) + "."]
    if fit.prior_only:
        said.insert(0, "Known mostly from the prior: " + "; ".join(fit.prior_only) + ".")
    improve = Section("What more shots would improve", said, printed=bool(fit.prior_only))
    sections = [_shots(fit), *([] if refused else [_terms(fit), improve])]
    return Document.judge(
        fit,
        schema="agonic/fit-pair@1",
        kind="Accelerometer and magnetometer together",
        name=sensor,
        method=f"with its accelerometer, from {fit.n} attitudes at rest",
        entries={} if refused else _entries(fit),
        sections=sections,
        values=_values(fit, sensor),
        calibration=None if refused else fit.calibration,
        next_step="" if refused else following,
    )


def _entries(fit: PairFit) -> dict[str, str]:
    """What was found, by name."""
    entries = {
        "Heading": f"± {significant(fit.heading_sd_deg, 2)}°, slope ± "
        f"{significant(fit.slope_sd_deg, 2)}° (within 60° of level)",
        "Dip": f"{fit.inclination_deg:.2f}° ± {significant(fit.inclination_sd_deg, 2)}°",
        "Turn": f"{quantity(fit.turn_deg, '°', 3)} between the two sensors ± "
        f"{significant(float(fit.turn_sd_deg.max()), 2)}°",
    }
    if fit.sight is not None:
        axis = ", ".join(group_digits(float(part), 4) for part in fit.sight.axis)
        entries["Sight"] = (
            f"({axis}) in the accelerometer's axes ± {significant(fit.sight.sd_deg, 2)}°; x of "
            "the calibrated axes"
        )
    noise = f"{significant(float(fit.noise[0]), 2)} m/s²; {significant(float(fit.noise[1]), 2)}"
    entries["Noise"] = f"{noise} {fit.calibration.unit_in} of a shot"
    return entries


def _shots(fit: PairFit) -> Section:
    """How far each shot is off, in standard deviations."""
    out = set(fit.left_out.tolist())
    rows = [
        [
            str(fit.shot[i]),
            str(fit.target[i]) if fit.target[i] else "",
            *("" if np.isnan(v) else group_digits(float(v), 1) for v in fit.residuals[i]),
            "left out" if i in out else "",
        ]
        for i in range(fit.n)
    ]
    said = "How far each shot is off, in standard deviations; beyond 4 something is wrong with it."
    return Section("Shots", [said, Table(SHOT_HEAD, rows, "numbers small", scrolls=True)])


def _terms(fit: PairFit) -> Section:
    """Bias and matrix of each sensor."""
    blocks: list[Any] = []
    for name, sensor, unit in (
        ("Accelerometer, m/s²", fit.accelerometer, ""),
        ("Magnetometer", fit.calibration, f", {fit.calibration.unit_in}"),
    ):
        blocks += [name, Table(TERM_HEAD, _rows(sensor, unit), "numbers")]
    return Section("Calibrations", blocks)


def _rows(sensor: Affine, unit: str) -> list[list[str]]:
    """Bias, its standard error, and the rows of the matrix."""
    assert sensor.sd is not None

    def written(label: str, values: Array, digits: int) -> list[str]:
        return [label, *(significant(float(value), digits) for value in values)]

    return [
        written(f"bias{unit}", sensor.bias, 5),
        written("± ", sensor.sd[:3], 2),
        *(
            written(f"matrix {axis}", row, 6)
            for axis, row in zip("xyz", sensor.matrix, strict=True)
        ),
    ]


def _values(fit: PairFit, sensor: str) -> dict[str, Any]:
    values: dict[str, Any] = {
        "sensor": sensor,
        "n": fit.n,
        "left_out": [int(fit.shot[i]) for i in fit.left_out],
        "to_add": fit.to_add,
        "prior_only": fit.prior_only,
        "shots": [int(number) for number in fit.shot],
        "residuals": [[None if np.isnan(v) else float(v) for v in row] for row in fit.residuals],
    }
    if fit.verdict == "refused":
        return values
    sight = fit.sight
    return values | {
        "unit": fit.calibration.unit_in,
        "bias": fit.calibration.bias,
        "matrix": fit.calibration.matrix,
        "accelerometer_bias_m_s2": fit.accelerometer.bias,
        "accelerometer_matrix": fit.accelerometer.matrix,
        **make_record(fit),
        "sight": None if sight is None else sight.axis,
        "sight_sd_deg": None if sight is None else sight.sd_deg,
        "sight_scatter_deg": None if sight is None else sight.scatter_deg,
    }


def describe_check(check: PairCheck, sensor: str) -> Document:
    """Whether a setup still holds, and what may have changed."""
    columns: dict[str, Callable[[Change], str]] = {
        "": lambda one: one.name,
        "By": lambda one: f"{_join(one.size)} {one.unit}",
        "Standard errors": lambda one: _join(one.sd),
        "Headings, rms": lambda one: f"{significant(one.turns_deg, 2)}°",
        "Chance": lambda one: f"{one.chance:.2g}",
    }
    said = "Each change at its best, its effect on headings, and how likely it is by chance."
    return Document.judge(
        check,
        schema="agonic/check-pair@1",
        kind="Check of a setup by shots",
        name=sensor,
        method=f"a setup by {len(check.shot)} shots",
        sections=[Section("What may have changed", [said, tabulate(check.changes, columns)])],
        values={
            "sensor": sensor,
            "n": len(check.shot),
            **make_record(check),
            "odd": [int(check.shot[i]) for i in check.odd],
            "changes": [change._asdict() for change in check.changes],
        },
    )


def _join(values: Array) -> str:
    return ", ".join(significant(float(value), 2) for value in values)
