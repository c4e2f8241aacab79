"""The folder of a calibration: its file, exports, setup and report for every sensor; and what to
type next, a command that runs as it stands, where nothing is missing."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType

from agonic.atomic import make_folder, write_atomically
from agonic.calibration.setup import Compass, Setup
from agonic.console.options import write_options
from agonic.console.standard_input import NAME
from agonic.errors import AgonicError
from agonic.exports.convert import CORRECTED
from agonic.exports.targets import TARGETS, USE
from agonic.exports.targets import write as write_target
from agonic.files.calibration import save
from agonic.files.names import file_stem, find_stale
from agonic.files.setup import save_setup
from agonic.health import figure
from agonic.recording.advice import TURNING, is_in_space
from agonic.recording.calibrated import Calibrated
from agonic.recording.document import Written, describe_recording
from agonic.recording.parts import CHANGED, cut_stretches, find_rows, sees_enough
from agonic.units import RAW

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
    """Calibration files, exports and report; returns what was written for each sensor. `title` is
    what the report is about, `stack` the autopilot that exports are for, or ""; `failures` are
    sensors that could not be fitted at all, and why."""
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
    from agonic.exports.targets import write_vehicle  # few logs have several compasses

    path = folder / f"compass{TARGETS[stack].suffix}"
    try:
        return [str(write_vehicle(stack, usable, path, unused=unused).path)]
    except AgonicError:  # the files of each sensor say why
        return []


def _setup(results: Sequence[Calibrated], written: dict[str, Written], folder: Path) -> list[str]:
    """The setup of the vehicle, for `agonic heading`, where its compasses can be used as such."""
    level = any(result.samples.axes == "xy" for result in results)
    compasses = {
        result.samples.name: Compass(calibration=result.fit.calibration)
        for result in results
        if written[result.samples.name].files and (level or result.fit.calibration.unit_out == "nT")
    }
    if not compasses:
        return []
    saved = {name: Path(written[name].files[0]).name for name in compasses}
    setup = Setup(compasses=tuple(compasses.values()), tilt="level" if level else "auto")
    return [str(save_setup(setup, folder / "setup.toml", saved=saved))]


def _sensor_files(result: Calibrated, stack: str, folder: Path) -> Written:
    """The calibration file, a C header, and parameters for the stack the log came from. Nothing is
    written of a refused calibration, nor parameters for an autopilot whose own correction is still
    in the readings."""
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
    for target in () if result.samples.axes == "xy" else ("c", *autopilot):
        try:
            export = write_target(target, calibration, stem.with_suffix(TARGETS[target].suffix))
        except AgonicError as error:  # raw units have no place in an autopilot, nor a mix of two
            warnings.append(f"no export for {target}: {error}")
            continue
        files.append(str(export.path))
        warnings += [f"{export.path.name}: {text}" for text in export.warnings]
    texts = {name: Path(name).read_text("utf-8") for name in files}
    return Written(files, warnings, {n: t for n, t in texts.items() if len(t) < MOST_CHARACTERS})


_GRAVEST_FIRST = ("refused", "check", "good")
_OF_READING = ("--unit", "--columns")
"""Options that every command needs which reads the log as this one did."""
NOTHING: Mapping[str, str] = MappingProxyType({})


def choose_command(
    results: Sequence[Calibrated], log: Path, folder: Path, typed: Mapping[str, str] = NOTHING
) -> str:
    """The command to type next, or "" where something has to be recorded first."""
    if log.name == NAME:  # what was piped in is not there any more
        return ""
    named = shlex.quote(str(log))
    read = {name: typed[name] for name in _OF_READING if name in typed}
    if any(
        s.target is not None and s.acceleration is not None for s in (r.samples for r in results)
    ):
        return f"agonic fit pair {named}{write_options(read)} -o setup.toml"
    for result in sorted(results, key=lambda one: _GRAVEST_FIRST.index(one.verdict)):
        if command := _find_remedy(result, named, typed):
            return command
    usable = [result for result in results if result.verdict != "refused"]
    if not usable or len(usable) < len(results):
        return ""
    setup, first = folder / "setup.toml", usable[0]
    samples = first.samples
    located = samples.latitude_deg is not None and samples.longitude_deg is not None
    levelled = samples.pitch_deg is not None or samples.axes == "xy"
    if setup.is_file() and levelled and ("--at" in typed or located):
        place = {name: typed[name] for name in ("--at", "--date") if name in typed}
        if samples.epoch is None:
            place.setdefault("--date", datetime.now(UTC).date().isoformat())
        options = write_options(read | place)
        return f"agonic heading {shlex.quote(str(setup))} {named}{options} -o headings.csv"
    if first.verdict != "good" or samples.axes == "xy":  # which agonic apply does not read
        return ""
    calibration = shlex.quote(str(folder / f"{file_stem(samples.name)}.json"))
    return f"agonic apply {calibration} {named}{write_options(read)} -o corrected.csv"


def _find_remedy(result: Calibrated, log: str, typed: Mapping[str, str]) -> str:
    """The command that helps against what is the matter with a sensor, if one does."""
    samples = result.samples
    grave = {f.name: f for f in result.fit.findings if f.severity != "note"}
    refused = {f.name for f in result.fit.findings if f.severity == "refuse"}

    def again(**more: str) -> str:
        new = {f"--{name}": value for name, value in more.items()}
        options = new | {name: value for name, value in typed.items() if name not in new}
        return f"agonic calibrate {log}{write_options(options)}"

    if "pair" in grave and "oppositely" in grave["pair"].what and result.reference is not None:
        return again(second="auto")
    if grave and is_in_space(samples) and samples.frame not in ("n", "e"):
        if samples.unit == RAW or samples.altitude_m is None or samples.epoch is None:
            return ""
        options = {name: typed[name] for name in _OF_READING if name in typed}
        return f"agonic fit inflight {log}{write_options(options)} -o inflight.json"
    if refused & set(TURNING):  # what was not turned is in no stretch of it
        return ""
    if CHANGED in grave and not refused and samples.time is not None and not result.stretches:
        stretches = cut_stretches(grave[CHANGED], samples.time)
        longest = max(stretches, key=lambda one: one[1] - one[0], default=None)
        if longest and sees_enough(result.corrected[find_rows(samples.time, [longest])]):
            return again(between=",".join(figure(moment, 6) for moment in longest))
    return ""  # of a calibration that is of stretches already the finding names the others
