"""What is said and shown of a network that is kept up to date, and of what came of it in a log."""

from __future__ import annotations

import numpy as np

from agonic.calibration.network import Network
from agonic.calibration.retraining import Retraining
from agonic.network.report import figures
from agonic.network.report.document import caution
from agonic.network.retraining.acceptance import describe_outcome
from agonic.network.retraining.retrainer import Correction, Retrainer
from agonic.readable import make_record
from agonic.report.digits import NO_BREAK, count, group_digits, quantity, write_minus
from agonic.report.document import Document
from agonic.report.markup import Markup, element
from agonic.report.section import Block, Section, Table
from agonic.report.strips import caption, has_enough
from agonic.report.tables import NOTHING, mark
from agonic.report.verdict import sentence

MOST = 200
"""Rows of the table of retrainings."""
_HEAD = ("Time", "Why", "Outcome", "Candidate", "Readings", "Unseen before", "after", "Reason")
_WHY = {
    "period": "a period is over",
    "change": "residual changed",
    "settling": "more was seen of it",
}


def describe_retraining(
    retrainer: Retrainer, seen: Correction | None, *, rows: int = 0, title: str = ""
) -> Document:
    """What a retrainer made of a log.

    Parameters
    ----------
    retrainer : after the log. seen : what `retrainer.update(samples, …)` gave, None where nothing
        was new. rows : of the log. title : of the page; default: the sensor.

    >>> from agonic.calibration.retraining import RetrainerParams
    >>> from agonic.network.simulate import simulate_paper
    >>> made = simulate_paper(20.0)
    >>> retrainer = Retrainer(None, RetrainerParams(window_n=500))
    >>> seen = retrainer.update(made.samples, made.reference)
    >>> describe_retraining(retrainer, seen, title="<log>").to_html().count("&lt;log&gt;")
    2
    """
    state, running = retrainer.state, retrainer.state.running
    used = 0 if seen is None else len(seen.time)
    known = np.empty(0) if seen is None else seen.residual[np.isfinite(seen.residual[:, 0])]
    rms = float(np.sqrt(np.mean(known**2))) if known.size else None
    largest = float(np.abs(known).max()) if known.size else None
    retrainings = () if seen is None else seen.retrainings
    passed = f", {rows - used} passed over" if rows > used else ""
    entries = {"Readings": f"{used} new{passed}; {state.n} in all"}
    if rms is not None:
        entries["Residual"] = (
            f"{rms:.4g} nT rms, each reading before it was learned; at most {largest:.4g}"
        )
    for one in retrainings:
        word = "accepted" if one.accepted else "rejected"
        entries[f"{one.time:.10g} s"] = f"{word}  {one.why:8s}  {one.reason}"
    sections = [] if seen is None else _sections(retrainer, seen)
    return Document(
        schema="agonic/retrain@1",
        kind="Network kept up to date",
        name=state.sensor,
        title=title,
        verdict=retrainer.verdict,
        status=retrainer.status,
        findings=retrainer.findings,
        key_figures=[] if seen is None else _key_figures(retrainer, seen, rms, largest),
        entries=entries,
        entries_title="",
        sections=[*sections, *(caution(running) if isinstance(running, Network) else [])],
        values={
            **make_record(state),
            "kind": None if running is None else running.kind,
            "target": retrainer.params.target,
            "new": used,
            "passed_over": rows - used,
            "residual_rms_nT": rms,
            "residual_max_nT": largest,
            "retrainings": [make_record(one) for one in retrainings],
            "findings": [
                {"name": f.name, "severity": f.severity, "sentence": f.sentence}
                for f in retrainer.findings
            ],
        },
        calibration=running,
        styles=("network.css",),
    )


def _key_figures(
    retrainer: Retrainer, seen: Correction, rms: float | None, largest: float | None
) -> list[tuple[str, str, str]]:
    accepted = sum(one.accepted for one in seen.retrainings)
    of = "of a component" if seen.residual.shape[1] == 3 else "of the magnitude"
    noise = retrainer.state.noise
    return [
        ("Residual", _quantity(rms), "rms, each reading before it was learned"),
        ("Largest", _quantity(largest), of),
        ("Accepted", group_digits(accepted), f"of {count(len(seen.retrainings), 'retraining')}"),
        ("Left now", _quantity(noise, 2), "standard deviation on an axis"),
    ]


def _quantity(value: float | None, digits: int = 3) -> str:
    return quantity(float("nan") if value is None else value, "nT", digits)


def _sections(retrainer: Retrainer, seen: Correction) -> list[Section]:
    residual: Block = "Nothing was running yet."
    if np.isfinite(seen.residual[:, 0]).any():
        residual = lambda: _residual(seen)  # noqa: E731
    history: list[Block] = ["None was due."]
    if seen.retrainings:
        shown = [_row(one) for one in seen.retrainings[-MOST:]]
        history = [Table(_HEAD, shown, "history")]
        left = len(seen.retrainings) - len(shown)
        if left:
            said = f"{count(left, 'earlier one')} left out."
            history.append(element("p", said, class_="aside"))
    return [
        Section("Residual over time", [residual]),
        Section("Retrainings", history),
        Section("How it is kept up to date", [_settings(retrainer)]),
    ]


def _residual(seen: Correction) -> Markup:
    drawn = figures.draw_residual(seen.residual, seen.time, seen.retrainings)
    keys = {"range": "least to largest", "mean": "median"}
    if has_enough(int(np.isfinite(seen.residual).sum())):
        keys["middle"] = "the middle two thirds"
    shown = {
        "accepted": ("retraining accepted", any(one.accepted for one in seen.retrainings)),
        "rejected": ("rejected", any(not one.accepted for one in seen.retrainings)),
        "onset": ("a change began", any(one.onset is not None for one in seen.retrainings)),
    }
    keys |= {name: words for name, (words, there) in shown.items() if there}
    note = "Field as corrected less the known one, by what was running when each reading came."
    return caption("Residual", drawn, keys, note)


def _row(one: Retraining) -> list[str]:
    outcome = mark("good", "accepted") if one.accepted else mark("refused", "rejected")
    reason = one.reason  # its figures have columns of their own
    if one.what and not one.poisoned:
        reason = describe_outcome(one.accepted, one.running_rms, one.candidate_rms)
    return [
        f"{group_digits(one.time, 1)}{NO_BREAK}s",
        _WHY[one.why],
        outcome,
        one.what or NOTHING,
        group_digits(one.rows),
        *(
            quantity(rms, "nT") if np.isfinite(rms) else NOTHING
            for rms in (one.running_rms, one.candidate_rms)
        ),
        write_minus(sentence(reason)),
    ]


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
