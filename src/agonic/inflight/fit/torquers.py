"""Magnetic torquers in flight: readings while they are on, and while they settle."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.sources import list_columns
from agonic.health import MIN_READINGS, Finding, figure
from agonic.samples import Samples

DIPOLE = "_Am2"
"""How the names of columns end that hold the dipole that a torquer is told to make."""
LONGEST = 60
"""Readings after a switch within which torquers may settle."""


@dataclass(frozen=True, kw_only=True)
class Torquers:
    """What was left out for torquers: rows in which `unmodelled` ones were on, and rows within
    `settling_s` of a switch of any of `commands`; and the time constant with which the field
    follows those that are modelled, 0 where it does at once."""

    commands: tuple[str, ...] = ()
    unmodelled: tuple[str, ...] = ()
    on: int = 0
    settling_s: float = 0.0
    settling: int = 0
    time_constant_s: float = 0.0
    time_constant_sd_s: float = 0.0
    rows: int = 1


def list_dipoles(samples: Samples) -> tuple[str, ...]:
    """The columns that hold the dipole of a torquer."""
    return tuple(name for name in samples.disturbers if name.endswith(DIPOLE))


def leave_out_unmodelled(
    samples: Samples, sources: tuple[str, ...], used: Mask
) -> tuple[Mask, Torquers]:
    """The rows to use, and what was left out: readings while a torquer is on that no source takes
    into account. Where next to nothing would remain all are kept."""
    taken, columns = list_columns(sources), samples.disturbers
    commands = tuple(name for name in list_dipoles(samples) if np.ptp(columns[name]) > 0)
    unmodelled = tuple(name for name in commands if name not in taken)
    on = is_on(samples, unmodelled)
    if (used & ~on).sum() < MIN_READINGS:
        on[:] = False
    rows = max(int(used.sum()), 1)
    found = Torquers(commands=commands, unmodelled=unmodelled, on=int((used & on).sum()), rows=rows)
    return used & ~on, found


class Switches:
    """When any of some commands changed last, over a record in one piece or in several."""

    def __init__(self, commands: tuple[str, ...]) -> None:
        self._commands, self._at_s = commands, -np.inf
        self._before: Array | None = None

    def measure_since(self, samples: Samples) -> Array:
        """Seconds since the last change, (n,), infinite before the first; pieces come in order."""
        assert samples.time is not None
        if not self._commands or not len(samples):
            return np.full(len(samples), np.inf)
        values = np.stack([samples.disturbers[name] for name in self._commands], axis=1)
        before = values[0] if self._before is None else self._before
        changed = (np.diff(values, axis=0, prepend=before[None]) != 0).any(axis=1)
        at = np.maximum.accumulate(np.where(changed, samples.time, self._at_s))
        self._before, self._at_s = values[-1], float(at[-1])
        return np.asarray(samples.time - at)


def is_settling(since: Array, settling_s: float, step_s: float) -> Mask:
    """Whether torquers still settle in a reading, by the seconds since a switch."""
    return since < settling_s - 0.5 * step_s


def is_on(samples: Samples, names: tuple[str, ...]) -> Mask:
    """Whether any of the torquers is on, (n,)."""
    values = [samples.disturbers[name] != 0 for name in names]
    return np.asarray(np.any([np.zeros(len(samples), dtype=bool), *values], axis=0))


def find_settling_s(since: Array, residuals: Array, step_s: float) -> float:
    """How long after a switch residuals are larger than later, s; 0 where they are not: squares in
    the first, second, … reading after it against those long after, by the scatter of these.
    """
    number = np.floor(since / step_s + 0.5)
    counted = number[np.isfinite(number)]
    middle = float(np.median(counted)) if len(counted) else 0.0
    late = residuals[number >= min(LONGEST, middle)]
    if len(late) < MIN_READINGS:
        return 0.0
    squares = np.minimum(np.square(late), np.square(10 * np.median(np.abs(late))))
    usual, spread = float(squares.mean()), float(squares.std())
    last = -1
    for k in range(LONGEST):
        own = np.square(residuals[number == k])
        # standard errors
        if len(own) < 8 or own.mean() - usual < 4.0 * spread / np.sqrt(len(own)):
            break
        last = k
    return (last + 1) * step_s


def list_torquer_findings(torquers: Torquers) -> Iterator[Finding]:
    """What was left out for torquers, and how to use it."""
    move = f"take them into the fit: --with {','.join(torquers.unmodelled)}"
    on, settling = (figure(100 * rows / torquers.rows) for rows in (torquers.on, torquers.settling))
    if torquers.on:
        what = f"a torquer is on in {on} % of the readings, which were left out"
        yield Finding("torquers on", "note", what, move)
    elif torquers.unmodelled:
        what = "torquers are on in nearly all readings, and what they add was not taken out"
        yield Finding("torquers always on", "check", what, move)
    if torquers.time_constant_s:
        size = f"{torquers.time_constant_s:.3g} ± {torquers.time_constant_sd_s:.1g} s"
        what = f"the field follows the torquers with a time constant of {size}, which is taken "
        yield Finding("torquers followed", "note", f"{what}into account")
    if torquers.settling:
        what = (
            f"for {figure(torquers.settling_s)} s after a torquer switches the readings are off "
            f"by more than later; {settling} % were left out"
        )
        yield Finding("torquers settling", "note", what)
