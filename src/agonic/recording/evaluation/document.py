"""What is said and shown of a calibration that was judged on unseen blocks of its log."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from agonic.arrays import Index
from agonic.health import sentences
from agonic.readable import make_record
from agonic.recording.evaluation.cross_validation import Evaluation, Measure
from agonic.recording.evaluation.errors import HEADING
from agonic.report.axes import about_zero, over_rows
from agonic.report.digits import count, group_digits, quantity
from agonic.report.document import Document
from agonic.report.fields import make_table, write_field
from agonic.report.figure import Figure, beyond_words, figure, robust_limit
from agonic.report.marks import band, mean, spread
from agonic.report.section import Section, Table
from agonic.report.verdict import MEANINGS


def describe_evaluation(
    results: Sequence[Evaluation], *, title: str, failures: Iterable[tuple[str, str]] = ()
) -> Document:
    """The document of every magnetometer of a log; `failures` are those that could not be fitted,
    and why."""
    sensors = [_describe_sensor(result) for result in results]
    sensors += [
        Document(
            name=name,
            verdict="refused",
            status=why,
            values={"sensor": name, "verdict": "refused", "status": why, "measures": []},
        )
        for name, why in failures
    ]
    return Document(
        schema="agonic/evaluate@1",
        kind="Calibration judged on unseen parts of its log",
        name=title,
        sensors=sensors,
    )


def _describe_sensor(result: Evaluation) -> Document:
    calibrated = result.calibrated
    said = sentences(*(finding.sentence for finding in result.findings))
    return Document(
        name=result.samples.name,
        method=f"{calibrated.method}, {count(len(result.samples), 'reading')}",
        verdict=result.verdict,
        status=" ".join(filter(None, (said, calibrated.status))),
        findings=(*result.findings, *calibrated.fit.findings),
        refused_numbers=True,
        key_figures=[
            (
                f"{one.kind.capitalize()}, unseen",
                write_field(one, "found"),
                f"stated {write_field(one, 'stated')}",
            )
            for one in result.measures
        ],
        sections=[
            Section(
                "Errors on unseen parts of the log",
                [make_table(result.measures), _explain(result)],
                printed=True,
            ),
            Section(
                "Errors over time", [partial(draw_errors, result, one) for one in result.measures]
            ),
            Section("Block by block", [_list_blocks(result)]),
        ],
        values=_list_values(result),
    )


def _explain(result: Evaluation) -> str:
    """How it was judged, in words."""
    words = (
        "The log was cut into eight blocks of time of equal information. The even ones were "
        "judged by a fit to the odd ones, and the reverse; stated is what these fits say that such "
        "errors should be, from the uncertainty of the calibration and from their own residuals. "
        "The magnitude is judged about its mean."
    )
    if not any(one.kind == HEADING for one in result.measures):
        return words
    return (
        f"{words} The heading was compared with {result.truth}, which the fits did not use, "
        "after one constant turn."
    )


def _list_blocks(result: Evaluation) -> Table:
    """A row a block: when, how many readings, found and stated of each kind, and the verdict."""
    first = result.measures[0]
    head = ["Block", "From", "To", "Readings", f"{first.kind}, found", "stated", "as recorded"]
    rows = []
    time = result.samples.time  # the numbers of the readings where there is none
    for number, at in _split(result):
        ends = (at[0], at[-1])
        found, stated = result.unseen.errors[first.kind].select(at)
        recorded, _ = result.recorded.errors[first.kind].select(at)
        here = replace(first, found=found, stated=stated, recorded=recorded)
        verdict = "refused" if result.unseen.refused[at].any() else "good"
        rows.append(
            [
                f"{number}" + (f" ({MEANINGS[verdict][0]})" if verdict == "refused" else ""),
                *(
                    group_digits(int(k)) if time is None else quantity(time[k], "s", 4)
                    for k in ends
                ),
                group_digits(len(at)),
                *(write_field(here, name) for name in ("found", "stated", "recorded")),
            ]
        )
    return Table(head, rows, scrolls=True)


def _split(result: Evaluation) -> list[tuple[int, Index]]:
    block = result.unseen.block
    return [(int(k) + 1, np.flatnonzero(block == k)) for k in np.unique(block)]


def _list_values(result: Evaluation) -> dict[str, Any]:
    """What the JSON says of one sensor."""
    calibrated, time = result.calibrated, result.samples.time
    return {
        "sensor": result.samples.name,
        "verdict": result.verdict,
        "method": calibrated.method,
        "n": len(result.samples),
        "truth": result.truth or None,
        "measures": [make_record(one) for one in result.measures],
        "blocks": [
            {
                "from_s": None if time is None else float(time[at[0]]),
                "to_s": None if time is None else float(time[at[-1]]),
                "n": len(at),
                "refused": bool(result.unseen.refused[at].any()),
                **{
                    one.kind: dict(
                        zip(
                            ("found", "stated"),
                            result.unseen.errors[one.kind].select(at),
                            strict=True,
                        )
                    )
                    for one in result.measures
                },
            }
            for _, at in _split(result)
        ],
    }


def draw_errors(result: Evaluation, one: Measure) -> Figure:
    """One kind of error over time: as recorded, by fits that had not seen it, and as stated."""
    found, stated = result.unseen.errors[one.kind]
    recorded = result.recorded.errors[one.kind].found
    least = min(3.0 * one.stated, 2.0 * float(np.abs(found).max())) or 1e-9
    limit = robust_limit(found, least)
    columns = over_rows(result.samples.time, len(found))
    ends = columns.least(recorded), columns.largest(recorded)
    return figure(
        f"Error of the {one.kind} on unseen readings over time",
        columns.x,
        about_zero(f"error of the {one.kind}, {one.unit}", limit),
        band(columns, *ends, "before", "as recorded"),
        spread(columns, found, "after", "by fits that had not seen the reading"),
        mean(columns, -stated, "noise", "± the standard error that they state"),
        mean(columns, stated, "noise", ""),
        note=beyond_words(found, limit, one.unit),
    )
