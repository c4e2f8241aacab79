"""The work on one log: read it, calibrate each magnetometer in it, and say so in rows; the same of
sensors of a dataset by their rows."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from agonic.atomic import make_folder
from agonic.errors import AgonicError, LogError, MissingExtraError
from agonic.field.place import choose_reference
from agonic.files.calibration import save
from agonic.files.names import file_stem
from agonic.fleet.inputs import SINGLE
from agonic.fleet.rows import make_refused_row, make_row
from agonic.fleet.settings import FleetSettings, digest
from agonic.logs.large.dataset import Channel, Dataset
from agonic.logs.large.mission import is_long, open_mission
from agonic.logs.log import Log, Table
from agonic.logs.read import open_log
from agonic.logs.remote import locate, name_locally
from agonic.logs.table import build_log
from agonic.population import Row
from agonic.provenance import Input, escape_text, hash_file
from agonic.recording.calibrated import Calibrated, calibrate_recording
from agonic.recording.files import write_folder
from agonic.recording.mounting import calibrate
from agonic.samples import Samples
from agonic.version import __version__


@dataclass(frozen=True, slots=True)
class Done:
    """What became of a log: the digest of its content, and its rows. `final` is false where another
    try may end otherwise, as where the file could not be read. The row of a log that could not be
    opened has the channel ""."""

    sha256: str
    rows: tuple[Row, ...]
    final: bool = True


def calibrate_log(path: str, *, settings: FleetSettings, folder: str) -> Done:
    """The rows of a log: each sensor as `agonic calibrate` does it, or the reason why not. Nothing
    that is wrong with a log is raised. `folder` is where the table goes; what is written of the log
    goes into `calibrations` there."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what matters is among the findings of the row
        try:
            if _is_long(path) and (found := _calibrate_long(path, settings)):
                log, outcomes = found
            else:
                log = open_log(path, unit=settings.unit)
                if settings.sensor is not None:
                    log = replace(log, sensors=(log.sensor(settings.sensor),))
                outcomes = [try_calibrate(samples, settings) for samples in log.sensors]
        except Exception as error:  # whatever is wrong with a log becomes its row
            return report_unread(path, explain(error, path), settings, final=_is_final(error))
        results = [outcome for outcome in outcomes if isinstance(outcome, Calibrated)]
        written, trouble = _try_to_write(results, log, settings, Path(folder))
    rows = []
    for samples, outcome in zip(log.sensors, outcomes, strict=True):
        known = describe_log(path, log.source.sha256, settings, samples.name)
        row = _make_row(outcome, samples, path, {**known, **written.get(samples.name, {})})
        if trouble and isinstance(outcome, Calibrated):
            row = replace(row, status=f"{row.status} {trouble}")
        rows.append(row)
    return Done(log.source.sha256, tuple(rows), all(map(_is_final, outcomes)))


def _is_long(path: str) -> bool:
    try:
        return is_long([locate(path)])
    except Exception:  # opening it tells what is wrong with it
        return False


def _calibrate_long(
    path: str, settings: FleetSettings
) -> tuple[Log, list[Calibrated | Exception]] | None:
    """A table too long for memory, by rows that were kept of it, and what became of each sensor."""
    mission = open_mission([path], sensor=settings.sensor, unit=settings.unit)
    names = mission.sensors()
    if not names:
        return None
    if settings.method not in ("auto", "ellipsoid"):
        raise LogError(
            f"it has {mission.rows} rows and is read piece by piece, by the magnitude alone, not "
            f"{settings.method}; cut it"
        )
    heads, outcomes = [], []
    for name in names if settings.sensor is None else (settings.sensor,):
        of_sensor = replace(mission, sensor=name)
        heads.append(of_sensor.head())
        outcomes.append(try_calibrate(heads[-1], settings, partial(calibrate_recording, of_sensor)))
    log = Log(
        path=name_locally(locate(path)),
        format="Parquet table",
        source=mission.inputs[0],
        sensors=tuple(heads),
    )
    return log, outcomes


def describe_log(
    path: str, sha256: str, settings: FleetSettings, channel: str = ""
) -> dict[str, Any]:
    """What a row of a log says beside its figures; the caller may know the sensor better."""
    return {
        "sensor": escape_text(locate(path).stem),
        "source": escape_text(path),
        "sha256": sha256,
        "key": digest(sha256, channel, settings.asked),
        "settings": settings.asked,
        "version": __version__,
    }


def explain(error: Exception, path: str) -> str:
    """Why a log has no calibration: the error without the path, which the row names."""
    if not isinstance(error, AgonicError):
        return " ".join(f"unexpected: {type(error).__name__}: {error}".split())[:500]
    return " ".join(str(error).removeprefix(path).lstrip(":, ").split())


def report_unread(path: str, reason: str, settings: FleetSettings, *, final: bool = False) -> Done:
    """The row of a log that could not be opened."""
    content = ""
    with suppress(OSError):
        if Path(path).is_file():  # a pipe would be waited for
            content = hash_file(Path(path))
    row = make_refused_row(reason, **describe_log(path, content, settings), channel="")
    return Done(content, (row,), final and bool(content))


def try_calibrate(
    samples: Samples, settings: FleetSettings, run: Callable[..., Calibrated] | None = None
) -> Calibrated | Exception:
    """What `agonic calibrate` makes of one magnetometer, or why it cannot. `run` calibrates a
    recording that `samples` are but the head of."""
    date = settings.date or (None if samples.epoch else settings.undated)
    try:
        reference, of_place = choose_reference(samples, settings.at, date, settings.field_nT)
        if run is not None:
            return run(reference, **of_place)
        kind: Any = settings.method
        return calibrate(samples, reference, kind=kind, **of_place)
    except Exception as error:  # as above
        return error


def _try_to_write(
    results: Sequence[Calibrated], log: Log, settings: FleetSettings, folder: Path
) -> tuple[Mapping[str, dict[str, str]], str]:
    """The files of each sensor, or why there are none; a disk that is full is raised."""
    try:
        return (_write_files(results, log, settings, folder) if results else {}), ""
    except (AgonicError, OSError):
        raise
    except Exception as error:  # a page that cannot be drawn must not end the others' run
        return {}, f"Its files could not be written ({explain(error, '')})."


def _write_files(
    results: Sequence[Calibrated], log: Log, settings: FleetSettings, folder: Path
) -> Mapping[str, dict[str, str]]:
    """The files of each sensor, from the folder of the table, by the fields of its row. The digest
    in the name of the log's own folder keeps logs of one name apart."""
    if not (settings.files or settings.reports):
        return {}
    own = Path(SINGLE, f"{file_stem(log.path.stem)[:60]}-{log.source.sha256[:8]}")
    make_folder(folder / own)
    files = {
        result.samples.name: {"calibration": f"{file_stem(result.samples.name)}.json"}
        for result in results
        if result.verdict != "refused"
    }
    if settings.reports:
        write_folder(results, folder / own, title=log.source.name, stack=log.stack)
        for result in results:
            files.setdefault(result.samples.name, {})["report"] = "report.html"
    else:
        for result in results:
            if result.samples.name in files:
                path = folder / own / files[result.samples.name]["calibration"]
                save(result.fit.calibration, path)
    return {
        name: {what: (own / file).as_posix() for what, file in of_sensor.items()}
        for name, of_sensor in files.items()
    }


def _is_final(outcome: Calibrated | Exception) -> bool:
    """Whether another try would end the same."""
    chain = (outcome, getattr(outcome, "__cause__", None))
    return not any(isinstance(part, OSError | MemoryError | MissingExtraError) for part in chain)


Task = tuple[tuple[str, Table], ...]
"""Sensors: their name and their rows."""


def calibrate_by_rows(
    task: Task,
    *,
    dataset: Dataset,
    channel: Channel,
    source: Input,
    settings: FleetSettings,
    known: Mapping[str, Any],
) -> tuple[Row, ...]:
    """The row of each of these sensors, calibrated by its rows as a log is."""
    rows = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what matters is among the findings of the row
        for name, table in task:
            try:
                log = build_log(
                    table,
                    path=dataset.path,
                    source=source,
                    format="Parquet table",
                    unit=dataset.unit,
                )
                samples = log.sensor(channel.name)
            except LogError as error:
                why = explain(error, str(dataset.path))
                rows.append(make_refused_row(why, sensor=name, **known))
                continue
            outcome = try_calibrate(samples, settings)
            own = {**known, "sensor": name}
            own.pop("channel", None)  # that of the samples
            rows.append(_make_row(outcome, samples, str(dataset.path), own))
    return tuple(rows)


def _make_row(
    outcome: Calibrated | Exception, samples: Samples, path: str, known: Mapping[str, Any]
) -> Row:
    if isinstance(outcome, Calibrated):
        return make_row(outcome, **known)
    return make_refused_row(explain(outcome, path), samples=samples, **known)
