"""`agonic track LOG --state STATE`: a calibration that follows its sensor from log to log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from agonic.console.options import Json, LogPath, Place, Scalar, SensorChoice
from agonic.console.sensors import open_sensor
from agonic.errors import AgonicError

if TYPE_CHECKING:
    from agonic.inflight.tracking import Tracker
    from agonic.reference import Reference
    from agonic.samples import Samples

AUTO = "auto"


def track(
    log: LogPath,
    state: Path,
    ground: Path | None = None,
    which: SensorChoice = SensorChoice(),
    place: Place = Place(),
    solve: str | None = None,
    walk: str | None = None,
    noise: float | None = None,
    external: float | None = None,
    scalar: Scalar = None,
    gyro: bool | None = None,
    report: Path | None = None,
    as_json: Json = False,
) -> int:
    """Follow bias and matrix of a magnetometer in flight or in orbit, from log to log.

    Starts where STATE does not exist, from --ground or from nothing, and resumes where it does.
    Readings that were seen before, or are flagged, are skipped. Exit status 1 where the bias
    jumped or is not to be trusted.

    Options
    -------
    state STATE : File to resume from, and to keep the result in.
    ground CAL : Calibration to start from.
    solve : What changes: bias, gains or full; default: full.
    walk : Random walk of the bias, nT per root second; auto: by prediction.
    noise NT : Of one reading on one axis.
    external NT : Field outside the model, sd; default: the model's.
    gyro --gyro/--no-gyro : By how the field turns too; default: where the log's gyro explains it.
    report HTML : Page about the new readings.
    """
    from agonic.atomic import write_atomically
    from agonic.console.output import print_json, say
    from agonic.console.place import find_reference, find_scalar_reference
    from agonic.field.place import describe_missing
    from agonic.inflight.report.document import describe_tracking

    settings = {
        "solve": solve, "walk": walk, "noise": noise, "external_sd": external, "gyro": gyro
    }  # fmt: skip
    resumed = _resume(state, ground, settings) if state.exists() else None
    preferred = "" if resumed is None else resumed.state.base.sensor
    samples = open_sensor(log, *which, preferred=preferred)
    rows = len(samples)
    if samples.flagged is not None:
        if samples.flagged.all():
            raise AgonicError(f"all {rows} readings are flagged; there is nothing to follow")
        samples = samples.select(samples.flagged == 0)
    turning = gyro is not False and samples.rotation_rate is not None
    beside_gyro = turning if resumed is None else resumed.state.turn is not None
    recorded = None if place.field is not None else find_scalar_reference(samples, scalar)
    reference = recorded or find_reference(samples, *place)[0]
    if reference is None and not beside_gyro:
        raise AgonicError(
            f"the field at the readings is not known: {describe_missing(samples)}; give --at "
            "LAT,LON[,ALT], --date or --field NT"
        )
    tracker = resumed or _start_tracker(samples, reference, ground, settings)
    new = tracker.seconds(samples) > tracker.state.time
    found = None
    if new.any():
        known = None if reference is None else reference.select(new)
        found = tracker.update(samples.select(new), known)
        tracker.save(state)
    drawn = samples.select(new) if report is not None and found is not None else None
    document = describe_tracking(tracker, found, drawn, rows=rows, title=log.name)
    files = []
    if report is not None and drawn is not None:
        files.append(str(write_atomically(report, document.to_html())))
    if as_json:
        values = {**document.to_record(), "state": str(state), "files": files}
        print_json(document.schema, values)
    else:
        say("\n".join([document.to_text(), "", f"Written   {', '.join([str(state), *files])}"]))
    return 0 if document.good else 1


def _resume(state: Path, ground: Path | None, settings: dict[str, Any]) -> Tracker:
    """The tracker of a state, unless something else is asked for than it was started with."""
    import numpy as np

    from agonic.files.calibration import load
    from agonic.inflight.tracking import Tracker, start

    tracker = Tracker.resume(state)
    asked = {name: value for name, value in settings.items() if value is not None}
    asked["walk"] = _parse_walk(asked.get("walk", AUTO), tracker.params.walk)
    other = [name for name, value in asked.items() if getattr(tracker.params, name) != value]
    if ground is not None:
        begun, base = start(load(ground), tracker.params).base, tracker.state.base  # type: ignore[arg-type]
        if not (
            np.array_equal(begun.bias, base.bias) and np.array_equal(begun.matrix, base.matrix)
        ):
            other.append("ground")
    if other:
        named = ", ".join(name.removesuffix("_sd") for name in other)
        raise AgonicError(
            f"{state} was started with another {named}; leave that out, or name another state to "
            "start anew"
        )
    return tracker


def _start_tracker(
    samples: Samples, reference: Reference | None, ground: Path | None, settings: dict[str, Any]
) -> Tracker:
    """A tracker before its first reading, from the options."""
    from dataclasses import replace
    from typing import cast

    from agonic.calibration.tracking import TrackerParams
    from agonic.files.calibration import load
    from agonic.inflight.tracking import Tracker, choose_walk

    calibration = None if ground is None else cast(Any, load(ground))
    walk = settings["walk"] or "0"
    chosen = {name: value for name, value in settings.items() if value is not None}
    params = TrackerParams(**{**chosen, "walk": _parse_walk(walk, 0.0)})
    if walk == AUTO:
        if reference is None:
            raise AgonicError("a walk is chosen by the magnitude; give it, or a number for --walk")
        choice = choose_walk(samples, reference, calibration=calibration, params=params)
        params = replace(params, walk=choice.walk)
    return Tracker(calibration, params)


def _parse_walk(walk: str, auto: float) -> float:
    try:
        return auto if walk == AUTO else float(walk)
    except ValueError:
        wanted = "neither a number (nT per root second) nor auto"
        raise AgonicError(f"--walk {walk!r} is {wanted}") from None
