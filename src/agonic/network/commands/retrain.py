"""`agonic retrain LOG`: a network trained again on the last readings, from log to log."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.console.options import At, Date, Json, LogPath, Magnitude, Sensor, Unit
from agonic.console.parse import parse_names
from agonic.console.sensors import open_sensor
from agonic.errors import AgonicError

if TYPE_CHECKING:
    from agonic.calibration.retraining import Retraining
    from agonic.network.retraining import Correction, Retrainer
    from agonic.reference import Reference
    from agonic.samples import Samples

SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86_400.0}


def add_to(app: typer.Typer) -> None:
    """Register the command."""
    app.command("retrain")(retrain)


def retrain(
    log: LogPath,
    window: Annotated[
        str | None,
        typer.Option(metavar="SPAN", help="What a training sees: 90min, 15s, or 3000 readings."),
    ] = None,
    every: Annotated[
        str | None,
        typer.Option(metavar="SPAN", help="From one retraining to the next; default: a window."),
    ] = None,
    state: Annotated[
        Path | None,
        typer.Option(metavar="STATE", help="File to resume from, and to keep the result in."),
    ] = None,
    ground: Annotated[
        Path | None, typer.Option(metavar="CAL", help="Calibration to start from.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="CAL", help="Calibration file to write.")
    ] = None,
    reference: Annotated[
        Path | None,
        typer.Option(
            metavar="TABLE",
            help="The known field in the sensor's axes, as a log, matched by time. Default: the "
            "world model (--at, --date, the track).",
        ),
    ] = None,
    hidden: Annotated[
        int | None, typer.Option(help="Nodes of a network where there is none yet; default: 3.")
    ] = None,
    inputs: Annotated[
        str | None, typer.Option(metavar="NAMES", help="Its inputs; default: field.")
    ] = None,
    target: Annotated[
        str | None,
        typer.Option(help="vector, or magnitude; default: vector where the attitude is known."),
    ] = None,
    alarm: Annotated[
        float | None, typer.Option(help="How much of a shift has to add up; 0: never; default: 10.")
    ] = None,
    sensor: Sensor = None,
    unit: Unit = None,
    at: At = None,
    date: Date = None,
    field: Magnitude = None,
    report: Annotated[
        Path | None, typer.Option("--report", metavar="HTML", help="Page to write about the log.")
    ] = None,
    as_json: Json = False,
) -> int:
    """Keep a network up to date in orbit or in use: retrained periodically, and after a change.

    A candidate replaces what runs only where it is clearly better on readings it has not seen.
    Readings that were seen before, or are flagged, are passed over. Exit status 1 where the last
    retraining was rejected because of its readings, a change is not learned yet, or nothing runs.
    """
    from agonic.console.output import print_json, say
    from agonic.files.calibration import save
    from agonic.network.commands.fit_network import _known
    from agonic.network.retraining import Retrainer

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
    if state is not None and state.exists():
        _require_nothing(given, state)
        retrainer = Retrainer.resume(state)
        samples = open_sensor(log, sensor, unit, preferred=retrainer.state.sensor)
        samples, known = _known(samples, reference, unit, (at, date, field))
    else:
        samples = open_sensor(log, sensor, unit)
        samples, known = _known(samples, reference, unit, (at, date, field))
        retrainer = _started(samples, known, given, spans)
    new, seen = _new(retrainer, samples), None
    if new.any():
        seen = retrainer.update(samples.select(new), known.select(new))
    files = [str(retrainer.save(state))] if state is not None and seen is not None else []
    if out is not None and retrainer.state.running is not None:
        files.append(str(save(retrainer.calibration, out)))
    if report is not None and seen is not None:
        files.append(_page(report, retrainer, seen, log.name))
    said = record(retrainer, seen, len(samples))
    if as_json:
        print_json("agonic/retrain@1", {**said, "files": files})
    else:
        say("\n".join([*sentences(said), *(f"Written   {file}" for file in files)]))
    return 0 if retrainer.ok else 1


def span(text: str) -> tuple[str, float]:
    """Whether a span is in seconds or in readings ("s", "n"), and how long it is.

    >>> span("15s"), span("1.5 h"), span("3000")
    (('s', 15.0), ('s', 5400.0), ('n', 3000.0))
    """
    found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(s|min|h|d)?\s*", text)
    if not found or float(found[1]) <= 0 or (found[2] is None and "." in found[1]):
        raise AgonicError(
            f"{text!r} is no span: give a time as 15s, 90min, 2h, 1d, or a "
            "number of readings as 3000"
        )
    if found[2] is None:
        return "n", float(found[1])
    return "s", float(found[1]) * SECONDS[found[2]]


def _require_nothing(given: dict[str, Any], state: Path) -> None:
    named = [f"--{name}" for name, value in given.items() if value is not None]
    if named:
        raise AgonicError(
            f"{state} holds its settings already; leave out {', '.join(named)}, or name another "
            "state to start anew"
        )


def _started(
    samples: Samples, known: Reference, given: dict[str, Any], spans: dict[str, tuple[str, float]]
) -> Retrainer:
    """A retrainer before its first reading, from the options."""
    from typing import cast

    from agonic.calibration.retraining import RetrainerParams
    from agonic.files.calibration import load
    from agonic.network.commands.fit_network import _target
    from agonic.network.retraining import Retrainer

    settings: dict[str, Any] = {"target": given["target"] or _target(samples, known)}
    for name, (unit, length) in spans.items():
        settings[f"{name}_{unit}"] = length if unit == "s" else int(length)
    if "window_s" in settings:
        settings["window_n"] = _rows_in(samples, settings["window_s"])
    if given["inputs"] is not None:
        settings["inputs"] = parse_names(given["inputs"])
    for name in ("hidden", "alarm"):
        if given[name] is not None:
            settings[name] = given[name]
    calibration = None if given["ground"] is None else cast(Any, load(given["ground"]))
    return Retrainer(calibration, RetrainerParams(**settings))


def _rows_in(samples: Samples, seconds: float) -> int:
    """Twice the readings that a span holds at the log's usual rate: gaps and bursts have room."""
    import numpy as np

    from agonic.calibration.retraining import LEAST

    if samples.time is None or len(samples) < 2:
        return LEAST
    step = float(np.median(np.diff(samples.time)))
    return max(int(2 * seconds / step) + 1, LEAST)


def _new(retrainer: Retrainer, samples: Samples) -> Any:
    """The rows that are later than all that was seen."""
    state = retrainer.state
    return samples.seconds_since(state.epoch, known=state.n > 0) > state.time


def _page(path: Path, retrainer: Retrainer, seen: Correction, title: str) -> str:
    from agonic.atomic import write_atomically
    from agonic.network.report.retrain_page import retrain_page

    return str(write_atomically(path, retrain_page(retrainer, seen, title=title)))


def record(retrainer: Retrainer, seen: Correction | None, rows: int) -> dict[str, Any]:
    """What there is to say of a retrainer after a log."""
    import numpy as np

    state = retrainer.state
    used = 0 if seen is None else len(seen.time)
    residual = np.empty(0) if seen is None else seen.residual[np.isfinite(seen.residual[:, 0])]
    return {
        "sensor": state.sensor,
        "verdict": retrainer.verdict,
        "status": retrainer.status,
        "kind": None if state.running is None else state.running.kind,
        "target": retrainer.params.target,
        "new": used,
        "passed_over": rows - used,
        "n": state.n,
        "accepted": state.accepted,
        "rejected": state.rejected,
        "noise_nT": state.noise,
        "residual_rms_nT": float(np.sqrt(np.mean(residual**2))) if residual.size else None,
        "residual_max_nT": float(np.abs(residual).max()) if residual.size else None,
        "retrainings": [_of(one) for one in (() if seen is None else seen.retrainings)],
        "findings": [
            {"name": f.name, "severity": f.severity, "sentence": f.sentence}
            for f in retrainer.findings
        ],
    }


def _of(one: Retraining) -> dict[str, Any]:
    return {
        "time_s": one.time,
        "n": one.n,
        "why": one.why,
        "accepted": one.accepted,
        "reason": one.reason,
        "poisoned": one.poisoned,
        "candidate": one.what,
        "rows": one.rows,
        "running_rms_nT": one.running_rms,
        "candidate_rms_nT": one.candidate_rms,
        "onset_s": one.onset,
        "epochs": one.epochs,
    }


def sentences(said: dict[str, Any]) -> list[str]:
    """The record for people, a line for each retraining."""
    from agonic.report.text import SIGNS

    passed = f", {said['passed_over']} passed over" if said["passed_over"] else ""
    lines = [
        f"{SIGNS[said['verdict']]} {said['sensor']}: {said['verdict']}",
        f"  {said['status']}",
        f"Readings  {said['new']} new{passed}; {said['n']} in all",
    ]
    if said["residual_rms_nT"] is not None:
        lines.append(
            f"Residual  {said['residual_rms_nT']:.4g} nT rms, each reading before it was learned; "
            f"at most {said['residual_max_nT']:.4g}"
        )
    for one in said["retrainings"]:
        word = "accepted" if one["accepted"] else "rejected"
        lines.append(f"{one['time_s']:10.1f} s  {word}  {one['why']:8s}  {one['reason']}")
    return lines
