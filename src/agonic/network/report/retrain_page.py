"""`retrain_page`: a network kept up to date, and what came of it in a log, as one page."""

from __future__ import annotations

import numpy as np

from agonic.calibration.network import Network
from agonic.calibration.retraining import Retraining
from agonic.network.report import figures, tables
from agonic.network.retraining import Correction, Retrainer
from agonic.report import tables as common
from agonic.report.blocks import header, key_figures, part, verdict
from agonic.report.digits import NO_BREAK, counted, grouped, minused, quantity
from agonic.report.documents import document, static
from agonic.report.markup import Markup, element, markup, table
from agonic.report.strips import captioned
from agonic.report.verdict import moves, sentence

KICKER = "Network kept up to date"
MOST = 200
"""Rows of the table of retrainings."""
_WHY = {
    "period": "a period is over",
    "change": "residual changed",
    "settling": "more was seen of it",
}


def retrain_page(retrainer: Retrainer, seen: Correction, *, title: str = "") -> str:
    """What a retrainer made of a log, as one self-contained HTML page.

    Parameters
    ----------
    retrainer : after the log. seen : what `retrainer.update(samples, …)` gave. title : default: the
        sensor.

    >>> from agonic.calibration.retraining import RetrainerParams
    >>> from agonic.network.simulate import simulate_paper
    >>> made = simulate_paper(20.0)
    >>> retrainer = Retrainer(None, RetrainerParams(window_n=500))
    >>> seen = retrainer.update(made.samples, made.reference)
    >>> retrain_page(retrainer, seen, title="<log>").count("&lt;log&gt;")
    2
    """
    state = retrainer.state
    name = title or state.sensor
    parts = [
        _verdict(retrainer),
        _key_figures(retrainer, seen),
        part("Residual over time", *_residual(seen)),
        part("Retrainings", *_history(seen.retrainings)),
        part("Findings", common.findings(retrainer.findings)),
        part("How it is kept up to date", _settings(retrainer)),
    ]
    running = state.running
    if isinstance(running, Network) and running.target == "magnitude":
        said = element("p", tables.MAGNITUDE_ONLY)
        parts.append(part("What the magnitude cannot teach", said))
    if running is not None:
        parts.append(part("What is running", common.provenance(running, None)))
    body = markup(header(KICKER, name), element("main", *parts))
    return document(f"{KICKER}: {name}", body, style=static("report.css") + static("network.css"))


def _verdict(retrainer: Retrainer) -> Markup:
    first = next(iter(moves(retrainer.findings)), "")
    return verdict(retrainer.verdict, minused(retrainer.status), move=first)


def _key_figures(retrainer: Retrainer, seen: Correction) -> Markup:
    state = retrainer.state
    known = seen.residual[np.isfinite(seen.residual[:, 0])]
    rms = float(np.sqrt(np.mean(known**2))) if known.size else float("nan")
    largest = float(np.abs(known).max()) if known.size else float("nan")
    accepted = sum(one.accepted for one in seen.retrainings)
    of = "of a component" if seen.residual.shape[1] == 3 else "of the magnitude"
    noise = float("nan") if state.noise is None else state.noise
    return key_figures(
        [
            ("Residual", quantity(rms, "nT"), "rms, each reading before it was learned"),
            ("Largest", quantity(largest, "nT"), of),
            ("Accepted", grouped(accepted), f"of {counted(len(seen.retrainings), 'retraining')}"),
            ("Left now", quantity(noise, "nT", 2), "standard deviation on an axis"),
        ]
    )


def _residual(seen: Correction) -> list[Markup]:
    if not np.isfinite(seen.residual[:, 0]).any():
        return [element("p", "Nothing was running yet.")]
    drawn = figures.followed(seen.residual, seen.time, seen.retrainings)
    keys = {"range": "least to largest", "mean": "median"}
    if 'class="middle"' in drawn:
        keys["middle"] = "the middle two thirds"
    for name, words in (
        ("accepted", "retraining accepted"),
        ("rejected", "rejected"),
        ("onset", "a change began"),
    ):
        if f'class="{name}"' in drawn:
            keys[name] = words
    note = "Field as corrected less the known one, by what was running when each reading came."
    return [captioned("Residual", drawn, keys, note)]


def _history(retrainings: tuple[Retraining, ...]) -> list[Markup]:
    if not retrainings:
        return [element("p", "None was due.")]
    head = ["Time", "Why", "Outcome", "Candidate", "Readings", "Unseen before", "after", "Reason"]
    rows = [_row(one) for one in retrainings[-MOST:]]
    left = len(retrainings) - len(rows)
    more = (
        [element("p", f"{counted(left, 'earlier one')} left out.", class_="aside")] if left else []
    )
    return [table(head, rows, class_="history"), *more]


def _row(one: Retraining) -> list[str]:
    outcome = (
        common.mark("good", "accepted") if one.accepted else common.mark("refused", "rejected")
    )
    return [
        f"{grouped(one.time, 1)}{NO_BREAK}s",
        _WHY[one.why],
        outcome,
        one.what or common.NOTHING,
        grouped(one.rows),
        _figure(one.running_rms),
        _figure(one.candidate_rms),
        minused(sentence(_words(one))),
    ]


def _words(one: Retraining) -> str:
    """The reason, without the figures that have columns of their own."""
    return one.reason if one.poisoned else one.reason.split(": ")[0]


def _figure(value: float) -> str:
    return quantity(value, "nT") if np.isfinite(value) else common.NOTHING


def _settings(retrainer: Retrainer) -> Markup:
    params, first = retrainer.params, retrainer.params.window_n
    window = f"{grouped(first)} readings"
    if params.window_s is not None:
        window = f"{params.window_s:g} s, {grouped(first)} readings at most"
    every = "every window"
    if params.every_s is not None:
        every = f"every {params.every_s:g} s"
    elif params.every_n is not None:
        every = f"every {grouped(params.every_n)} readings"
    alarm = f"lasting shifts of about {params.shift_sd:g} standard deviations and more"
    return common.definitions(
        {
            "Window": window,
            "Retrained": every,
            "Taught by": f"the {params.target}",
            "Changes noticed": alarm if params.alarm else "none: the alarm is off",
            "Learned after": f"{grouped(params.fewest)} readings, and again as the window fills",
            "Rejected": f"candidates that err {params.misfit:g} times as much as before, or "
            f"move the "
            f"field by more than {100 * params.furthest:g} %",
        }
    )
