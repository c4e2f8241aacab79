"""`agonic fit inflight LOG`: a calibration against the world model, in flight and in orbit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.console.options import At, Between, Date, Json, Sensor, Unit

if TYPE_CHECKING:
    from agonic.inflight.fit import InflightFit
    from agonic.reference import Reference
    from agonic.samples import Samples


IN_MEMORY = 2_000_000
"""Rows of a Parquet table from which it is read piece by piece."""


def add_to(kinds: typer.Typer) -> None:
    """Register the kind of fit."""
    kinds.command("inflight")(inflight)


def inflight(
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG...",
            help="A recording; or the files of a mission in order of time, read piece by piece.",
        ),
    ],
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="CAL", help="Calibration file to write.")
    ] = None,
    ground: Annotated[
        Path | None,
        typer.Option(
            metavar="CAL", help="The calibration made on the ground; it is brought up to date."
        ),
    ] = None,
    solve: Annotated[
        str | None,
        typer.Option(help="bias, gains or full; default: bias with --ground, full without."),
    ] = None,
    knots: Annotated[
        str, typer.Option(help="Intervals of the bias in time: a number, or auto.")
    ] = "auto",
    latitudes: Annotated[
        str | None, typer.Option(metavar="LOW,HIGH", help="Use readings between these only.")
    ] = None,
    scalar: Annotated[
        bool | None,
        typer.Option(
            "--scalar/--no-scalar",
            help="Against the scalar instrument, or the world model; default: as the log has it.",
        ),
    ] = None,
    attitude: Annotated[
        str,
        typer.Option(
            help="none; logged (roll, pitch, heading in the log teach too); nadir (one side kept "
            "to the Earth, attitude from the track)."
        ),
    ] = "none",
    temperature: Annotated[
        int, typer.Option(metavar="ORDER", help="Polynomials in temperature up to this order.")
    ] = 0,
    matrix_rate: Annotated[
        bool, typer.Option("--matrix-rate", help="Let the matrix change steadily with time.")
    ] = False,
    sources: Annotated[
        str,
        typer.Option("--with", metavar="NAMES", help="What disturbs on board: current_A, …"),
    ] = "",
    within: Annotated[
        float | None,
        typer.Option("--within", metavar="NT", help="Leave out readings farther off than this."),
    ] = None,
    sensor: Sensor = None,
    unit: Unit = None,
    at: At = None,
    date: Date = None,
    gain_sd: Annotated[
        float, typer.Option(help="How far gains may have moved since the ground, a share.")
    ] = 0.01,
    robust: Annotated[bool, typer.Option(help="Meet outliers with Tukey's loss.")] = True,
    between: Between = None,
    as_json: Json = False,
) -> int:
    """Bias, gains or all nine numbers from the field that is known on the way."""
    from agonic.calibration.chain import require_calibration
    from agonic.console.output import print_json, say
    from agonic.errors import AgonicError
    from agonic.files.calibration import load, save
    from agonic.inflight.fit import fit_inflight
    from agonic.logs.large.mission import is_long

    settings: dict[str, Any] = {
        "ground": None if ground is None else require_calibration(load(ground)),
        "solve": solve,
        "drift_knots": _knots(knots),
        "latitude_deg": _range(latitudes),
        "temperature_degree": temperature,
        "matrix_rate": matrix_rate,
        "sources": tuple(name for name in sources.replace(",", " ").split() if name),
        "gain_sd": gain_sd,
        "robust": robust,
    }
    if is_long(logs, IN_MEMORY):
        given = {"--at": at, "--between": between, "--within": within}
        given["--attitude"] = None if attitude == "none" else attitude
        unfit = [name for name, value in given.items() if value is not None]
        if unfit:
            raise AgonicError(f"a mission is read piece by piece, without {', '.join(unfit)}")
        fit, samples = _mission(logs, sensor, unit, date, scalar, settings), None
    else:
        more: dict[str, Any] = {"attitude": attitude, "residual_limit": within}
        samples = _samples(logs[0], sensor, unit, between, date)
        fit = fit_inflight(samples, _reference(samples, at, date, scalar), **settings, **more)
    name = fit.change.sensor
    files = [str(save(fit.calibration, out))] if out and fit.verdict != "refused" else []
    files += [] if out is None else [_page(out, fit, samples, logs[0].name)]
    if as_json:
        print_json("agonic/fit-inflight@1", {**record(fit), "sensor": name, "files": files})
    else:
        say(summary(fit, name))
        say(f"\nWritten   {', '.join(files)}" if files else "\nNothing was written.")
    return 0 if fit.verdict == "good" else 1


def _samples(
    log: Path, sensor: str | None, unit: str | None, between: str | None, date: str | None
) -> Samples:
    """The readings of one recording, with the date that was given where it has none."""
    from agonic.cli.fit import _sensor

    samples = _sensor(log, sensor, unit, between)
    if date is None or samples.epoch is not None:
        return samples
    return samples.with_columns(epoch=_moment(date))


def _page(out: Path, fit: InflightFit, samples: Samples | None, title: str) -> str:
    """The report beside the calibration."""
    from agonic.atomic import write_atomically
    from agonic.inflight.report.page import inflight_page

    page = inflight_page(fit, samples, title=title)
    return str(write_atomically(out.with_suffix(".html"), page))


def _moment(date: str) -> Any:
    from datetime import UTC, datetime

    from agonic.errors import AgonicError

    try:
        return datetime.fromisoformat(date).replace(tzinfo=UTC)
    except ValueError:
        raise AgonicError(f"--date {date!r} is not a date such as 2026-05-01") from None


def _mission(
    logs: list[Path],
    sensor: str | None,
    unit: str | None,
    date: str | None,
    scalar: bool | None,
    settings: dict[str, Any],
) -> InflightFit:
    """The fit of a record that is read piece by piece."""
    from agonic.console.progress import counting
    from agonic.inflight.fit import fit_mission
    from agonic.logs.large.mission import open_mission

    mission = open_mission(logs, sensor=sensor, unit=unit, date=date)
    if scalar is None:
        scalar = next(mission.pieces()).scalar is not None
    with counting(mission.rows) as told:
        return fit_mission(mission, scalar=scalar, progress=told, **settings)


def _reference(
    samples: Samples, at: str | None, date: str | None, scalar: bool | None
) -> Reference | None:
    from agonic.console.place import expected, scalar_reference

    taught = scalar_reference(samples, scalar)
    return taught or expected(samples, at, date, None)[0]


def _knots(text: str) -> Any:
    from agonic.errors import AgonicError

    if text == "auto":
        return text
    if not text.isdecimal():
        raise AgonicError(f"--knots {text!r} is not a number of intervals, nor auto")
    return int(text)


def _range(text: str | None) -> tuple[float, float] | None:
    from agonic.errors import AgonicError

    if text is None:
        return None
    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError:
        raise AgonicError(f"--latitudes {text!r} is not LOW,HIGH in degrees") from None
    return low, high


def summary(fit: InflightFit, name: str) -> str:
    """The result in a few lines."""
    import textwrap

    from agonic.report.digits import quantity, with_sd
    from agonic.report.text import SIGNS
    from agonic.report.verdict import MEANINGS

    sd = fit.sd
    bias = "   ".join(
        f"{axis} {with_sd(float(v), float(s))}"
        for axis, v, s in zip("xyz", fit.change.bias, sd[:3], strict=True)
    )
    what = "Moved by" if fit.calibration is not fit.change else "Bias"
    word = MEANINGS[fit.verdict][0].lower()
    lasts = quantity(fit.correlation_s, "s", 2)
    rms = float((fit.residuals[fit.weights > 0] ** 2).mean() ** 0.5)
    return "\n".join(
        [
            f"{SIGNS[fit.verdict]} {name}: {word} (in flight, {fit.solve}, {fit.n} readings)",
            *textwrap.wrap(fit.status, 98, initial_indent="  ", subsequent_indent="  "),
            f"  {what:<10}{bias} {fit.change.unit_in}",
            f"  Residual  {quantity(rms, 'nT', 3)} rms; what lasts {lasts} counts as one",
        ]
    )


def record(fit: InflightFit) -> dict[str, Any]:
    """The fit as one flat object for programs."""
    from dataclasses import asdict

    from agonic.calibration.interference import signals

    believed = fit.residuals[fit.weights > 0]
    return {
        "method": "inflight",
        "solve": fit.solve,
        "verdict": fit.verdict,
        "status": fit.status,
        "n": fit.n,
        "bias_change_nT": fit.change.bias,
        "matrix_change": fit.change.matrix,
        "sd": fit.sd,
        "calibration_kind": fit.calibration.kind,
        "noise_nT": fit.noise,
        "residual_rms_nT": float((believed**2).mean() ** 0.5),
        "correlation_s": fit.correlation_s,
        "lasting_nT": fit.lasting_nT,
        "lasting_s": fit.lasting_s,
        "drift_intervals": fit.drift.intervals,
        "held_out_nT": {str(k): v for k, v in fit.held_out.items()},
        "channels": {
            kind: {"noise_nT": of.noise, "correlation": of.correlation}
            for kind, of in fit.channels.items()
        },
        **_directions(fit),
        "sources": dict(zip(signals(fit.source_names), fit.sources.T.tolist(), strict=True)),
        "findings": [asdict(finding) for finding in fit.findings],
    }


def _directions(fit: InflightFit) -> dict[str, Any]:
    """What the attitude adds."""
    import numpy as np

    if fit.alignment is None or fit.direction_error_deg is None:
        return {"direction_error_deg": None, "alignment_deg": None}
    assert fit.alignment.covariance is not None
    return {
        "direction_error_deg": float(np.median(fit.direction_error_deg[fit.weights > 0])),
        "alignment_deg": {
            "rotation_vector": fit.alignment.rotation.as_rotvec(degrees=True),
            "sd": np.degrees(np.sqrt(np.diag(fit.alignment.covariance))),
        },
    }
