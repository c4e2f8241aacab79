"""The result of `fit_alignment` and the plan of a session as plain text, and their tables."""

from __future__ import annotations

import textwrap
from datetime import UTC, datetime

import numpy as np

from agonic.alignment.star_sensor import AlignmentFit, AlignmentPlan, error_budget
from agonic.maths.equation.alignment import GROUPS
from agonic.maths.equation.symmetric import pack_symmetric
from agonic.maths.rotations.frames import ARCSEC_RAD
from agonic.report.digits import MINUS, grouped, minused, quantity, significant, with_sd
from agonic.report.text import SIGNS
from agonic.report.verdict import MEANINGS

WIDTH, NOTHING = 98, "–"
ANGLES = ("α", "β", "γ")


def alignment_text(fit: AlignmentFit) -> str:
    """Verdict, angles with standard errors, quaternion, what else was solved for, on one screen.

    >>> from agonic.alignment.star_sensor import fit_alignment
    >>> from agonic.alignment.simulation.session import simulate_session
    >>> print(alignment_text(fit_alignment(simulate_session().session)).splitlines()[0])
    ✓ magnetometer: good (alignment with a star sensor, 24 orientations)
    """
    session = fit.session
    word = MEANINGS[fit.verdict][0].lower()
    lines = [
        f"{SIGNS[fit.verdict]} {session.magnetometer.name}: {word} (alignment with a "
        f"{session.star.name}, {fit.n} orientations)",
        *wrapped(minused(fit.status)),
    ]
    if fit.verdict == "refused":
        return "\n".join(lines)
    angles = "   ".join(
        f"{name} {grouped(value, 6)}° ± {significant(sd, 2)}″"
        for name, value, sd in zip(ANGLES, fit.angles_deg, fit.angles_sd_arcsec, strict=True)
    )
    about = "   ".join(
        f"{axis} {significant(sd, 2)}″" for axis, sd in zip("xyz", fit.sd_arcsec, strict=True)
    )
    quat = "  ".join(f"{value:+.9f}".replace("-", MINUS) for value in fit.quat_wxyz)
    lines += [
        f"  Angles    {angles}",
        f"  Error     about the magnetometer's {about}",
        f"  Quat      w x y z {quat}",
        *(line for name, text in others(fit).items() for line in _entry(name, text)),
    ]
    return "\n".join(lines)


def wrapped(text: str) -> list[str]:
    """Lines of a terminal's width, indented."""
    return textwrap.wrap(text, WIDTH, initial_indent="  ", subsequent_indent="  ")


def _entry(name: str, text: str) -> list[str]:
    """A name and what stands behind it, on as many lines as that takes."""
    return textwrap.wrap(
        text,
        WIDTH,
        initial_indent=f"  {name:<10}",
        subsequent_indent=" " * 12,
        break_long_words=False,
    )


def others(fit: AlignmentFit) -> dict[str, str]:
    """What was found beside the alignment, in words, by a short name."""
    groups, sd = fit.solution.groups, fit.sd
    said = {}
    if "reference" in groups:
        said["Reference"] = "turned about north, east, down by " + _three(
            fit.reference_turn_arcsec, sd[GROUPS["reference"]] / ARCSEC_RAD, "″"
        )
    if "pier" in groups:
        said["Pier"] = _three(fit.solution.unknowns.offset, sd[GROUPS["pier"]], "nT")
    if "bias" in groups:
        said["Bias"] = _three(fit.solution.unknowns.bias, sd[GROUPS["bias"]], "nT")
    if "matrix" in groups:
        six = pack_symmetric(fit.solution.unknowns.matrix)
        said["Matrix"] = "xx yy zz xy xz yz  " + ", ".join(
            with_sd(float(v), float(s)) for v, s in zip(six, sd[GROUPS["matrix"]], strict=True)
        )
    return said


def _three(values: np.ndarray, sds: np.ndarray, unit: str) -> str:
    parts = [with_sd(float(v), float(s)) for v, s in zip(values, sds, strict=True)]
    return f"{', '.join(parts)} {unit}"


RESIDUAL_HEAD = (
    "Orientation",
    "Time, UTC",
    "Azimuth",
    "Elevation",
    "Readings",
    "x, nT",
    "y, nT",
    "z, nT",
    "Expected sd, nT",
    "Direction, ″",
)


def residual_rows(fit: AlignmentFit) -> list[list[str]]:
    """Each orientation: where it looked, what is left in nT and in arcseconds."""
    boresight = fit.observed.boresight_n
    azimuth = np.degrees(np.arctan2(boresight[:, 1], boresight[:, 0])) % 360
    rows = []
    for k, number in enumerate(fit.observed.orientation.tolist()):
        when = datetime.fromtimestamp(float(fit.observed.time[k]), UTC)
        sd = float(np.sqrt((fit.residuals_sd[k] ** 2).mean()))
        rows.append(
            [
                str(number),
                when.strftime("%H:%M:%S"),
                f"{grouped(float(azimuth[k]))}°",
                f"{grouped(float(fit.observed.elevation_deg[k]))}°",
                f"{int(fit.observed.readings[k, 1])}",
                *(grouped(float(value), 3) for value in fit.residuals[k]),
                grouped(sd, 3),
                grouped(float(fit.residuals_arcsec[k]), 2),
            ]
        )
    return rows


BUDGET_HEAD = ("Effect", "Size, ″", "Size, nT", "Done", "Remark")


def budget_rows(fit: AlignmentFit) -> list[list[str]]:
    """The error budget, a row an effect."""
    return [
        [
            effect.name,
            _size(effect.size_arcsec),
            _size(effect.size_nT(fit.solution.magnitude)),
            effect.treatment,
            minused(effect.remark),
        ]
        for effect in error_budget(fit)
    ]


def _size(value: float) -> str:
    """A size to three digits; none where nothing is known of it."""
    return significant(value, 3) if value else NOTHING


def plan_text(plan: AlignmentPlan) -> str:
    """The orientations in order, and the standard error of the alignment after each.

    >>> from agonic.alignment.star_sensor import plan_alignment
    >>> plan = plan_alignment([18_870, 1_390, 45_750], wanted_sd_arcsec=2.0)
    >>> plan_text(plan).splitlines()[0][:40]
    '6 orientations of 20 readings each: the '
    """
    lines = [
        f"{len(plan.orientations)} orientations of {plan.readings} readings each: the alignment "
        f"known to {significant(plan.worst_sd_arcsec, 2)}″ about its worst axis",
        "",
        "     azimuth  elevation  roll   worst axis so far",
    ]
    for k, ((azimuth, elevation, roll), sd) in enumerate(
        zip(plan.orientations, plan.sd_arcsec, strict=True), start=1
    ):
        known = f"{significant(sd, 3)}″" if np.isfinite(sd) else "not determined"
        lines.append(f"{k:3d}  {azimuth:6.0f}°  {elevation:8.0f}°  {roll:4.0f}°   {known}")
    lines += ["", *wrapped(ROLL), "", "Standard errors to expect"]
    return "\n".join([*lines, *(f"  {name:<10}{text}" for name, text in expected(plan).items())])


ROLL = (
    "Azimuth and elevation are where the star sensor looks, roll turns it about that; with roll 0 "
    "its x axis points to the horizon below."
)


def expected(plan: AlignmentPlan) -> dict[str, str]:
    """Standard errors of every group that is solved for."""
    units = {"alignment": "″", "reference": "″", "pier": "nT", "bias": "nT", "matrix": ""}
    said = {}
    for group in plan.solve:
        sd = plan.sd[GROUPS[group]] / (ARCSEC_RAD if units[group] == "″" else 1.0)
        small = group == "matrix"
        cells = [
            minused(f"{value:.1e}") if small else _with_unit(float(value), units[group])
            for value in sd
        ]
        said[group] = "  ".join(cells)
    return said


def _with_unit(value: float, unit: str) -> str:
    return f"{significant(value, 2)}″" if unit == "″" else quantity(value, unit, 2)
