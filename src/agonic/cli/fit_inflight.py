"""`agonic fit inflight LOG`: a calibration against the world model, in flight and in orbit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.cli.options import At, Between, Date, Json, LogPath, Sensor, Unit

if TYPE_CHECKING:
    from agonic.fitting.inflight import InflightFit
    from agonic.reference import Reference
    from agonic.samples import Samples


def add_to(kinds: typer.Typer) -> None:
    """Register the kind of fit."""
    kinds.command("inflight")(inflight)


def inflight(
    log: LogPath,
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
        bool, typer.Option(help="Against the scalar instrument in the log, not the world model.")
    ] = False,
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
    """Bias, gains or all nine numbers from the magnitude of the field on the way."""
    from agonic.cli.fit import _sensor
    from agonic.cli.output import print_json, say
    from agonic.fitting.inflight import fit_inflight
    from agonic.io.calfile import load, require_calibration, save

    samples = _sensor(log, sensor, unit, between)
    fit = fit_inflight(
        samples,
        _reference(samples, at, date, scalar),
        ground=None if ground is None else require_calibration(load(ground)),
        solve=solve,  # type: ignore[arg-type]
        drift_knots=_knots(knots),
        latitude_deg=_range(latitudes),
        gain_sd=gain_sd,
        robust=robust,
    )
    files = [str(save(fit.calibration, out))] if out and fit.verdict != "refused" else []
    if as_json:
        print_json("agonic/fit-inflight@1", {**record(fit), "sensor": samples.name, "files": files})
    else:
        say(summary(fit, samples.name))
        say(f"\nWritten   {files[0]}" if files else "\nNothing was written.")
    return 0 if fit.verdict == "good" else 1


def _reference(
    samples: Samples, at: str | None, date: str | None, scalar: bool
) -> Reference | None:
    from agonic.cli.place import expected
    from agonic.errors import AgonicError
    from agonic.reference import Reference

    if not scalar:
        return expected(samples, at, date, None)[0]
    values = samples.columns().get("scalar")
    if values is None:
        raise AgonicError("--scalar: the log holds no scalar instrument (column scalar_nT)")
    return Reference.magnitude(values, source="the scalar instrument in the log")


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
        "drift_intervals": fit.drift.intervals,
        "held_out_nT": {str(k): v for k, v in fit.held_out.items()},
        "findings": [asdict(finding) for finding in fit.findings],
    }
