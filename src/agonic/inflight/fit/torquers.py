"""Magnetic torquers in flight: readings while they are on, and while they settle."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.sources import list_columns
from agonic.health import FEWEST, Finding, figure
from agonic.samples import Samples

DIPOLE = "_Am2"
"""How the names of columns end that hold the dipole that a torquer is told to make."""
LONGEST = 60
"""Readings after a switch within which torquers may settle."""
SURELY = 4.0
"""Standard errors by which squares of residuals must be larger after a switch."""


@dataclass(frozen=True, kw_only=True)
class Torquers:
    """What was left out for torquers: rows in which `unmodelled` ones were on, and rows within
    `settling_s` of a switch of any of `commands`."""

    commands: tuple[str, ...] = ()
    unmodelled: tuple[str, ...] = ()
    on: int = 0
    settling_s: float = 0.0
    settling: int = 0
    rows: int = field(default=1)


def find_commands(samples: Samples) -> tuple[str, ...]:
    """The columns that hold the dipole of a torquer, where it changes.

    >>> dipoles = {"torquer_x_Am2": [0.0, 0.2], "torquer_y_Am2": [0.0, 0.0]}
    >>> find_commands(Samples(field=np.ones((2, 3)), disturbers=dipoles))
    ('torquer_x_Am2',)
    """
    return tuple(
        name
        for name, values in samples.disturbers.items()
        if name.endswith(DIPOLE) and float(np.ptp(values)) > 0
    )


def leave_out_unmodelled(
    samples: Samples, sources: tuple[str, ...], used: Mask
) -> tuple[Mask, Torquers]:
    """The rows to use, and what was left out: readings while a torquer is on that no source takes
    into account. Where next to nothing would remain all are kept."""
    commands = find_commands(samples)
    taken = list_columns(sources)
    unmodelled = tuple(name for name in commands if name not in taken)
    on = np.zeros(len(samples), dtype=bool)
    for name in unmodelled:
        on |= samples.disturbers[name] != 0
    if (used & ~on).sum() < FEWEST:
        on[:] = False
    found = Torquers(
        commands=commands,
        unmodelled=unmodelled,
        on=int((used & on).sum()),
        rows=max(int(used.sum()), 1),
    )
    return used & ~on, found


def measure_since_switch(samples: Samples, commands: tuple[str, ...]) -> Array:
    """Seconds since any of the commands changed last, (n,); infinite before the first change.

    >>> pulse = Samples(field=np.ones((4, 3)), time=np.arange(4.0),
    ...                 disturbers={"torquer_x_Am2": [0.0, 0.2, 0.2, 0.2]})
    >>> measure_since_switch(pulse, ("torquer_x_Am2",)).tolist()
    [inf, 0.0, 1.0, 2.0]
    """
    assert samples.time is not None
    if not commands:
        return np.full(len(samples), np.inf)
    values = np.stack([samples.disturbers[name] for name in commands], axis=1)
    changed = np.r_[False, (np.diff(values, axis=0) != 0).any(axis=1)]
    at = np.maximum.accumulate(np.where(changed, np.arange(len(samples)), -1))
    return np.where(at < 0, np.inf, samples.time - samples.time[at])


def find_settling_s(since: Array, residuals: Array, step_s: float) -> float:
    """How long after a switch residuals are larger than later, s; 0 where they are not.

    Squares in the first, second, … reading after a switch are compared with those of readings
    longer after one, whose own scatter says what chance does.

    >>> rng = np.random.default_rng(1)
    >>> since = np.tile(np.arange(50.0), 40)
    >>> find_settling_s(since, rng.normal(size=2000) * np.where(since < 3, 5.0, 1.0), 1.0)
    3.0
    """
    number = np.floor(since / step_s + 0.5)
    late = residuals[number >= min(LONGEST, _half(number))]
    if len(late) < FEWEST:
        return 0.0
    squares = np.minimum(np.square(late), np.square(10 * np.median(np.abs(late))))
    usual, spread = float(squares.mean()), float(squares.std())
    last = -1
    for k in range(LONGEST):
        own = np.square(residuals[number == k])
        if len(own) < 8 or own.mean() - usual < SURELY * spread / np.sqrt(len(own)):
            break
        last = k
    return (last + 1) * step_s


def _half(number: Array) -> float:
    """The middle of the readings after switches, counted from the switch."""
    counted = number[np.isfinite(number)]
    return float(np.median(counted)) if len(counted) else 0.0


def list_torquer_findings(torquers: Torquers) -> list[Finding]:
    """What was left out for torquers, and how to use it."""
    findings = []
    names = ",".join(torquers.unmodelled)
    if torquers.on:
        share = figure(100 * torquers.on / torquers.rows)
        findings.append(
            Finding(
                "torquers on",
                "note",
                f"a torquer is on in {share} % of the readings, which were left out",
                f"take them into the fit: --with {names}",
            )
        )
    elif torquers.unmodelled:
        findings.append(
            Finding(
                "torquers always on",
                "check",
                "torquers are on in nearly all readings, and what they add was not taken out",
                f"take them into the fit: --with {names}",
            )
        )
    if torquers.settling:
        share = figure(100 * torquers.settling / torquers.rows)
        findings.append(
            Finding(
                "torquers settling",
                "note",
                f"for {figure(torquers.settling_s)} s after a torquer switches the readings are "
                f"off by more than later; {share} % were left out",
            )
        )
    return findings
