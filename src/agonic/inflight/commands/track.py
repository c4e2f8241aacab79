"""`agonic track LOG --state STATE`: a calibration that follows its sensor from log to log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.console.options import At, Date, Json, LogPath, Magnitude, Sensor, Unit, log_and_sensors
from agonic.errors import AgonicError

if TYPE_CHECKING:
    from agonic.inflight.tracking import Coefficients, Tracker
    from agonic.reference import Reference
    from agonic.samples import Samples

AUTO = "auto"


def add_to(app: typer.Typer) -> None:
    """Register the command."""
    app.command("track")(track)


def track(
    log: LogPath,
    state: Annotated[
        Path, typer.Option(metavar="STATE", help="File to resume from, and to keep the result in.")
    ],
    ground: Annotated[
        Path | None, typer.Option(metavar="CAL", help="Calibration to start from.")
    ] = None,
    sensor: Sensor = None,
    unit: Unit = None,
    at: At = None,
    date: Date = None,
    field: Magnitude = None,
    solve: Annotated[
        str | None, typer.Option(help="What moves: bias, gains or full; default: full.")
    ] = None,
    walk: Annotated[
        str | None,
        typer.Option(help="Random walk of the bias, nT per root second; auto: by prediction."),
    ] = None,
    noise: Annotated[float | None, typer.Option(help="Noise of one reading on one axis.")] = None,
    external: Annotated[
        float | None,
        typer.Option(help="What the model leaves out, nT; default: as the model states."),
    ] = None,
    scalar: Annotated[
        bool | None,
        typer.Option(
            "--scalar/--no-scalar",
            help="Against the scalar instrument, or the world model; default: as the log has it.",
        ),
    ] = None,
    report: Annotated[
        Path | None, typer.Option("--report", metavar="HTML", help="Page about what is new.")
    ] = None,
    as_json: Json = False,
) -> int:
    """Follow bias and matrix of a magnetometer in flight or in orbit, from log to log.

    Starts where STATE does not exist, from --ground or from nothing, and resumes where it does.
    Readings that were seen before, or are flagged, are passed over. Exit status 1 where the bias
    jumped or is not to be trusted.
    """
    from agonic.console.output import print_json, say
    from agonic.inflight.tracking import Tracker

    settings = {"solve": solve, "walk": walk, "noise": noise, "external_sd": external}
    if state.exists():
        tracker = Tracker.resume(state)
        other = _others(tracker, ground, settings)
        if other:
            raise AgonicError(
                f"{state} was started with another {', '.join(other)}; leave that out, or name "
                "another state to start anew"
            )
        rows, samples = _usable(_sensor(log, sensor, unit, tracker.state.base.sensor))
        reference = _reference(samples, at, date, field, scalar)
    else:
        rows, samples = _usable(_sensor(log, sensor, unit))
        reference = _reference(samples, at, date, field, scalar)
        tracker = _started(samples, reference, ground, settings)
    new = tracker.seconds(samples) > tracker.state.time
    found = None
    if new.any():
        found = tracker.update(samples.select(new), reference.select(new))
        tracker.save(state)
    files = []
    if report is not None and found is not None:
        files.append(_page(report, tracker, found, samples.select(new), log.name))
    said = summary(tracker, found, rows)
    if as_json:
        print_json("agonic/track@1", {**said, "state": str(state), "files": files})
    else:
        written = [f"Report    {file}" for file in files]
        say("\n".join([*sentences(said), f"State     {state}", *written]))
    return 0 if tracker.ok else 1


def _others(tracker: Tracker, ground: Path | None, settings: dict[str, Any]) -> list[str]:
    """What is asked for and is not what the tracker was started with."""
    import numpy as np

    from agonic.files.calibration import load
    from agonic.inflight.tracking import start

    asked = {name: value for name, value in settings.items() if value is not None}
    walk = asked.pop("walk", AUTO)
    if walk != AUTO:
        asked["walk"] = _number(walk)
    other = [name for name, value in asked.items() if getattr(tracker.params, name) != value]
    if ground is not None:
        begun, base = start(load(ground), tracker.params).base, tracker.state.base  # type: ignore[arg-type]
        if not (
            np.array_equal(begun.bias, base.bias) and np.array_equal(begun.matrix, base.matrix)
        ):
            other.append("ground")
    return [name.removesuffix("_sd") for name in other]


def _sensor(log: Path, sensor: str | None, unit: str | None, followed: str = "") -> Samples:
    """The sensor of the log that was asked for, or the one that is followed, or its only one."""
    recording, sensors = log_and_sensors(log, sensor, unit)
    names = [samples.name for samples in sensors]
    if len(names) > 1 and followed in names:
        return recording.sensor(followed)
    if len(names) > 1:
        raise AgonicError(f"the log holds {', '.join(names)}; choose one with --sensor")
    return sensors[0]


def _usable(samples: Samples) -> tuple[int, Samples]:
    """How many rows there are, and those that are not flagged."""
    rows = len(samples)
    if samples.flagged is not None:
        if samples.flagged.all():
            raise AgonicError(f"all {rows} readings are flagged; there is nothing to follow")
        samples = samples.select(samples.flagged == 0)
    return rows, samples


def _reference(
    samples: Samples, at: str | None, date: str | None, field: float | None, scalar: bool | None
) -> Reference:
    """The magnitude of the field at each reading."""
    from agonic.console.place import expected, scalar_reference
    from agonic.field.place import describe_missing

    taught = None if field is not None else scalar_reference(samples, scalar)
    if taught is not None:
        return taught
    reference, _ = expected(samples, at, date, field)
    if reference is None:
        raise AgonicError(
            f"the field at the readings is not known: {describe_missing(samples)}; give --at "
            "LAT,LON[,ALT], --date or --field NT"
        )
    return reference


def _started(
    samples: Samples, reference: Reference, ground: Path | None, settings: dict[str, Any]
) -> Tracker:
    """A tracker before its first reading, from the options."""
    from dataclasses import replace
    from typing import cast

    from agonic.calibration.tracking import TrackerParams
    from agonic.files.calibration import load
    from agonic.inflight.tracking import Tracker, choose_walk

    calibration = None if ground is None else cast(Any, load(ground))
    walk = settings["walk"] or "0"
    if settings["external_sd"] is None:
        settings["external_sd"] = reference.sd
    chosen = {name: value for name, value in settings.items() if value is not None}
    params = TrackerParams(**{**chosen, "walk": _number(walk)})
    if walk == AUTO:
        choice = choose_walk(samples, reference, calibration=calibration, params=params)
        params = replace(params, walk=choice.walk)
    return Tracker(calibration, params)


def _page(path: Path, tracker: Tracker, found: Coefficients, new: Samples, title: str) -> str:
    """The report about the readings of the log that are new."""
    from agonic.atomic import write_atomically
    from agonic.inflight.report.page import track_page

    return str(write_atomically(path, track_page(tracker, found, new, title=title)))


def _number(walk: str) -> float:
    if walk == AUTO:
        return 0.0
    try:
        return float(walk)
    except ValueError:
        raise AgonicError(
            f"--walk {walk!r} is neither a number (nT per root second) nor auto"
        ) from None


def summary(tracker: Tracker, found: Coefficients | None, rows: int) -> dict[str, Any]:
    """What there is to say of a tracker after an update."""
    import numpy as np

    state, calibration = tracker.state, tracker.calibration
    rms = None
    if found is not None:  # without those of which a start could not yet say anything
        rms = float(np.sqrt(np.mean(found.residual[found.foretold] ** 2)))
    return {
        "sensor": state.base.sensor,
        "unit": state.base.unit_in,
        "verdict": "good" if tracker.ok else "check",
        "status": tracker.status,
        "new": 0 if found is None else len(found.residual),
        "passed_over": rows - (0 if found is None else len(found.residual)),
        "n": state.n,
        "refused": state.refused,
        "bias": state.bias,
        "bias_sd": state.bias_sd,
        "matrix": calibration.matrix,
        "noise": state.noise,
        "walk": tracker.params.walk,
        "predicted_rms_nT": rms,
        "consistency": state.consistency,
        "jumps": [
            {"time_s": j.time, "seen_s": j.seen, "shift": j.shift, "shift_sd": j.shift_sd}
            for j in state.jumps
        ],
        "history": {
            "time_s": tracker.history[:, 0],
            "bias": tracker.history[:, 1:4],
            "bias_sd": tracker.history[:, 4:],
        },
    }


def sentences(said: dict[str, Any]) -> list[str]:
    """The summary for people."""
    mark = "✓" if said["verdict"] == "good" else "!"
    unit = said["unit"]
    passed = f", {said['passed_over']} passed over" if said["passed_over"] else ""
    values = zip("xyz", said["bias"], said["bias_sd"], strict=True)
    bias = ", ".join(f"{axis} {value:.1f} ± {sd:.1f}" for axis, value, sd in values)
    lines = [
        f"{mark} {said['sensor']}: {said['verdict']}",
        f"  {said['status']}",
        f"Readings  {said['new']} new{passed}; {said['n']} in all, {said['refused']} refused",
        f"Bias      {bias} {unit} (one standard error)",
        f"Model     noise {said['noise']:.4g} {unit}, walk {said['walk']:.3g} {unit} per √s",
    ]
    if said["predicted_rms_nT"] is not None:
        lines.append(
            f"Predicted to {said['predicted_rms_nT']:.4g} nT rms, each reading before it was used"
        )
    for jump in said["jumps"]:
        shift = ", ".join(f"{value:.0f}" for value in jump["shift"])
        lines.append(
            f"Jump      at {jump['time_s']:.1f} s by {shift} {unit}, seen at {jump['seen_s']:.1f} s"
        )
    return lines
