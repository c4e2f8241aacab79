"""`agonic fit thermal CAMPAIGN -o DIR`: all sensors of a campaign in a climatic chamber."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from agonic.console.options import Json, KnownField, Unit
from agonic.console.parse import parse_count

if TYPE_CHECKING:
    from agonic.thermal.result import CalibratedCampaign

LARGE = 1_000_000
"""Readings of a campaign above which several processes fit its sensors."""


def fit_chamber(
    campaign: Path,
    out: Path | None = None,
    sensor: list[str] | None = None,
    stations: str = "auto",
    known_turns: bool = False,
    reference: KnownField = None,
    unit: Unit = None,
    degree: str = "3",
    bin_width: float = 0.5,
    field: float | None = None,
    unseen_change: float = 0.0,
    held_out: bool = True,
    workers: int | None = None,
    verbose: bool = False,
    as_json: Json = False,
) -> int:
    """Bias and matrix of every sensor over temperature, from turned stations.

    With --reference, from one recording in a field whose components are known, as in a coil: no
    stations are needed. Exit status 1 where the programme was not followed, a sensor was refused,
    or something is to be looked at.

    Options
    -------
    campaign <CAMPAIGN> : Folder with recordings, its campaign.toml, or one file.
    out -o DIR : Folder for the results.
    sensor -s : Only this one; may be repeated.
    stations : Turns of the stations: auto, known, found or unknown.
    known_turns --known-turns : The same as --stations known.
    degree : Of the polynomials in temperature: 0 to 9, or auto.
    bin_width DEG : Of the bins, °C.
    field NT : Magnitude in the chamber; default: the description's.
    unseen_change ≥0.0 : Share by which the field may have changed between stations, unseen.
    held_out : Try fits on stations that they have not seen; takes time.
    workers ≥1 : Processes; default: one for each core where it pays.
    verbose --verbose -v : All that was found of each sensor too.
    """
    from agonic.atomic import make_folder, write_atomically
    from agonic.console.finish import finish
    from agonic.console.progress import counting, progress
    from agonic.thermal.all_sensors import calibrate_campaign
    from agonic.thermal.document import describe_campaign
    from agonic.thermal.files.read import read_campaign

    chosen: Any = parse_count("--degree", degree, "a degree", 9)
    if reference is not None:
        return _fit_known_field(campaign, reference, sensor, unit, chosen, out, as_json)
    stations = "known" if known_turns else stations
    with counting(100) as bar:
        read = read_campaign(
            campaign, unit=unit, progress=lambda _, share: bar("Reading", round(100 * share))
        )
    result = calibrate_campaign(
        read,
        turns=stations,  # type: ignore[arg-type]
        magnitude=field,
        only=sensor or (),
        degree=chosen,
        bin_width_C=bin_width,
        unseen_change_sd=unseen_change,
        held_out=held_out,
        workers=workers or ((os.cpu_count() or 1) if read.rows > LARGE else 1),
        progress=lambda names: progress(names, "Fitting"),
    )
    files = {} if out is None else _write_calibrations(result, make_folder(out))
    name = campaign.resolve().name if campaign.is_dir() else campaign.stem
    document = describe_campaign(result, title=read.description.name or name, files=files)
    written = [file for own in files.values() for file in own]
    if out is not None:
        written.append(str(write_atomically(out / "report.html", document.to_html())))
    return finish(document, files=written, as_json=as_json, brief=not verbose)


def _fit_known_field(
    log: Path,
    reference: str,
    sensor: list[str] | None,
    unit: str | None,
    degree: Any,
    out: Path | None,
    as_json: bool,
) -> int:
    """One sensor in a field that is known at every reading."""
    from agonic.atomic import make_folder, write_atomically
    from agonic.console.finish import finish
    from agonic.console.place import open_beside_known_field
    from agonic.files.calibration import save
    from agonic.files.names import file_stem
    from agonic.thermal.document import describe_known_field
    from agonic.thermal.fit.fit import fit_thermal

    samples, known = open_beside_known_field(log, sensor[0] if sensor else None, reference, unit)
    fit = fit_thermal(samples, known, degree=degree)
    files = []
    if out is not None and fit.verdict != "refused":
        home = make_folder(out)
        files.append(str(save(fit.calibration, home / f"{file_stem(samples.name)}.json")))
    document = describe_known_field(fit, samples.name, title=log.name, files=files)
    if out is not None:
        files.append(str(write_atomically(make_folder(out) / "report.html", document.to_html())))
    return finish(document, files=files, as_json=as_json)


def _write_calibrations(result: CalibratedCampaign, home: Path) -> dict[str, list[str]]:
    """A calibration file for every sensor that was not refused, by sensor."""
    from agonic.files.calibration import save
    from agonic.files.names import file_stem

    return {
        sensor.name: [str(save(sensor.fit.calibration, home / f"{file_stem(sensor.name)}.json"))]
        for sensor in result.sensors
        if sensor.fit is not None and sensor.verdict != "refused"
    }
