"""`agonic retrain LOG`: a network trained again on the last readings, from log to log."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from agonic.console.options import Json, KnownField, LogPath, Out, Place, SensorChoice
from agonic.console.parse import parse_names, parse_nodes
from agonic.console.sensors import open_sensor
from agonic.errors import AgonicError

if TYPE_CHECKING:
    from agonic.network.retraining import Retrainer
    from agonic.reference import Reference
    from agonic.samples import Samples

SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86_400.0}


def retrain(
    log: LogPath,
    window: str | None = None,
    every: str | None = None,
    state: Path | None = None,
    ground: Path | None = None,
    out: Out = None,
    reference: KnownField = None,
    hidden: str | None = None,
    inputs: str | None = None,
    target: str | None = None,
    alarm: float | None = None,
    which: SensorChoice = SensorChoice(),
    place: Place = Place(),
    report: Path | None = None,
    as_json: Json = False,
) -> int:
    """Keep a network up to date in orbit or in use: retrained periodically, and after a change.

    A candidate replaces the running network only where it is clearly better on unseen readings.
    Readings that were seen before, or are flagged, are skipped. Exit status 1 where the last
    retraining was rejected because of its readings, a change is not learned yet, or nothing is
    trained.

    Options
    -------
    window SPAN : What a training sees: 90min, 15s, or 3000 readings.
    every SPAN : From one retraining to the next; default: a window.
    state STATE : File to resume from, and to keep the result in.
    ground CAL : Calibration to start from.
    hidden NODES : Nodes of a network where there is none yet, as 3, or 5,3 in two layers; default:
        3.
    inputs NAMES : Its inputs; default: field.
    target : vector, or magnitude; default: vector where the attitude is known.
    alarm : Alarm threshold for a lasting change; 0: off; default: 10.
    report HTML : Page to write about the log.
    """
    from agonic.console.finish import finish
    from agonic.network.commands.fit_network import _known
    from agonic.network.retraining import Retrainer
    from agonic.network.retraining.document import describe_retraining

    given = {
        "window": window,
        "every": every,
        "ground": ground,
        "hidden": hidden,
        "inputs": inputs,
        "target": target,
        "alarm": alarm,
    }
    spans = {name: span(text) for name, text in (("window", window), ("every", every)) if text}
    resumed = None
    if state is not None and state.exists():
        named = [f"--{name}" for name, value in given.items() if value is not None]
        if named:
            raise AgonicError(
                f"{state} holds its settings already; leave out {', '.join(named)}, or name "
                "another state to start anew"
            )
        resumed = Retrainer.resume(state)
    samples = open_sensor(log, *which, preferred=resumed.state.sensor if resumed else "")
    samples, known = _known(samples, log, reference, which.unit, place)
    retrainer = resumed or _start_retrainer(samples, known, given, spans)
    been, seen = retrainer.state, None
    new = samples.seconds_since(been.epoch, known=been.n > 0) > been.time
    if new.any():
        seen = retrainer.update(samples.select(new), known.select(new))
    files = [retrainer.save(state)] if state is not None and seen is not None else []
    document = describe_retraining(retrainer, seen, rows=len(samples), title=log.name)
    page = None if seen is None else report
    return finish(document, out=out, files=files, report=page, as_json=as_json)


def span(text: str) -> tuple[str, float]:
    """Whether a span is in seconds or in readings ("s", "n"), and how long it is."""
    found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(s|min|h|d)?\s*", text)
    if not found or float(found[1]) <= 0 or (found[2] is None and "." in found[1]):
        raise AgonicError(
            f"{text!r} is no span: give a time as 15s, 90min, 2h, 1d, or a "
            "number of readings as 3000"
        )
    if found[2] is None:
        return "n", float(found[1])
    return "s", float(found[1]) * SECONDS[found[2]]


def _start_retrainer(
    samples: Samples, known: Reference, given: dict[str, Any], spans: dict[str, tuple[str, float]]
) -> Retrainer:
    """A retrainer before its first reading, from the options."""
    from typing import cast

    import numpy as np

    from agonic.calibration.retraining import MIN_ROWS, RetrainerParams
    from agonic.files.calibration import load
    from agonic.network.commands.fit_network import _target
    from agonic.network.retraining import Retrainer

    calibration = None if given["ground"] is None else cast(Any, load(given["ground"]))
    settings: dict[str, Any] = {"target": given["target"] or _target(samples, known, calibration)}
    for name, (unit, length) in spans.items():
        settings[f"{name}_{unit}"] = length if unit == "s" else int(length)
    if "window_s" in settings:
        # twice the readings that it holds at the log's usual rate: gaps and bursts have room
        settings["window_n"] = MIN_ROWS
        if samples.time is not None and len(samples) > 1:
            step = float(np.median(np.diff(samples.time)))
            settings["window_n"] = max(int(2 * settings["window_s"] / step) + 1, MIN_ROWS)
    for name, parse in (("inputs", parse_names), ("hidden", parse_nodes), ("alarm", float)):
        if given[name] is not None:
            settings[name] = parse(given[name])
    return Retrainer(calibration, RetrainerParams(**settings))
