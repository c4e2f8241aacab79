"""The folder of a calibration: its file, exports, setup and report for every sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from agonic.atomic import make_folder, write_atomically
from agonic.calibration.setup import Compass, Setup
from agonic.errors import AgonicError
from agonic.exports.convert import CORRECTED
from agonic.exports.targets import TARGETS, USE
from agonic.exports.targets import write as write_target
from agonic.files.calibration import save
from agonic.files.names import file_stem, find_stale
from agonic.files.setup import save_setup
from agonic.recording.calibrated import Calibrated
from agonic.recording.document import Written, describe_recording

MOST_CHARACTERS = 20_000
"""Of a file that the page shows whole."""


def write_folder(
    results: Sequence[Calibrated],
    folder: Path,
    *,
    title: str,
    stack: str = "",
    failures: Sequence[tuple[str, str]] = (),
) -> dict[str, Written]:
    """Calibration files, exports and report; returns what was written for each sensor.

    `title` is what the report is about, `stack` the autopilot that exports are for, or "";
    `failures` are sensors that could not be fitted at all, and why.
    """
    make_folder(folder)
    written = {result.samples.name: _sensor_files(result, stack, folder) for result in results}
    setup = [*_write_all_compasses(results, stack, folder), *_setup(results, written, folder)]
    page = str(folder / "report.html")
    stale = find_stale(folder, [*setup, *(file for w in written.values() for file in w.files)])
    for name in list(written)[:1]:
        written[name] = written[name]._replace(warnings=[*stale, *written[name].warnings])
    document = describe_recording(results, title=title, written=written, failures=failures)
    write_atomically(page, document.to_html())
    return {name: w._replace(files=[*w.files, *setup, page]) for name, w in written.items()}


def _write_all_compasses(results: Sequence[Calibrated], stack: str, folder: Path) -> list[str]:
    """One file of parameters for all compasses of an autopilot, where there are several."""
    there = [one for one in results if not one.samples.corrected]
    usable = {one.samples.name: one.calibration for one in there if one.verdict != "refused"}
    if stack not in USE or len(results) < 2 or not usable:
        return []
    unused = tuple(one.samples.name for one in there if one.verdict == "refused")
    from agonic.exports.vehicle import write_vehicle  # few logs have several compasses

    path = folder / f"compass{TARGETS[stack].suffix}"
    try:
        return [str(write_vehicle(stack, usable, path, unused=unused).path)]
    except AgonicError:  # the files of each sensor say why
        return []


def _setup(results: Sequence[Calibrated], written: dict[str, Written], folder: Path) -> list[str]:
    """The setup of the vehicle, for `agonic heading`, where its compasses can be used as such."""
    compasses = {
        result.samples.name: Compass(calibration=result.fit.calibration)
        for result in results
        if written[result.samples.name].files and result.fit.calibration.unit_out == "nT"
    }
    if not compasses:
        return []
    saved = {name: Path(written[name].files[0]).name for name in compasses}
    setup = Setup(compasses=tuple(compasses.values()))
    return [str(save_setup(setup, folder / "setup.toml", saved=saved))]


def _sensor_files(result: Calibrated, stack: str, folder: Path) -> Written:
    """The calibration file, a C header, and parameters for the stack the log came from.

    Nothing is written of a refused calibration, nor parameters for an autopilot whose own
    correction is still in the readings.
    """
    stem = folder / file_stem(result.samples.name)
    if result.verdict == "refused":
        return Written([], [])
    calibration = result.fit.calibration
    if result.samples.corrected:
        origin = calibration.provenance
        said = {**origin.settings, CORRECTED: "corrected by the autopilot before"}
        origin = replace(origin, settings=said)
        calibration = replace(calibration, provenance=origin)
    files, warnings = [str(save(calibration, stem.with_suffix(".json")))], []
    autopilot = (stack,) if stack in TARGETS and not result.samples.corrected else ()
    for target in ("c", *autopilot):
        try:
            export = write_target(target, calibration, stem.with_suffix(TARGETS[target].suffix))
        except AgonicError as error:  # raw units have no place in an autopilot, nor a mix of two
            warnings.append(f"no export for {target}: {error}")
            continue
        files.append(str(export.path))
        warnings += [f"{export.path.name}: {text}" for text in export.warnings]
    texts = {name: Path(name).read_text("utf-8") for name in files}
    return Written(files, warnings, {n: t for n, t in texts.items() if len(t) < MOST_CHARACTERS})
