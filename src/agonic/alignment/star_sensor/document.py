"""What is said and shown of an alignment with a star sensor, and of the plan of a session."""

from __future__ import annotations

from dataclasses import asdict
from datetime import UTC, datetime
from functools import partial
from typing import Any

import numpy as np

from agonic.alignment.figures import draw_figure, draw_residuals
from agonic.alignment.findings import judge, write_by_axis
from agonic.alignment.maths.two_frames import GROUPS
from agonic.alignment.star_sensor.budget import error_budget
from agonic.alignment.star_sensor.figures import draw_axes, draw_dome, draw_sky
from agonic.alignment.star_sensor.plan import AlignmentPlan
from agonic.alignment.star_sensor.result import AlignmentFit
from agonic.maths.equation.symmetric import pack_symmetric
from agonic.maths.rotations.frames import ARCSEC_RAD, rot_cn
from agonic.readable import make_record
from agonic.report.digits import MINUS, group_digits, quantity, significant, with_sd, write_minus
from agonic.report.document import Document
from agonic.report.markup import Markup, element
from agonic.report.section import Section, Table
from agonic.report.tables import NOTHING
from agonic.report.verdict import moves

WHEN_ALIGNED = (
    "Use this alignment; align again when either instrument was taken off the platform, or after a "
    "journey. Any eight orientations of a later night check whether it still holds."
)
ANGLES = ("α", "β", "γ")
ANGLE_HEAD = ("Angle", "Value", "Standard error")
QUATERNION_HEAD = ("Quaternion", "Value", "Standard error")
AXES_CAPTION = (
    "Axes of the star sensor (x, y, z; z the boresight) and of the magnetometer (x₃, y₃, z₃): "
    "turned by α about z (x to x₁), by β about the new y (z to z₃), by γ about the new z "
    "(x₂ to x₃); seen from a side, the angles between the axes are true"
)
BUDGET_HEAD = ("Effect", "Size, ″", "Size, nT", "Done", "Remark")
BUDGET_NOTE = (
    "What was corrected: the size is what leaving it out would cost. What was not: the size is by "
    "how much a direction may be wrong."
)
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
MATRIX_HEAD = ("Magnetometer", "star sensor x", "y", "z")


def describe_alignment(fit: AlignmentFit) -> Document:
    """The alignment with its standard errors, residuals, error budget and the sky.

    >>> from agonic.alignment.star_sensor.fit import fit_alignment
    >>> from agonic.alignment.simulation.session import simulate_session
    >>> made = describe_alignment(fit_alignment(simulate_session(orientations=5).session))
    >>> print(made.to_text().splitlines()[0])
    ! magnetometer: check (alignment with a star sensor, 5 orientations)
    >>> made.to_html().count('class="dome"'), made.to_html().count('class="dot"')
    (2, 10)
    """
    session, refused = fit.session, fit.verdict == "refused"
    return Document(
        schema="agonic/fit-alignment@1",
        kind="Alignment with a star sensor",
        name=session.magnetometer.name,
        title=session.name or session.magnetometer.name,
        method=f"alignment with a {session.star.name}, {fit.n} orientations",
        about=_about(fit),
        **judge(fit),
        move=next(iter(moves(fit.findings)), WHEN_ALIGNED),
        key_figures=_key_figures(fit),
        entries=_entries(fit),
        entries_title="",
        sections=[*([] if refused else [_describe_alignment(fit)]), *_list_evidence(fit)],
        values={**_rank(fit), **({} if refused else _numbers(fit))},
        calibration=fit.calibration,
        styles=["alignment.css"],
    )


def _about(fit: AlignmentFit) -> str:
    site, session = fit.session.site, fit.session
    return (
        f"{session.date}, {group_digits(site.latitude_deg, 4)}° north, "
        f"{group_digits(site.longitude_deg, 4)}° east ({site.coordinates}); "
        f"{session.magnetometer.name}, {session.star.name}, {session.reference.name}"
    )


def _key_figures(fit: AlignmentFit) -> list[tuple[str, str, str]]:
    worst, solution = fit.worst_sd_arcsec, fit.solution
    cost = worst * ARCSEC_RAD * solution.magnitude
    direction = float(np.sqrt((fit.residuals_arcsec**2).mean()))
    ratio = solution.chi2 / max(solution.freedom, 1)
    rank = f"rank {fit.rank} of {int(solution.free.sum())}"
    return [
        ("Alignment, worst axis", f"{significant(worst, 2)}″", f"{significant(cost, 2)} nT"),
        ("Residual", quantity(fit.residual_rms, "nT", 2), f"{significant(direction, 2)}″"),
        ("χ² a degree of freedom", significant(ratio, 3), f"{solution.freedom} degrees"),
        ("Condition", significant(fit.condition, 2), rank),
    ]


def _entries(fit: AlignmentFit) -> dict[str, str]:
    """The alignment in three lines, and what was solved for beside it."""
    quat = "  ".join(f"{value:+.9f}".replace("-", MINUS) for value in fit.quat_wxyz)
    angles = zip(ANGLES, fit.angles_deg, fit.angles_sd_arcsec, strict=True)
    return {
        "Angles": "   ".join(
            f"{name} {group_digits(value, 6)}° ± {significant(sd, 2)}″"
            for name, value, sd in angles
        ),
        "Error": f"about the magnetometer's {write_by_axis(fit.sd_arcsec)}",
        "Quat": f"w x y z {quat}",
        **_others(fit),
    }


def _others(fit: AlignmentFit) -> dict[str, str]:
    """What was found beside the alignment, in words, by a short name."""
    unknowns, sd = fit.solution.unknowns, fit.sd.copy()
    sd[GROUPS["reference"]] /= ARCSEC_RAD
    found = {
        "reference": (fit.reference_turn_arcsec, "turned about north, east, down by {}″"),
        "pier": (unknowns.offset, "{} nT"),
        "bias": (unknowns.bias, "{} nT"),
        "matrix": (pack_symmetric(unknowns.matrix), "xx yy zz xy xz yz  {}"),
    }
    said = {}
    for group in [one for one in found if one in fit.solution.groups]:
        values, words = found[group]
        each = map(with_sd, values.tolist(), sd[GROUPS[group]].tolist())
        said[group.capitalize()] = words.format(", ".join(each))
    return said


def _describe_alignment(fit: AlignmentFit) -> Section:
    """Angles, quaternion, matrix, and what else was solved for."""
    angles = [
        [f"{name}, degrees", group_digits(float(value), 7), f"{significant(float(sd), 2)}″"]
        for name, value, sd in zip(ANGLES, fit.angles_deg, fit.angles_sd_arcsec, strict=True)
    ]
    quaternion = [
        [name, group_digits(float(value), 9), write_minus(f"{sd:.1e}").replace("-", MINUS)]
        for name, value, sd in zip("wxyz", fit.quat_wxyz, fit.quat_sd, strict=True)
    ]
    cosines = [
        [
            axis,
            *(
                f"{group_digits(float(v), 8)} ± {significant(float(s), 2)}″"
                for v, s in zip(*row, strict=True)
            ),
        ]
        for axis, *row in zip("xyz", fit.rot_mc, fit.matrix_sd_arcsec, strict=True)
    ]
    return Section(
        "The alignment",
        [
            element(
                "div",
                Table(ANGLE_HEAD, angles).to_html(),
                Table(QUATERNION_HEAD, quaternion).to_html(),
                class_="pair tables",
            ),
            "Components in the star sensor’s axes become those in the magnetometer’s by "
            "R3(γ) R2(β) R3(α), the quaternion (Hamilton, scalar first) and this matrix. "
            "Standard errors about the magnetometer’s axes: "
            f"{write_by_axis(fit.sd_arcsec, between=', ')}.",
            Table(MATRIX_HEAD, cosines, scrolls=True),
            lambda: draw_figure(draw_axes(*map(float, fit.angles_deg)), AXES_CAPTION),
            _others(fit),
        ],
    )


def _rank(fit: AlignmentFit) -> dict[str, Any]:
    """What the session determines."""
    return {
        "method": "alignment",
        "sensor": fit.session.magnetometer.name,
        "n": fit.n,
        "solve": fit.solution.groups,
        "rank": fit.rank,
        "unknowns": int(fit.solution.free.sum()),
        "condition": fit.condition,
        "undetermined": fit.undetermined,
        "add": fit.add,
    }


def _numbers(fit: AlignmentFit) -> dict[str, Any]:
    """What was found, and how well it fits."""
    unknowns = fit.solution.unknowns
    return {
        **make_record(fit),
        "pier_nT": unknowns.offset,
        "bias_nT": unknowns.bias,
        "matrix": unknowns.matrix,
        "sd": fit.sd,
        "chi2": fit.solution.chi2,
        "freedom": fit.solution.freedom,
        "orientations": [
            {
                "orientation": number,
                "residual_nT": fit.residuals[k],
                "sd_nT": fit.solution.residuals_sd[k],
                "residual_arcsec": fit.residuals_arcsec[k],
            }
            for k, number in enumerate(fit.observed.orientation.tolist())
        ],
        "error_budget": [asdict(effect) for effect in error_budget(fit)],
    }


def _list_evidence(fit: AlignmentFit) -> list[Section]:
    """Residuals, the sky, and the error budget."""
    found, numbers = fit.solution, fit.observed.orientation
    drawn = partial(draw_residuals, found.residuals, found.residuals_sd, numbers)
    residuals = Table(RESIDUAL_HEAD, _residual_rows(fit), "numbers small", scrolls=True)
    budget = Table(BUDGET_HEAD, _budget_rows(fit), "budget", scrolls=True)
    return [
        Section("Residuals of each orientation", [drawn, residuals]),
        Section("Where the star sensor looked", [lambda: _skies(fit)], style="pair"),
        Section("Error budget", [BUDGET_NOTE, budget]),
    ]


def _residual_rows(fit: AlignmentFit) -> list[list[str]]:
    """Each orientation: where it looked, what is left in nT and in arcseconds."""
    seen = fit.observed
    azimuth = np.degrees(np.arctan2(seen.boresight_n[:, 1], seen.boresight_n[:, 0])) % 360
    sd = np.sqrt((fit.solution.residuals_sd**2).mean(axis=1))
    return [
        [
            str(number),
            datetime.fromtimestamp(float(seen.time[k]), UTC).strftime("%H:%M:%S"),
            f"{group_digits(float(azimuth[k]))}°",
            f"{group_digits(float(seen.elevation_deg[k]))}°",
            str(seen.readings[k, 1]),
            *(group_digits(float(value), 3) for value in (*fit.residuals[k], sd[k])),
            group_digits(float(fit.residuals_arcsec[k]), 2),
        ]
        for k, number in enumerate(seen.orientation.tolist())
    ]


def _skies(fit: AlignmentFit) -> list[Markup]:
    seen = fit.observed
    over_site = draw_dome(seen.boresight_n, seen.orientation, fit.residuals_arcsec)
    among_stars = draw_sky(seen.boresight_i, seen.orientation, fit.residuals_arcsec)
    up = "Over the site: north up, east right, the horizon at the rim"
    pole = (
        "Among the stars: right ascension round the celestial pole, J2000. The larger the dot, the "
        "larger the residual"
    )
    return [draw_figure(over_site, up), draw_figure(among_stars, pole)]


def _budget_rows(fit: AlignmentFit) -> list[list[str]]:
    """The error budget, a row an effect; a size of 0 means that nothing is known of it."""
    rows = []
    for effect in error_budget(fit):
        size_nT = effect.size_arcsec * ARCSEC_RAD * fit.solution.magnitude
        sizes = (effect.size_arcsec, size_nT)
        shown = [significant(size, 3) if size else NOTHING for size in sizes]
        rows.append([effect.name, *shown, effect.treatment, write_minus(effect.remark)])
    return rows


KEYS = ("azimuth_deg", "elevation_deg", "roll_deg")
PLAN_HEAD = ("Orientation", "Azimuth", "Elevation", "Roll", "Worst axis so far", "Begun, remarks")
ROLL = (
    "Azimuth and elevation are where the star sensor looks, roll turns it about that; with roll 0 "
    "its x axis points to the horizon below."
)


def describe_plan(plan: AlignmentPlan) -> Document:
    """The orientations with their dome, a column to fill in, and the standard errors to expect.

    >>> from agonic.alignment.star_sensor.plan import plan_alignment
    >>> made = describe_plan(plan_alignment([18_870, 1_390, 45_750], wanted_sd_arcsec=2.0))
    >>> made.to_text().splitlines()[0][:40], made.to_html().count("<svg")
    ('6 orientations of 20 readings each: the ', 1)
    """
    return Document(
        schema="agonic/plan-alignment@1",
        kind="Plan of a session",
        name="Alignment with a star sensor",
        status=f"{len(plan.orientations)} orientations of {plan.readings} readings each: the "
        f"alignment to ± {significant(plan.worst_sd_arcsec, 2)}″ about its worst axis",
        sections=[
            Section(
                "Orientations",
                [
                    Table(PLAN_HEAD, _plan_rows(plan), "orientations", scrolls=True),
                    lambda: _dome(plan),
                ],
                printed=True,
                style="pair plan",
            ),
            Section("", [ROLL], printed=True),
            Section("Standard errors to expect", [_describe_expected(plan)], printed=True),
        ],
        values={
            "orientations": [dict(zip(KEYS, one, strict=True)) for one in plan.orientations],
            **make_record(plan),
        },
        styles=["alignment.css"],
    )


def _plan_rows(plan: AlignmentPlan) -> list[list[str]]:
    """Each orientation in its order, and how well the alignment is known after it."""
    rows: list[list[str]] = []
    for orientation, sd in zip(plan.orientations, plan.sd_arcsec, strict=True):
        known = f"{significant(sd, 3)}″" if np.isfinite(sd) else "not determined"
        rows.append([str(len(rows) + 1), *(f"{angle:g}°" for angle in orientation), known, ""])
    return rows


def _dome(plan: AlignmentPlan) -> Markup:
    boresight, count = rot_cn(*np.array(plan.orientations).T)[:, 2], len(plan.orientations)
    drawn = draw_dome(boresight, np.arange(1, count + 1), np.ones(count))
    return draw_figure(drawn, "North is up, east to the right.")


def _describe_expected(plan: AlignmentPlan) -> dict[str, str]:
    """Standard errors of every group that is solved for."""
    said = {}
    for group in plan.solve:
        sds = plan.sd[GROUPS[group]].tolist()
        if group in ("alignment", "reference"):
            each = [f"{significant(sd / ARCSEC_RAD, 2)}″" for sd in sds]
        else:
            each = [quantity(sd, "nT", 2) for sd in sds]
        if group == "matrix":
            each = [write_minus(f"{sd:.1e}") for sd in sds]
        said[group] = "  ".join(each)
    return said
