"""What is said and shown of an alignment with a star sensor, and of the plan of a session."""

from __future__ import annotations

from dataclasses import asdict
from datetime import UTC, datetime
from functools import partial
from typing import Any

import numpy as np

from agonic.alignment.document import make_document, write_by_axis
from agonic.alignment.figures import draw_axes, draw_dome, draw_figure, draw_residuals, draw_sky
from agonic.alignment.maths.two_frames import GROUPS
from agonic.alignment.star_sensor.budget import error_budget
from agonic.alignment.star_sensor.plan import AlignmentPlan
from agonic.alignment.star_sensor.result import AlignmentFit
from agonic.maths.equation.symmetric import pack_symmetric
from agonic.maths.rotations.frames import ARCSEC_RAD, rot_cn
from agonic.readable import make_record
from agonic.report.digits import MINUS, group_digits, quantity, significant, with_sd, write_minus
from agonic.report.document import Document
from agonic.report.markup import Markup, element
from agonic.report.section import Block, Section, Table
from agonic.report.tables import NOTHING
from agonic.report.verdict import moves

ANGLES = ("α", "β", "γ")
AXES_CAPTION = (
    "Axes of the star sensor (x, y, z; z the boresight) and of the magnetometer (x₃, y₃, z₃): "
    "turned by α about z (x to x₁), by β about the new y (z to z₃), by γ about the new z "
    "(x₂ to x₃); seen from a side, the angles between the axes are true"
)
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


def describe_alignment(fit: AlignmentFit) -> Document:
    """The alignment with its standard errors, residuals, error budget and the sky."""
    session, solution = fit.session, fit.solution
    site, cost = session.site, fit.worst_sd_arcsec * ARCSEC_RAD * solution.magnitude
    direction = float(np.sqrt((fit.residuals_arcsec**2).mean()))
    ratio = solution.chi2 / max(solution.freedom, 1)
    rank = f"rank {fit.rank} of {int(solution.free.sum())}"
    worst = f"{significant(fit.worst_sd_arcsec, 2)}″"
    residual = quantity(fit.residual_rms, "nT", 2)
    use = (
        "Use this alignment; align again when either instrument was taken off the platform, or "
        "after a journey. Any eight orientations of a later night check whether it still holds."
    )
    return make_document(
        fit,
        _numbers(fit),
        schema="agonic/fit-alignment@1",
        kind="Alignment with a star sensor",
        name=session.magnetometer.name,
        title=session.name or session.magnetometer.name,
        method=f"alignment with a {session.star.name}, {fit.n} orientations",
        about=f"{session.date}, {group_digits(site.latitude_deg, 4)}° north, "
        f"{group_digits(site.longitude_deg, 4)}° east ({site.coordinates}); "
        f"{session.magnetometer.name}, {session.star.name}, {session.reference.name}",
        move=next(iter(moves(fit.findings)), use),
        key_figures=[
            ("Alignment, worst axis", worst, f"{significant(cost, 2)} nT"),
            ("Residual", residual, f"{significant(direction, 2)}″"),
            ("χ² a degree of freedom", significant(ratio, 3), f"{solution.freedom} degrees"),
            ("Condition", significant(fit.condition, 2), rank),
        ],
        entries=_entries(fit),
        entries_title="",
        sections=[
            Section("The alignment", [] if fit.verdict == "refused" else _describe_alignment(fit)),
            *_list_evidence(fit),
        ],
        values={
            "method": "alignment",
            "sensor": session.magnetometer.name,
            "solve": solution.groups,
            "unknowns": int(solution.free.sum()),
            **{one: getattr(fit, one) for one in ("n", "rank", "condition", "undetermined", "add")},
        },
    )


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


def _describe_alignment(fit: AlignmentFit) -> list[Block]:
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
    pair = (
        Table((name, "Value", "Standard error"), rows).to_html()
        for name, rows in (("Angle", angles), ("Quaternion", quaternion))
    )
    return [
        element("div", *pair, class_="pair tables"),
        "Components in the star sensor’s axes become those in the magnetometer’s by "
        "R3(γ) R2(β) R3(α), the quaternion (Hamilton, scalar first) and this matrix. "
        "Standard errors about the magnetometer’s axes: "
        f"{write_by_axis(fit.sd_arcsec, between=', ')}.",
        Table(("Magnetometer", "star sensor x", "y", "z"), cosines, scrolls=True),
        lambda: draw_figure(draw_axes(*map(float, fit.angles_deg)), AXES_CAPTION),
        _others(fit),
    ]


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
    """Residuals of each orientation in nT and arcseconds, the sky, and the error budget, in which a
    size of 0 means that nothing is known of it."""
    found, seen = fit.solution, fit.observed
    azimuth = np.degrees(np.arctan2(seen.boresight_n[:, 1], seen.boresight_n[:, 0])) % 360
    sd = np.sqrt((found.residuals_sd**2).mean(axis=1))
    rows = [
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
    effects = [
        [
            effect.name,
            *(
                significant(effect.size_arcsec * per, 3) if effect.size_arcsec else NOTHING
                for per in (1.0, ARCSEC_RAD * found.magnitude)
            ),
            effect.treatment,
            write_minus(effect.remark),
        ]
        for effect in error_budget(fit)
    ]
    drawn = partial(draw_residuals, found.residuals, found.residuals_sd, seen.orientation)

    def draw_skies() -> list[Markup]:
        dots = seen.orientation, fit.residuals_arcsec
        over = "Over the site: north up, east right, the horizon at the rim"
        among = "Among the stars: right ascension round the celestial pole, J2000. "
        among += "The larger the dot, the larger the residual"
        over_site = draw_figure(draw_dome(seen.boresight_n, *dots), over)
        return [over_site, draw_figure(draw_sky(seen.boresight_i, *dots), among)]

    residuals = Table(RESIDUAL_HEAD, rows, "numbers small", scrolls=True)
    head = ("Effect", "Size, ″", "Size, nT", "Done", "Remark")
    budget = Table(head, effects, "budget", scrolls=True)
    return [
        Section("Residuals of each orientation", [drawn, residuals]),
        Section("Where the star sensor looked", [draw_skies], style="pair"),
        Section("Error budget", [BUDGET_NOTE, budget]),
    ]


def describe_plan(plan: AlignmentPlan) -> Document:
    """The orientations with their dome, a column to fill in, and the standard errors to expect."""
    rows: list[list[str]] = []
    for orientation, sd in zip(plan.orientations, plan.sd_arcsec, strict=True):
        known = f"{significant(sd, 3)}″" if np.isfinite(sd) else "not determined"
        rows.append([str(len(rows) + 1), *(f"{angle:g}°" for angle in orientation), known, ""])
    boresight, numbers = rot_cn(*np.array(plan.orientations).T)[:, 2], np.arange(1, len(rows) + 1)

    def draw() -> Markup:
        drawn = draw_dome(boresight, numbers, np.ones(len(rows)))
        return draw_figure(drawn, "North is up, east to the right.")

    head = ("Orientation", "Azimuth", "Elevation", "Roll", "Worst axis so far", "Begun, remarks")
    table = Table(head, rows, "orientations", scrolls=True)
    roll = (
        "Azimuth and elevation are where the star sensor looks, roll turns it about that; with "
        "roll 0 its x axis points to the horizon below."
    )
    keys = ("azimuth_deg", "elevation_deg", "roll_deg")
    return Document(
        schema="agonic/plan-alignment@1",
        kind="Plan of a session",
        name="Alignment with a star sensor",
        status=f"{len(rows)} orientations of {plan.readings} readings each: the "
        f"alignment to ± {significant(plan.worst_sd_arcsec, 2)}″ about its worst axis",
        sections=[
            Section("Orientations", [table, draw], printed=True, style="pair plan"),
            Section("", [roll], printed=True),
            Section("Standard errors to expect", [_describe_expected(plan)], printed=True),
        ],
        values={
            "orientations": [dict(zip(keys, one, strict=True)) for one in plan.orientations],
            **make_record(plan),
        },
        styles=["alignment.css"],
    )


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
