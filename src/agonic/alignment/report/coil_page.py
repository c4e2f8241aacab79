"""`coil_page`: a coil's axis, constant and linearity as a page of its own."""

from __future__ import annotations

from agonic.alignment.coil import CoilFit
from agonic.alignment.report import north_text as words
from agonic.alignment.report.north_page import page
from agonic.report.blocks import part
from agonic.report.digits import grouped, significant
from agonic.report.markup import table
from agonic.report.tables import definitions

LEVEL_HEAD = ("Current, A", "Constant, nT/A", "Standard error", "Departure", "Departure, ppm")


def coil_page(fit: CoilFit, *, title: str = "") -> str:
    """The coil's axis in every frame, its constant at each current, and what was objected to.

    >>> from agonic.alignment.coil import fit_coil
    >>> from agonic.alignment.simulation.coil import simulate_coil
    >>> page = coil_page(fit_coil(simulate_coil(levels=(1.0, 0.5)).session))
    >>> page.count("<h2>")
    3
    """
    parts = [part("What was found", definitions(words.coil_entries(fit)))]
    if fit.levels:
        rows = [
            [
                grouped(level.current_A, 5),
                grouped(level.constant, 3),
                significant(level.sd, 2),
                significant(level.departure, 2),
                significant(1e6 * level.departure / fit.constant, 2),
            ]
            for level in fit.levels
        ]
        parts.append(part("Linearity", table(LEVEL_HEAD, rows, class_="numbers small")))
    about = f"Magnetic axis of a coil, {fit.reversals} current reversals"
    return page(fit, about, title or fit.session.name or fit.session.coil, parts)
