"""`alignment_page`: the alignment of a magnetometer with a star sensor as one page of its own."""

from __future__ import annotations

import numpy as np

from agonic.alignment.report import alignment_text as words
from agonic.alignment.report import drawings
from agonic.alignment.star_sensor import AlignmentFit, AlignmentPlan
from agonic.maths.rotations.frames import rot_cn
from agonic.report.blocks import header, key_figures, part, verdict
from agonic.report.digits import grouped, minused, quantity, significant
from agonic.report.documents import document, static
from agonic.report.markup import Markup, element, markup, table
from agonic.report.tables import definitions, findings, provenance
from agonic.report.verdict import WHEN_GOOD, moves


def alignment_page(fit: AlignmentFit, *, title: str = "") -> str:
    """The alignment with its standard errors, residuals, error budget and the sky, as HTML.

    >>> from agonic.alignment.star_sensor import fit_alignment
    >>> from agonic.alignment.simulation.session import simulate_session
    >>> page = alignment_page(fit_alignment(simulate_session(orientations=5).session))
    >>> page.count('class="dome"'), page.count('class="dot"')
    (2, 10)
    """
    name = title or fit.session.name or fit.session.magnetometer.name
    refused = fit.verdict == "refused"
    parts = [
        verdict(
            fit.verdict,
            minused(fit.status),
            move=next(iter(moves(fit.findings)), WHEN_GOOD),
        ),
        "" if refused else _key_figures(fit),
        "" if refused else part("The alignment", *_alignment(fit)),
        part("Residuals of each orientation", *_residuals(fit)),
        part("Where the star sensor looked", *_skies(fit)),
        part("Error budget", *_budget(fit)),
        part("Findings", findings(fit.findings)),
        part("Provenance", provenance(fit.calibration, None)),
    ]
    body = markup(
        _header("Alignment with a star sensor", name, _about(fit)), element("main", *parts)
    )
    return document(name, body, style=static("report.css") + static("alignment.css"))


def plan_page(plan: AlignmentPlan, *, title: str = "") -> str:
    """A plan for the observatory: the orientations with their dome, and a column to fill in.

    >>> from agonic.alignment.star_sensor import plan_alignment
    >>> plan_page(plan_alignment([18_870, 1_390, 45_750], wanted_sd_arcsec=3)).count("<svg")
    1
    """
    name = title or "Alignment with a star sensor"
    attitude = rot_cn(*np.array(plan.orientations).T)
    numbers = np.arange(1, len(attitude) + 1)
    rows = [
        [
            str(k),
            f"{a:g}°",
            f"{e:g}°",
            f"{r:g}°",
            f"{significant(sd, 3)}″" if np.isfinite(sd) else "not determined",
            "",
        ]
        for k, ((a, e, r), sd) in enumerate(
            zip(plan.orientations, plan.sd_arcsec, strict=True), start=1
        )
    ]
    head = ("Orientation", "Azimuth", "Elevation", "Roll", "Worst axis so far", "Begun, remarks")
    body = markup(
        _header("Plan of a session", name, words.plan_text(plan).splitlines()[0]),
        element(
            "main",
            part(
                "Orientations",
                element(
                    "div",
                    table(head, rows, class_="orientations"),
                    element(
                        "figure",
                        drawings.dome(attitude[:, 2], numbers, np.ones(len(numbers))),
                        element("figcaption", f"North is up, east to the right. {words.ROLL}"),
                    ),
                    class_="pair plan",
                ),
            ),
            part("Standard errors to expect", definitions(words.expected(plan))),
        ),
    )
    return document(name, body, style=static("report.css") + static("alignment.css"))


def _header(kicker: str, name: str, about: str) -> Markup:
    return header(kicker, name, element("p", about, class_="kicker"))


def _scroll(wide: Markup) -> Markup:
    """A table that may be wider than a small screen."""
    return element("div", wide, class_="scroll")


def _about(fit: AlignmentFit) -> str:
    site, session = fit.session.site, fit.session
    return (
        f"{session.date}, {grouped(site.latitude_deg, 4)}° north, "
        f"{grouped(site.longitude_deg, 4)}° east ({site.coordinates}); "
        f"{session.magnetometer.name}, {session.star.name}, {session.reference.name}"
    )


def _key_figures(fit: AlignmentFit) -> Markup:
    magnitude = fit.solution.magnitude
    worst = fit.worst_sd_arcsec
    cost = worst / 206_265 * magnitude
    direction = float(np.sqrt((fit.residuals_arcsec**2).mean()))
    ratio = fit.solution.chi2 / max(fit.solution.freedom, 1)
    return key_figures(
        [
            ("Alignment, worst axis", f"{significant(worst, 2)}″", f"{significant(cost, 2)} nT"),
            ("Residual", quantity(fit.residual_rms, "nT", 2), f"{significant(direction, 2)}″"),
            ("χ² a degree of freedom", significant(ratio, 3), f"{fit.solution.freedom} degrees"),
            (
                "Condition",
                significant(fit.condition, 2),
                f"rank {fit.rank} of {int(fit.solution.free.sum())}",
            ),
        ]
    )


def _alignment(fit: AlignmentFit) -> list[Markup]:
    """Angles, quaternion, matrix, and what else was solved for."""
    angles = [
        [f"{name}, degrees", grouped(float(value), 7), f"{significant(float(sd), 2)}″"]
        for name, value, sd in zip(words.ANGLES, fit.angles_deg, fit.angles_sd_arcsec, strict=True)
    ]
    quaternion = [
        [name, grouped(float(value), 9), f"{sd:.1e}".replace("-", "−")]
        for name, value, sd in zip("wxyz", fit.quat_wxyz, fit.quat_sd, strict=True)
    ]
    sd = fit.matrix_sd_arcsec
    rows = [
        [
            axis,
            *(
                f"{grouped(float(v), 8)} ± {significant(float(s), 2)}″"
                for v, s in zip(fit.rot_mc[k], sd[k], strict=True)
            ),
        ]
        for k, axis in enumerate(("x", "y", "z"))
    ]
    about = ", ".join(
        f"{axis} {significant(float(s), 2)}″" for axis, s in zip("xyz", fit.sd_arcsec, strict=True)
    )
    said = [
        element(
            "div",
            table(("Angle", "Value", "Standard error"), angles, class_="numbers"),
            table(("Quaternion", "Value", "Standard error"), quaternion, class_="numbers"),
            class_="pair tables",
        ),
        element(
            "p",
            "Components in the star sensor’s axes become those in the magnetometer’s by "
            "R3(γ) R2(β) R3(α), the quaternion (Hamilton, scalar first) and this matrix. "
            f"Standard errors about the magnetometer’s axes: {about}.",
            class_="aside",
        ),
        _scroll(table(("Magnetometer", "star sensor x", "y", "z"), rows, class_="numbers")),
    ]
    more = words.others(fit)
    return [*said, definitions(more)] if more else said


def _residuals(fit: AlignmentFit) -> list[Markup]:
    legend = element(
        "p",
        *(element("span", element("span", class_=f"key bar-{a}"), a) for a in "xyz"),
        element("span", element("span", class_="key band"), "twice what the noise explains"),
        class_="legend",
    )
    return [
        element(
            "figure",
            legend,
            drawings.bars(fit.residuals, fit.residuals_sd, fit.observed.orientation),
            element("figcaption", "Residuals by orientation, nT, magnetometer axes"),
        ),
        _scroll(table(words.RESIDUAL_HEAD, words.residual_rows(fit), class_="numbers small")),
    ]


def _skies(fit: AlignmentFit) -> list[Markup]:
    seen = fit.observed
    return [
        element(
            "div",
            element(
                "figure",
                drawings.dome(seen.boresight_n, seen.orientation, fit.residuals_arcsec),
                element(
                    "figcaption", "Over the site: north up, east right, the horizon at the rim"
                ),
            ),
            element(
                "figure",
                drawings.sky(seen.boresight_i, seen.orientation, fit.residuals_arcsec),
                element(
                    "figcaption",
                    "Among the stars: right ascension round the celestial "
                    "pole, J2000. The larger the dot, the larger the residual",
                ),
            ),
            class_="pair",
        )
    ]


def _budget(fit: AlignmentFit) -> list[Markup]:
    said = (
        "What was corrected: the size is what leaving it out would cost. What was not: the size is "
        "by how much a direction may be wrong."
    )
    return [
        element("p", said, class_="aside"),
        _scroll(table(words.BUDGET_HEAD, words.budget_rows(fit), class_="budget")),
    ]
