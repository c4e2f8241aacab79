"""What is said and shown of a platform's own field."""

from __future__ import annotations

from typing import Any

import numpy as np

from agonic.alignment.figures import draw_residuals
from agonic.alignment.remanence.fit import METHOD, RemanenceFit
from agonic.report.digits import with_sd
from agonic.report.document import Document
from agonic.report.markup import Markup, element
from agonic.report.origin import list_inputs
from agonic.report.section import Section

WHEN_CLEAN = "Use the platform; turn it again when something on it was changed."
CAPTION = "What is read at each angle of the platform beside the mean"


def describe_remanence(fit: RemanenceFit) -> Document:
    """The platform's own field, what is induced in it, and what was read at each angle.

    >>> from agonic.alignment.remanence import fit_remanence
    >>> from agonic.alignment.simulation.session import simulate_remanence
    >>> made = describe_remanence(fit_remanence(simulate_remanence()))
    >>> print(made.to_text().splitlines()[0])
    ✓ magnetometer: good (platform turned to 12 settings)
    """
    turned = f"{with_sd(fit.size_arcsec, fit.sd_arcsec)}″"
    entries = {"Remanence": f"{with_sd(fit.size, fit.sd)} nT across the axis of the turn, {turned}"}
    if fit.induced is not None:
        entries["Induced"] = f"{with_sd(fit.induced, fit.induced_sd)} nT, twice in a turn"
    read = [one.origin for one in (fit.samples, fit.reference) if one is not None]
    return Document(
        schema="agonic/fit-remanence@1",
        kind="Remanence of a platform",
        name=fit.samples.name,
        method=f"platform turned to {fit.n} settings",
        verdict=fit.verdict,
        status=fit.status,
        findings=fit.findings,
        move=next((finding.move for finding in fit.findings), WHEN_CLEAN),
        entries=entries,
        sections=[
            Section("At each angle of the platform", [lambda: _draw(fit)]),
            list_inputs(*read, method=METHOD),
        ],
        values=_values(fit),
        styles=["alignment.css"],
    )


def _draw(fit: RemanenceFit) -> Markup:
    angles = np.round(fit.angle_deg).astype(np.int64)
    drawn = draw_residuals(fit.field, fit.noise, angles, "angle of the platform, °")
    return element("figure", drawn, element("figcaption", CAPTION))


def _values(fit: RemanenceFit) -> dict[str, Any]:
    return {
        "sensor": fit.samples.name,
        "n": fit.n,
        "remanence_nT": fit.size,
        "remanence_sd_nT": fit.sd,
        "remanence_arcsec": fit.size_arcsec,
        "remanence_sd_arcsec": fit.sd_arcsec,
        "by_chance": fit.chance,
        "induced_nT": fit.induced,
        "induced_sd_nT": fit.induced_sd,
        "cosine_nT": fit.harmonics.once[0],
        "sine_nT": fit.harmonics.once[1],
        "angles_deg": fit.angle_deg,
    }
