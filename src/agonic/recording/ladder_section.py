"""The ladder of fits as a section: a table, why the chosen one was chosen, what a network could."""

from __future__ import annotations

import numpy as np

from agonic.recording.calibrated import Calibrated
from agonic.recording.ladder import Rung
from agonic.report.digits import percent
from agonic.report.fields import make_table
from agonic.report.markup import Markup, element
from agonic.report.section import Section

TITLE = "Ladder of fits"
LEFT = 1.5
"""Held-out residual over noise beyond which something is left for a network."""


def describe_ladder(result: Calibrated, *, printed: bool) -> list[Section]:
    """The section; none without a ladder. It is part of the plain text where `printed`."""
    rungs = result.ladder
    if not rungs:
        return []
    return [
        Section(
            TITLE,
            [
                make_table(
                    rungs, taken=lambda one: one.chosen, style="numbers ladder", scrolls=True
                ),
                _say_why(rungs),
                _say_of_network(result),
                _explain(),
            ],
            printed=printed,
        )
    ]


def summarise_ladder(result: Calibrated) -> dict[str, str]:
    """The ladder as one line, for the text of several sensors: what unseen magnitudes leave."""
    rungs = [rung for rung in result.ladder if np.isfinite(rung.spread)]
    steps = (f"{'✓ ' if one.chosen else ''}{one.name} {percent(one.spread)}" for one in rungs)
    return {"Ladder": f"spread, unseen: {', '.join(steps)}"} if rungs else {}


def _say_why(rungs: tuple[Rung, ...]) -> str:
    chosen = next(rung for rung in rungs if rung.chosen)
    return f"✓ {chosen.name}: {chosen.why}."


def _say_of_network(result: Calibrated) -> str:
    """Whether anything is left for a network; that nothing is, is said on the page alone."""
    fit = result.fit
    gain = float(np.trace(fit.calibration.matrix) / 3)
    ratio = result.verification.residual_rms / max(fit.noise * gain, 1e-12)
    if ratio < LEFT:
        return element(
            "p",
            f"Nothing is left for a network: unseen residuals are {ratio:.1f} times the noise of "
            "the readings.",
        )
    return (
        f"Unseen residuals are {ratio:.1f} times the noise: with a known field, "
        "agonic fit network LOG --reference TABLE tells whether a network finds more."
    )


def _explain() -> Markup:
    return element(
        "p",
        "Spread and residual are those of the magnitude in blocks of time that the fit had not "
        "seen. The heading error is that of a level vehicle, rms over all headings, as the chosen "
        "fit sees it, with its standard error; the chosen fit’s own is its standard error of a "
        "heading. A mounting by right angles is not counted.",
        class_="aside",
    )
