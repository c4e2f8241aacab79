"""What to type next: a command that runs as it stands; where something is missing, none."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType

from agonic.console.options import write_options
from agonic.console.standard_input import NAME
from agonic.files.names import file_stem
from agonic.health import Finding, figure
from agonic.recording.advice import TURNING, is_in_space
from agonic.recording.calibrated import Calibrated
from agonic.recording.held_out import sees_enough
from agonic.recording.stretch import CHANGED, find_rows, list_stretches
from agonic.samples import Samples
from agonic.units import RAW

_GRAVEST_FIRST = ("refused", "check", "good")
_OF_READING = ("--unit", "--columns")
"""Options that every command needs which reads the log as this one did."""
NOTHING: Mapping[str, str] = MappingProxyType({})


def choose_command(
    results: Sequence[Calibrated], log: Path, folder: Path, typed: Mapping[str, str] = NOTHING
) -> str:
    """The command to type next, or "" where something has to be recorded first.

    Parameters: the sensors of the `log`; the `folder` that was written; the options that were
    `typed`, which the next command needs as well.
    """
    if log.name == NAME:  # what was piped in is not there any more
        return ""
    named = shlex.quote(str(log))
    if any(has_shots(one.samples) for one in results):
        read = {name: typed[name] for name in _OF_READING if name in typed}
        return f"agonic fit pair {named}{write_options(read)} -o setup.toml"
    for result in sorted(results, key=lambda one: _GRAVEST_FIRST.index(one.verdict)):
        if command := _find_remedy(result, named, typed):
            return command
    usable = [result for result in results if result.verdict != "refused"]
    if not usable or len(usable) < len(results):
        return ""
    setup, first = folder / "setup.toml", usable[0]
    read = {name: typed[name] for name in _OF_READING if name in typed}
    if setup.is_file() and first.samples.pitch_deg is not None and _is_located(first, typed):
        options = write_options(read | _name_place(first.samples, typed))
        return f"agonic heading {shlex.quote(str(setup))} {named}{options} -o headings.csv"
    if first.verdict != "good":
        return ""
    calibration = shlex.quote(str(folder / f"{file_stem(first.samples.name)}.json"))
    return f"agonic apply {calibration} {named}{write_options(read)} -o corrected.csv"


def has_shots(samples: Samples) -> bool:
    """Whether rows are shots of an instrument: at rest, with the target that its sight was on."""
    return samples.target is not None and samples.acceleration is not None


def _is_located(result: Calibrated, typed: Mapping[str, str]) -> bool:
    """Whether true headings can be had: the place is in the log, or was given."""
    samples = result.samples
    return "--at" in typed or not (samples.latitude_deg is None or samples.longitude_deg is None)


def _name_place(samples: Samples, typed: Mapping[str, str]) -> dict[str, str]:
    """The place and the date that true headings need beside the log."""
    named = {name: typed[name] for name in ("--at", "--date") if name in typed}
    if samples.epoch is None:
        named.setdefault("--date", datetime.now(UTC).date().isoformat())
    return named


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
    if CHANGED in grave and not refused and samples.time is not None:
        return _leave_change(result, grave[CHANGED], again)
    return ""


def _leave_change(result: Calibrated, changed: Finding, again: Callable[..., str]) -> str:
    """The longest stretch of a log without a change of the bias, where it sees enough by itself; of
    a calibration that is of stretches already the finding names the others."""
    time = result.samples.time
    assert time is not None
    stretches = [] if result.stretches else list_stretches(changed, time)
    if not stretches:
        return ""
    start, stop = stretches[0]
    if not sees_enough(result.corrected[find_rows(time, start, stop)]):
        return ""
    return again(between=f"{figure(start, 6)},{figure(stop, 6)}")
