"""What to type next: the command that follows from the gravest finding, or from a good result."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from agonic.console.standard_input import NAME
from agonic.files.names import file_stem
from agonic.health import Finding, figure
from agonic.recording.advice import is_in_space
from agonic.recording.calibrated import Calibrated
from agonic.units import NANOTESLA_PER, RAW

EARTH_NT = (20_000.0, 70_000.0)
_GRAVEST_FIRST = ("refused", "check", "good")
_MOMENT = re.compile(r"t = (-?[\d.]+) s\b")


def choose_command(results: Sequence[Calibrated], log: Path, folder: Path) -> str:
    """The command to type next, or "" where something has to be recorded first.

    Parameters: the sensors of the `log`; the `folder` that was written.
    """
    if log.name == NAME:  # what was piped in is not there any more
        return ""
    named = shlex.quote(str(log))
    for result in sorted(results, key=lambda one: _GRAVEST_FIRST.index(one.verdict)):
        if command := _find_remedy(result, named):
            return command
    usable = [result for result in results if result.verdict != "refused"]
    if not usable or len(usable) < len(results):
        return ""
    setup, first = folder / "setup.toml", usable[0]
    if setup.is_file() and first.samples.pitch_deg is not None:
        return f"agonic heading {shlex.quote(str(setup))} {named} -o headings.csv"
    if first.verdict != "good":
        return ""
    return f"agonic apply {shlex.quote(_find_calibration(folder, first))} {named} -o corrected.csv"


def _find_calibration(folder: Path, result: Calibrated) -> str:
    return str(folder / f"{file_stem(result.samples.name)}.json")


def _find_remedy(result: Calibrated, log: str) -> str:
    """The command that helps against what is the matter with a sensor, if one does."""
    samples = result.samples
    grave = {f.name: f for f in result.fit.findings if f.severity != "note"}
    if "pair" in grave and "oppositely" in grave["pair"].what:
        return f"agonic calibrate {log} --second auto"
    if "field changed" in grave and samples.time is not None:
        ends = float(samples.time[0]), float(samples.time[-1])
        stretch = _find_longest_stretch(grave["field changed"], *ends)
        return f"agonic calibrate {log} --between {stretch}"
    if samples.unit == RAW and (unit := _guess_unit(result)):
        return f"agonic calibrate {log} --unit {unit}"
    if grave and is_in_space(samples) and samples.frame not in ("n", "e"):
        return f"agonic fit inflight {log}"
    return ""


def _find_longest_stretch(changed: Finding, first: float, last: float) -> str:
    """The longest interval without a change, as --between has it, by the clock of the log."""
    moments = sorted(float(moment) for moment in _MOMENT.findall(changed.what))
    edges = [first, *(moment for moment in moments if first < moment < last), last]
    start, stop = max(pairwise(edges), key=lambda pair: pair[1] - pair[0])
    return f"{figure(start, 6)},{figure(stop, 6)}"


def _guess_unit(result: Calibrated) -> str:
    """The unit in which raw readings would have the size of the Earth's field, if one does."""
    calibration = result.fit.calibration
    gain = float(np.trace(calibration.matrix)) / 3
    size = (calibration.magnitude or 0.0) / max(gain, 1e-300)
    low, high = EARTH_NT
    return next((u for u in ("uT", "mG", "G", "nT") if low < size * NANOTESLA_PER[u] < high), "")
