"""`agonic fit thermal CAMPAIGN -o DIR`: all sensors of a campaign in a climatic chamber."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.console.options import Json

if TYPE_CHECKING:
    from agonic.thermal.fit.result import ThermalFit
    from agonic.thermal.result import CalibratedCampaign, CalibratedSensor

LARGE = 1_000_000
"""Readings of a campaign above which several processes fit its sensors."""


def add_to(kinds: typer.Typer) -> None:
    """Register the kind of fit."""
    kinds.command("thermal")(fit_chamber)


def fit_chamber(
    campaign: Annotated[
        Path,
        typer.Argument(
            metavar="CAMPAIGN", help="Folder with recordings, its campaign.toml, or one file."
        ),
    ],
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="DIR", help="Folder for the results.")
    ] = None,
    sensor: Annotated[
        list[str] | None, typer.Option("--sensor", "-s", help="Only this one; may be repeated.")
    ] = None,
    stations: Annotated[
        str, typer.Option(help="Turns of the stations: auto, known or unknown.")
    ] = "auto",
    degree: Annotated[
        str, typer.Option(help="Of the polynomials in temperature: 0 to 9, or auto.")
    ] = "3",
    bin_width: Annotated[float, typer.Option(metavar="DEG", help="Of the bins, °C.")] = 0.5,
    field: Annotated[
        float | None,
        typer.Option(metavar="NT", help="Magnitude in the chamber; default: the description's."),
    ] = None,
    held_out: Annotated[
        bool, typer.Option(help="Try fits on stations that they have not seen; takes time.")
    ] = True,
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Processes; default: one for each core where it pays."),
    ] = None,
    as_json: Json = False,
) -> int:
    """Bias and matrix of every sensor over temperature, from turned stations.

    Exit status 1 where the programme was not followed, a sensor was refused, or something is to be
    looked at.
    """
    from agonic.console.output import print_json, say
    from agonic.console.progress import progress
    from agonic.thermal.all_sensors import calibrate_campaign
    from agonic.thermal.files.read import read_campaign
    from agonic.thermal.text import summary

    chosen = _parse_degree(degree)
    with _show_progress("Reading") as bar:
        read = read_campaign(campaign, progress=bar)
    result = calibrate_campaign(
        read,
        turns=stations,  # type: ignore[arg-type]
        magnitude=field,
        only=sensor or (),
        degree=chosen,
        bin_width_C=bin_width,
        held_out=held_out,
        workers=workers or _count_workers(read.rows),
        progress=lambda names: progress(names, "Fitting"),
    )
    files = {} if out is None else _write_calibrations(result, out)
    title = campaign.resolve().name if campaign.is_dir() else campaign.stem
    reports = [] if out is None else [_write_report(result, out, title, files)]
    if as_json:
        print_json("agonic/fit-thermal@1", {**record(result, files), "files": reports})
    else:
        say(summary(result))
        listed = [*(name for names in files.values() for name in names), *reports]
        say(f"\nWritten   {', '.join(listed)}" if listed else "\nNothing was written.")
    return 0 if result.verdict == "good" else 1


def _count_workers(rows: int) -> int:
    """Processes that fit: a second one takes a second to begin."""
    return (os.cpu_count() or 1) if rows > LARGE else 1


def _parse_degree(text: str) -> Any:
    from agonic.errors import AgonicError

    if text == "auto":
        return text
    if not text.isdecimal() or int(text) > 9:
        raise AgonicError(f"--degree {text!r} is none; give 0 to 9, or auto")
    return int(text)


@contextmanager
def _show_progress(what: str) -> Iterator[Callable[[str, float], None] | None]:
    """A bar on stderr for work that tells its share done, on a terminal only."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task(what, total=1.0)
        yield lambda name, share: bars.update(
            task, completed=share, description=f"{what} {name}".strip()
        )


def _write_calibrations(result: CalibratedCampaign, out: Path) -> dict[str, list[str]]:
    """A calibration file for every sensor that was not refused, by sensor."""
    from agonic.atomic import make_folder
    from agonic.files.calibration import save

    home = make_folder(out)
    return {
        sensor.name: [str(save(sensor.fit.calibration, home / f"{_make_stem(sensor.name)}.json"))]
        for sensor in result.sensors
        if sensor.fit is not None and sensor.verdict != "refused"
    }


def _write_report(
    result: CalibratedCampaign, out: Path, title: str, files: dict[str, list[str]]
) -> str:
    """The page about all sensors, beside the calibrations."""
    from agonic.atomic import write_atomically
    from agonic.thermal.page import campaign_page

    title = result.campaign.description.name or title
    return str(
        write_atomically(out / "report.html", campaign_page(result, title=title, files=files))
    )


def _make_stem(name: str) -> str:
    return "".join(c if c.isalnum() or c in "-_" else "_" for c in name)


def record(result: CalibratedCampaign, files: dict[str, list[str]]) -> dict[str, Any]:
    """The result as one object for programs, an entry for each sensor."""
    from dataclasses import asdict

    chamber = result.chamber_field
    return {
        "verdict": result.verdict,
        "turns": result.turns,
        "reason": result.reason,
        "stations": result.campaign.stations,
        "rows": result.campaign.rows,
        "findings": [asdict(finding) for finding in result.findings],
        "chamber_field": None
        if chamber is None
        else {
            "sd_nT": chamber.common_sd,
            "axes": chamber.axes,
            "sensors": {
                share.name: {"noise_nT": share.noise_sd, "own_nT": share.own_sd}
                for share in chamber.shares
            },
        },
        "sensors": [_sensor(sensor, files.get(sensor.name, [])) for sensor in result.sensors],
    }


def _sensor(sensor: CalibratedSensor, files: list[str]) -> dict[str, Any]:
    """One sensor; a refused one has no numbers."""
    from dataclasses import asdict

    said = {
        "sensor": sensor.name,
        "verdict": sensor.verdict,
        "status": sensor.status,
        "files": files,
    }
    if sensor.fit is None:
        return said
    unseen = sensor.held_out
    tested = unseen and {
        "stations": unseen.spread.stations,
        "improvement": unseen.spread.improvement,
        "magnitude_rms_nT": unseen.magnitude_rms,
        "seen_rms_nT": unseen.seen_rms,
    }
    findings = [asdict(finding) for finding in sensor.findings]
    return {**said, **_numbers(sensor.fit), "held_out": tested, "findings": findings}


def _numbers(fit: ThermalFit) -> dict[str, Any]:
    """What a fit says in numbers."""
    import numpy as np

    calibration = fit.calibration
    low, high = calibration.validity.temperature_C or (calibration.centre_C, calibration.centre_C)
    levels = np.linspace(low, high, 7)
    sd = calibration.sd_at(levels)
    return {
        "method": "thermal",
        "taught_by": fit.taught_by,
        "n": fit.n,
        "degree": calibration.degree,
        "range_C": [low, high],
        "at": {
            "temperature_C": levels,
            "bias_nT": calibration.bias_at(levels),
            "bias_sd_nT": sd[:, :3],
            "matrix": calibration.matrix_at(levels),
            "matrix_sd": sd[:, 3:9],
        },
        "rate_nT_per_C_s": calibration.rate,
        "noise_nT": fit.noise,
        "excess_nT": fit.excess,
        "improvement": None if fit.spread is None else fit.spread.improvement,
        "hysteresis": None
        if fit.hysteresis is None
        else {"difference": fit.hysteresis.difference, "sd": fit.hysteresis.sd},
        "fixture_deg": None if fit.fixture is None else fit.fixture.turned_deg,
        "drift_nT": fit.drift,
        "anomalies": {str(a.station): a.count for a in fit.anomalies},
        "equation": calibration.equation,
    }
