"""Parts of what is said of a log: a few lines for each magnetometer and what to load, the ladder of
fits, and what disturbs on board."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from agonic.attitude.disturbers.choice import POWER
from agonic.attitude.problem import find_terms
from agonic.calibration.interference import Interference
from agonic.calibration.sources import name_sources
from agonic.health import sort_findings
from agonic.model.gram import BLOCKS
from agonic.recording.calibrated import Calibrated
from agonic.recording.numbers import describe_heading, describe_origin
from agonic.report import tables
from agonic.report.digits import degrees, percent, quantity, with_sd
from agonic.report.fields import make_table
from agonic.report.labels import unit_label
from agonic.report.markup import element
from agonic.report.section import Block, Section, Table, aside
from agonic.report.text import SIGNS, wrap
from agonic.report.verdict import MEANINGS, sentence


def say_overview(
    results: Sequence[Calibrated],
    failures: Sequence[tuple[str, str]],
    files: Mapping[str, Sequence[str]],
    width: int,
) -> Iterator[str]:
    """A sensor's verdict, its heading's error and what makes it, and its gravest objection; then
    which file holds which compasses. Every number, note and check is said with --verbose."""
    yield wrap(describe_origin(results), width=width, indent="")
    for result in results:
        yield from _say_sensor(result, width)
    for name, why in failures:
        yield wrap(f"{name}: refused, {MEANINGS['refused'][1]}", width=width, indent="", label="✗ ")
        yield wrap(sentence(why), width=width)
    yield from _say_files(results, files, width)


def _say_sensor(result: Calibrated, width: int) -> Iterator[str]:
    said = [f"{result.samples.name}: {result.verdict}"]
    if result.verdict != "refused":
        largest = ", ".join(tables.list_shares(result.fit.shares)[:1])
        made = f" ({largest})" if largest else ""
        said.append(f"heading good to {describe_heading(result)[0]}{made}")
    said.append(MEANINGS[result.verdict][1])
    yield wrap(", ".join(said), width=width, indent="", label=f"{SIGNS[result.verdict]} ")
    grave = sort_findings(result.objections)
    if grave:
        more = f" (and {len(grave) - 1} more)" if len(grave) > 1 else ""
        yield wrap(f"{sentence(grave[0].sentence)}{more}", width=width)


def _say_files(
    results: Sequence[Calibrated], files: Mapping[str, Sequence[str]], width: int
) -> Iterator[str]:
    """What to load, where one file is for all compasses."""
    of_all = {Path(file).name for names in files.values() for file in names}
    one = next((name for name in sorted(of_all) if name.startswith("compass.")), None)
    if one is None:
        return
    loaded = [r.samples.name for r in results if r.verdict != "refused"]
    left = [r.samples.name for r in results if r.verdict == "refused"]
    words = f"{one} ({', '.join(loaded)}{'; not ' + ', '.join(left) if left else ''})"
    yield ""
    yield wrap(words, width=width, indent="", label="Load      ")


LEFT = 1.5
"""Held-out residual over noise beyond which something is left for a network."""


def describe_ladder(result: Calibrated) -> Section:
    """The section, which is empty without a ladder."""
    rungs = result.ladder
    if not rungs:
        return Section("", [])
    table = make_table(rungs, taken=lambda one: one.chosen, style="numbers ladder", scrolls=True)
    chosen = (f"✓ {one.name}: {one.why}." for one in rungs if one.chosen)
    blocks: list[Block] = [table, *chosen, _say_of_network(result), aside(OF_LADDER)]
    return Section("Ladder of fits", blocks, printed=True)


def summarise_ladder(result: Calibrated) -> dict[str, str]:
    """The ladder as a line of the text: the heading error that each fit is predicted to have."""
    rungs = [rung for rung in result.ladder if np.isfinite(rung.heading_error_deg)]
    steps = (
        f"{'✓ ' if one.chosen else ''}{one.name} {degrees(one.heading_error_deg)}" for one in rungs
    )
    return {"Ladder": f"heading error: {', '.join(steps)}"} if rungs else {}


def _say_of_network(result: Calibrated) -> str:
    """Whether anything is left for a network; that nothing is, is said on the page alone."""
    fit = result.fit
    gain = float(np.trace(fit.calibration.matrix) / 3)
    ratio = result.verification.residual_rms / max(fit.noise * gain, 1e-12)
    if ratio < LEFT:
        return element(
            "p",
            f"A network would not help: unseen residuals are {ratio:.1f} times the noise of "
            "the readings.",
        )
    return (
        f"Unseen residuals are {ratio:.1f} times the noise: with a known field, "
        "agonic fit network LOG --reference TABLE tells whether a network finds more."
    )


OF_LADDER = (
    "Spread and residual are those of the magnitude in blocks of time that the fit had not seen. "
    "The heading error is that of a level vehicle, rms over all headings, as the chosen fit sees "
    "it, with its standard error; the chosen fit’s own is its standard error of a heading. A "
    "mounting by right angles is not counted."
)
TRIED = ("Sources", "Signals", "Reduction of held-out residual variance")
MOVED = ("Source", "Range", "Moves the field by", "Share of its size")


def describe_disturbers(result: Calibrated) -> Section:
    """The section, which is empty where the log holds nothing that could disturb."""
    if result.disturbers is None or not result.disturbers.trials:
        return Section("", [])
    # what was taken, in its order, and of the rest what the first comparison says
    trials = result.disturbers.trials
    first = {one.sources: one for one in reversed(trials)}
    taken = {one.sources: one for one in trials if one.taken}
    rest = sorted((t for s, t in first.items() if s not in taken), key=lambda one: -one.gain)
    rows = [
        [
            ("✓ " if one.taken else "") + name_sources(one.sources),
            str(len(one.sources)),
            f"{with_sd(100 * one.gain, 100 * one.gain_sd)} %",
        ]
        for one in [*(one for one in trials if one.taken), *rest]
    ]
    blocks: list[Any] = [Table(TRIED, rows, style="numbers")]
    if isinstance(result.fit.calibration, Interference):
        blocks.append(Table(MOVED, _list_moves(result), style="numbers"))
    shapes = [element("p", f"{one.describe()}.") for one in result.disturbers.shapes]
    return Section("What disturbs", [*blocks, *shapes, aside(OF_TRIALS)])


def list_trials(result: Calibrated) -> list[dict[str, Any]]:
    """What was tried, for programs."""
    return [one._asdict() for one in (result.disturbers.trials if result.disturbers else ())]


def _list_moves(result: Calibrated) -> list[list[str]]:
    """Each source, and by how much its usual changes, from 5 to 95 %, move the field."""
    calibration = result.fit.calibration
    assert isinstance(calibration, Interference)
    unit = unit_label(calibration.unit_out)
    slopes, rows = (calibration.matrix @ calibration.coefficients).T, []
    for source in calibration.sources:
        x = find_terms(result.samples, (source,))
        own, slopes = slopes[: x.shape[1]], slopes[x.shape[1] :]
        moved = float(np.linalg.norm(np.diff(np.percentile(x @ own, (5, 95), axis=0), axis=0)))
        ends = f"{x.min():.3g} … {x.max():.3g}"
        share = percent(moved / calibration.magnitude) if calibration.magnitude else tables.NOTHING
        rows.append([source, ends, quantity(moved, unit, 2), share])
    return rows


OF_TRIALS = (
    f"The log was cut into {BLOCKS} blocks of time; the last column is by how much the sources "
    "reduce the residuals of a block, squared, by the fit to the other blocks. The set that "
    "explains most of the residuals, together with drifts and other causes, is used; a second set "
    f"is judged together with the first. A duty has the power {POWER:g}, as a motor’s current, "
    "unless another power, a delay or a filter is clearly more likely."
)
