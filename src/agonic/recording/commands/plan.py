"""`agonic plan calibration|disturbers`: what to record, and what that will tell."""

from __future__ import annotations

from pathlib import Path

from agonic.console.options import Between, Json, SensorChoice


def disturbers(
    log: Path | None = None,
    motors: int = 4,
    also: str = "",
    noise: float = 300.0,
    which: SensorChoice = SensorChoice(),
    between: Between = None,
    as_json: Json = False,
) -> int:
    """What to switch while recording; for a LOG, how well each is known and what to add.

    Options
    -------
    log <[LOG]> : A recording to judge.
    motors ≥0 ≤12 : Of the vehicle.
    also --with NAMES : What else is switched on board.
    noise NT : Of one reading on an axis.
    """
    from agonic.console.finish import finish
    from agonic.console.parse import parse_names
    from agonic.recording.plan_documents import describe_judged, describe_steps

    if log is None:
        finish(describe_steps(motors, parse_names(also)), as_json=as_json)
        return 0
    from agonic.attitude.disturbers.choice import judge_disturbers
    from agonic.console.sensors import open_sensors

    samples = open_sensors(log, *which, between)[1][0]  # the same stands beside each sensor
    judged = judge_disturbers(samples, noise=noise)
    finish(describe_judged(samples.name, judged), as_json=as_json)
    return 0


def calibration(
    wanted: float | None = None,
    tilt: float = 180.0,
    attitude_sd: float | None = None,
    noise: float = 300.0,
    field: float = 48_000.0,
    dip: float = 65.0,
    out: Path | None = None,
    as_json: Json = False,
) -> int:
    """Three sets of readings about three axes: the errors to expect for each step of rotation.

    Options
    -------
    wanted DEG : Standard error of the heading wanted.
    tilt DEG : How far it can be tilted; from 90 turned over.
    attitude_sd DEG : Roll and pitch are logged this well.
    noise NT : Of one reading on an axis.
    field NT : Magnitude to expect.
    dip DEG : Inclination to expect.
    out -o FILE : The positions, .csv; a page, .html.
    """
    from agonic.console.finish import finish
    from agonic.ellipsoid.plan import plan_calibration
    from agonic.recording.plan_documents import choose_sets, describe_plan

    sets = plan_calibration(
        magnitude=field,
        inclination_deg=dip,
        noise=noise,
        tilt_deg=tilt,
        attitude_sd_deg=attitude_sd,
        wanted_deg=wanted,
    )
    chosen = choose_sets(sets, wanted)
    made = describe_plan(sets, wanted_deg=wanted)
    if chosen is None:
        finish(made, as_json=as_json)
        return 1
    forms = {".csv": lambda: _list_positions(chosen.attitudes_deg)}
    return finish(made, report=out, option="-o", forms=forms, as_json=as_json)


def _list_positions(attitudes_deg: object) -> str:
    """The positions in their order, a row each, as text."""
    import numpy as np

    rows = np.asarray(attitudes_deg).tolist()
    lines = [f"{k},{r:g},{p:g},{h:g}" for k, (r, p, h) in enumerate(rows, start=1)]
    return "\n".join(["position,roll_deg,pitch_deg,heading_deg", *lines]) + "\n"
