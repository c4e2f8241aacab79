"""`agonic simulate KIND -o FILE`: readings with known truth."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.alignment.commands import simulate_alignment, simulate_north
from agonic.cli import simulate_vehicle
from agonic.console.options import Json
from agonic.errors import AgonicError
from agonic.fleet.commands import simulate_fleet
from agonic.inflight.commands import simulate_orbit
from agonic.network.commands import simulate_network
from agonic.thermal.commands import simulate as simulate_campaign
from agonic.thermal.commands.simulate import FAULTS

if TYPE_CHECKING:
    from agonic.calibration.affine import Affine
    from agonic.simulation import Defect


def add_to(app: typer.Typer) -> None:
    """Register the command."""
    app.command("simulate")(simulate)


def simulate(
    context: typer.Context,
    kind: Annotated[
        str,
        typer.Argument(
            help="tumble, sphere, belt, hand, circle, flight, boat, car, static, vehicle, orbit, "
            "paper, paper-space, nonaffine; "
            "campaign, fleet, alignment, north or coil."
        ),
    ],
    out: Annotated[
        Path,
        typer.Option("-o", "--out", metavar="FILE", help="CSV file; else the folder."),
    ],
    n: Annotated[
        int, typer.Option("-n", help="Readings; default of an orbit: 86400, a day.", min=1)
    ] = 3000,
    noise: Annotated[
        float, typer.Option(help="Noise per axis, nT; default of an orbit: 100.", min=0)
    ] = 200.0,
    field: Annotated[
        float | None,
        typer.Option(help="Magnitude of the field, nT; default: 50000, a vehicle's by its place."),
    ] = None,
    outliers: Annotated[float, typer.Option(help="Share of gross outliers.", min=0, max=1)] = 0.0,
    step: Annotated[float, typer.Option(help="Quantisation, nT; 0 for none.", min=0)] = 0.0,
    clip: Annotated[float, typer.Option(help="Full scale, nT; 0 for none.", min=0)] = 0.0,
    tilt: Annotated[
        float | None, typer.Option(help="Largest tilt of belt and circle, degrees.")
    ] = None,
    bank: Annotated[
        float | None, typer.Option(help="Steepest bank of a vehicle's turns, degrees.")
    ] = None,
    latency: Annotated[
        float | None, typer.Option(metavar="MS", help="How late a vehicle's readings are, ms.")
    ] = None,
    opposite: Annotated[
        bool, typer.Option("--opposite", help="A vehicle's second sensor is disturbed oppositely.")
    ] = False,
    truth: Annotated[
        list[Path] | None,
        typer.Option(
            "--truth",
            metavar="CAL",
            help="Whose readings; default: drawn by the seed. Twice: a vehicle's two sensors.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of everything random.")] = 0,
    sensors: Annotated[
        str,
        typer.Option(
            metavar="LIST", help="Of a campaign: 2xMMC5883MA,3xMPU-9255; of a fleet: how many."
        ),
    ] = "2xMMC5883MA,3xMPU-9255",
    rate: Annotated[
        float,
        typer.Option(metavar="HZ", help="Of a campaign or an orbit: readings a second.", min=0.001),
    ] = 1.0,
    fault: Annotated[
        list[str] | None, typer.Option(metavar="FAULT", help=f"Of a campaign: {FAULTS}.")
    ] = None,
    format: Annotated[str, typer.Option(help="Of a campaign or fleet: csv or parquet.")] = "csv",
    logs: Annotated[
        int | None, typer.Option(help="Of a fleet: logs of each sensor; default 1.", min=1)
    ] = None,
    rows: Annotated[
        int | None, typer.Option(help="Of a fleet: readings of a log; default 300.", min=20)
    ] = None,
    broken: Annotated[
        float | None, typer.Option(metavar="SHARE", help="Of a fleet: broken sensors.")
    ] = None,
    swapped: Annotated[
        float | None, typer.Option(metavar="SHARE", help="Of a fleet: sensors with misnamed axes.")
    ] = None,
    duplicated: Annotated[
        float | None, typer.Option(metavar="SHARE", help="Of a fleet: logs that are there twice.")
    ] = None,
    damaged: Annotated[
        float | None, typer.Option(metavar="SHARE", help="Of a fleet: damaged files.")
    ] = None,
    drift: Annotated[
        float | None, typer.Option(metavar="NT", help="Of an orbit: drift of the bias, nT.")
    ] = None,
    moved: Annotated[
        float | None, typer.Option(metavar="NT", help="Of an orbit: bias moved since the ground.")
    ] = None,
    jump: Annotated[
        float | None, typer.Option(metavar="NT", help="Of an orbit: step of the bias half-way.")
    ] = None,
    external: Annotated[
        float | None, typer.Option(metavar="NT", help="Of an orbit: sd of the ring current.")
    ] = None,
    torquer: Annotated[
        float | None, typer.Option(metavar="NT", help="Of an orbit: field of the torquers.")
    ] = None,
    scalar: Annotated[
        float | None, typer.Option(metavar="SD", help="Of an orbit: a scalar sensor's noise, nT.")
    ] = None,
    pointing: Annotated[str | None, typer.Option(help="Of an orbit: nadir or tumble.")] = None,
    orientations: Annotated[
        int | None, typer.Option(help="Of an alignment: how many; -n is readings in each.", min=1)
    ] = None,
    as_json: Json = False,
) -> int:
    """Write readings of a simulated sensor or vehicle, and beside them what would undo it."""
    _check_kind(kind)
    if kind == "alignment":
        stated = {
            "orientations": orientations,
            "readings": n if _stated(context, "n") else None,
            "noise": noise if _stated(context, "noise") else None,
        }
        settings = {name: value for name, value in stated.items() if value is not None}
        return simulate_alignment.alignment(out, as_json=as_json, seed=seed, **settings)
    _refuse(kind, {"--orientations": orientations})
    of_fleet: dict[str, Any] = {
        "logs": logs,
        "rows": rows,
        "broken": broken,
        "swapped": swapped,
        "duplicated": duplicated,
        "damaged": damaged,
    }
    if kind == "fleet":
        _refuse(
            kind,
            {
                "--outliers": outliers or None,
                "--step": step or None,
                "--clip": clip or None,
                "--tilt": tilt,
                "--bank": bank,
                "--latency": latency,
                "--truth": truth,
                "--opposite": opposite or None,
                "--fault": fault,
            },
        )
        of_fleet |= {"noise": noise if _stated(context, "noise") else None, "magnitude": field}
        asked = {name: value for name, value in of_fleet.items() if value is not None}
        many = sensors if _stated(context, "sensors") else "1000"
        return simulate_fleet.fleet(
            out, sensors=many, format=format, seed=seed, as_json=as_json, **asked
        )
    _refuse(kind, {f"--{name}": value for name, value in of_fleet.items()})
    if kind in simulate_north.KINDS:
        own_noise = noise if _stated(context, "noise") else None
        return simulate_north.session(kind, out, as_json=as_json, seed=seed, noise=own_noise)
    if kind == "campaign":
        own_noise = noise if _stated(context, "noise") else None
        return simulate_campaign.simulate_chamber(
            out,
            sensors=sensors,
            rate=rate,
            noise=own_noise,
            field=field or 48_000.0,
            fault=fault or [],
            format=format,
            seed=seed,
            as_json=as_json,
        )
    if kind in simulate_network.KINDS:
        own_noise = noise if _stated(context, "noise") else None
        return simulate_network.network(kind, out, as_json, n=n, noise=own_noise, seed=seed)
    aloft = {
        "drift": drift,
        "moved": moved,
        "jump": jump,
        "external": external,
        "torquer": torquer,
        "scalar_sd": scalar,
        "pointing": pointing,
    }
    if kind == "orbit":
        _refuse(
            kind,
            {
                "--field": field,
                "--tilt": tilt,
                "--truth": truth,
                "--bank": bank,
                "--latency": latency,
                "--opposite": opposite or None,
                "--outliers": outliers or None,
                "--clip": clip or None,
            },
        )
        aloft |= {
            "n": n if _stated(context, "n") else None,
            "rate_Hz": rate if _stated(context, "rate") else None,
            "noise": noise if _stated(context, "noise") else None,
        }
        given = {name: value for name, value in aloft.items() if value is not None}
        return simulate_orbit.orbit(out, as_json, seed=seed, step=step, **given)
    _refuse(kind, {f"--{name.removesuffix('_sd')}": value for name, value in aloft.items()})
    others = {"--field": field, "--tilt": tilt}
    flown = {"--bank": bank, "--latency": latency, "--opposite": opposite or None}
    misfits = others if kind == "vehicle" else flown
    _refuse(kind, misfits)
    defects = _defects(outliers, step, clip, seed)
    if kind == "vehicle":
        whose = [_truth(path) for path in truth or ()]
        return simulate_vehicle.vehicle(
            out,
            defects,
            whose,
            as_json,
            n=n,
            noise=noise,
            seed=seed,
            placing="opposite" if opposite else "apart",
            **({} if bank is None else {"bank_deg": bank}),
            **({} if latency is None else {"latency_s": latency / 1000}),
        )
    if truth is not None and len(truth) > 1:
        raise AgonicError(f"the kind {kind!r} has one sensor; give --truth once")
    return _sensor(
        kind,
        out,
        truth[0] if truth else None,
        as_json,
        n=n,
        noise=noise,
        seed=seed,
        defects=defects,
        **({} if field is None else {"magnitude": field}),
        **({} if tilt is None else {"tilt_deg": tilt}),
    )


def _refuse(kind: str, misfits: Mapping[str, Any]) -> None:
    """Raise where an option was given that this kind does not have."""
    if given := [name for name, value in misfits.items() if value is not None]:
        raise AgonicError(f"{', '.join(given)}: not an option of the kind {kind!r}")


def _defects(outliers: float, step: float, clip: float, seed: int) -> list[Defect]:
    from agonic import simulation

    return [
        *([simulation.with_outliers(outliers, seed=seed)] if outliers else []),
        *([simulation.quantised(step)] if step else []),
        *([simulation.clipped(clip)] if clip else []),
    ]


def _sensor(kind: str, out: Path, sensor: Path | None, as_json: bool, **settings: Any) -> int:
    """One sensor: its table and its calibration."""
    from agonic import simulation
    from agonic.console.output import print_json, say
    from agonic.exports.csv import write_csv
    from agonic.files.calibration import save

    calibration = None if sensor is None else _truth(sensor)
    made = simulation.simulate(kind, calibration=calibration, **settings)
    write_csv(made.samples, out)
    truth = save(made.truth, out.with_suffix(".truth.json"))
    if as_json:
        print_json(
            "agonic/simulate@1",
            {
                "kind": kind,
                "n": len(made.samples),
                "files": [str(out), str(truth)],
                "bias_nT": made.truth.bias,
                "matrix": made.truth.matrix,
            },
        )
    else:
        say(f"{len(made.samples)} readings: {out}\nThe truth: {truth}")
    return 0


def _check_kind(kind: str) -> None:
    """Raise where there is no such kind."""
    from agonic.simulation import kinds

    known = (
        *kinds(),
        "vehicle",
        "orbit",
        *simulate_network.KINDS,
        "campaign",
        "fleet",
        "alignment",
        *simulate_north.KINDS,
    )
    if kind not in known:
        raise AgonicError(f"no kind {kind!r} to simulate; choose from {', '.join(known)}")


def _truth(path: Path) -> Affine:
    """A calibration whose readings are to be made."""
    from agonic.calibration.affine import Affine
    from agonic.files.calibration import load

    found = load(path)
    if not isinstance(found, Affine):
        raise AgonicError(f"{path} is a {found.kind}; the truth must be an affine one")
    return found


def _stated(context: typer.Context, name: str) -> bool:
    """Whether an option was given, and is not its default."""
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"
