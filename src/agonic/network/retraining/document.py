"""What is said and shown of a network that is kept up to date, and of what came of it in a log."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import nan

import numpy as np

from agonic.calibration.network import Network
from agonic.calibration.retraining import Retraining
from agonic.network.report import figures
from agonic.network.report.document import caution
from agonic.network.retraining.acceptance import describe_outcome
from agonic.network.retraining.retrainer import Correction, Retrainer
from agonic.readable import make_record
from agonic.report.digits import NO_BREAK, count, group_digits, quantity, write_minus
from agonic.report.document import Document, list_sentences
from agonic.report.section import Block, Section, aside, tabulate
from agonic.report.tables import NOTHING, mark
from agonic.report.verdict import sentence

MOST = 200
"""Rows of the table of retrainings."""
_WHY = {
    "period": "a period is over",
    "change": "residual changed",
    "settling": "more was seen of it",
}


def describe_retraining(
    retrainer: Retrainer, seen: Correction | None, *, rows: int = 0, title: str = ""
) -> Document:
    """What a retrainer made of a log: `seen` is what its update gave, None where none was."""
    state, running = retrainer.state, retrainer.state.running
    used, rms, largest, retrainings = 0, nan, nan, tuple[Retraining, ...]()
    if seen is not None:
        used, retrainings = len(seen.time), seen.retrainings
        known = seen.residual[np.isfinite(seen.residual[:, 0])]
        if known.size:
            rms, largest = float(np.sqrt(np.mean(known**2))), float(np.abs(known).max())
    passed = f", {rows - used} passed over" if rows > used else ""
    left = f"{rms:.4g} nT rms, each reading before it was learned; at most {largest:.4g}"
    return Document.judge(
        retrainer,
        schema="agonic/retrain@1",
        kind="Network kept up to date",
        name=state.sensor,
        title=title,
        key_figures=[] if seen is None else _key_figures(retrainer, retrainings, rms, largest),
        entries={
            "Readings": f"{used} new{passed}; {state.n} in all",
            "Residual": left if np.isfinite(rms) else "",
            **{f"{one.time:.10g} s": _describe(one) for one in retrainings},
        },
        entries_title="",
        sections=[
            *([] if seen is None else _sections(retrainer, seen)),
            *([caution(running)] if isinstance(running, Network) else []),
        ],
        values={
            **make_record(state),
            "kind": None if running is None else running.kind,
            "target": retrainer.params.target,
            "new": used,
            "passed_over": rows - used,
            "residual_rms_nT": rms if np.isfinite(rms) else None,
            "residual_max_nT": largest if np.isfinite(largest) else None,
            "retrainings": [make_record(one) for one in retrainings],
            "findings": list_sentences(retrainer.findings),
        },
        calibration=running,
        styles=("network.css",),
    )


def _describe(one: Retraining) -> str:
    """The outcome of a retraining in a line."""
    return f"{'accepted' if one.accepted else 'rejected'}  {one.why:8s}  {one.reason}"


def _key_figures(
    retrainer: Retrainer, done: Sequence[Retraining], rms: float, largest: float
) -> list[tuple[str, str, str]]:
    of = "of the magnitude" if retrainer.params.target == "magnitude" else "of a component"
    noise, accepted = retrainer.state.noise, sum(one.accepted for one in done)
    left = quantity(nan if noise is None else noise, "nT", 2)
    return [
        ("Residual", quantity(rms, "nT"), "rms, each reading before it was learned"),
        ("Largest", quantity(largest, "nT"), of),
        ("Accepted", group_digits(accepted), f"of {count(len(done), 'retraining')}"),
        ("Left now", left, "standard deviation on an axis"),
    ]


def _sections(retrainer: Retrainer, seen: Correction) -> list[Section]:
    residual: Block = "Nothing was running yet."
    if np.isfinite(seen.residual[:, 0]).any():
        drawn = seen.residual, seen.time, seen.retrainings
        residual = partial(figures.draw_residual, *drawn)
    history: list[Block] = ["None was due."]
    if seen.retrainings:
        history = [tabulate(seen.retrainings[-MOST:], _HISTORY, "history")]
        if (left := len(seen.retrainings) - MOST) > 0:
            said = f"{count(left, 'earlier one')} left out."
            history.append(aside(said))
    return [
        Section("Residual over time", [residual]),
        Section("Retrainings", history),
        Section("How it is kept up to date", [_settings(retrainer)]),
    ]


def _write_rms(rms: float) -> str:
    return quantity(rms, "nT") if np.isfinite(rms) else NOTHING


def _give_reason(one: Retraining) -> str:
    """Its reason; where the figures have columns of their own, without them."""
    known = one.what and not one.poisoned
    outcome = describe_outcome(one.accepted, one.running_rms, one.candidate_rms)
    return write_minus(sentence(outcome if known else one.reason))


_HISTORY: dict[str, Callable[[Retraining], str]] = {
    "Time": lambda one: f"{group_digits(one.time, 1)}{NO_BREAK}s",
    "Why": lambda one: _WHY[one.why],
    "Outcome": lambda one: (
        mark("good", "accepted") if one.accepted else mark("refused", "rejected")
    ),
    "Candidate": lambda one: one.what or NOTHING,
    "Readings": lambda one: group_digits(one.rows),
    "Unseen before": lambda one: _write_rms(one.running_rms),
    "after": lambda one: _write_rms(one.candidate_rms),
    "Reason": _give_reason,
}


def _settings(retrainer: Retrainer) -> dict[str, str]:
    params, first = retrainer.params, retrainer.params.window_n
    window = f"{group_digits(first)} readings"
    if params.window_s is not None:
        window = f"{params.window_s:g} s, {group_digits(first)} readings at most"
    every = "every window"
    if params.every_s is not None:
        every = f"every {params.every_s:g} s"
    elif params.every_n is not None:
        every = f"every {group_digits(params.every_n)} readings"
    alarm = f"lasting steps of about {params.shift_sd:g} standard deviations and more"
    return {
        "Window": window,
        "Retrained": every,
        "Reference": f"the {params.target}",
        "Changes noticed": alarm if params.alarm else "none: the alarm is off",
        "Learned after": f"{group_digits(params.fewest)} readings, and again as the window fills",
        "Rejected": f"candidates whose error is {params.misfit:g} times that before, or move the "
        f"field by more than {100 * params.furthest:g} %",
    }
