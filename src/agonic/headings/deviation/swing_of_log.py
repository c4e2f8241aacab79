"""A swing out of a log: what a compass indicated in motion, and the heading it should have had."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from agonic.arrays import Array
from agonic.calibration.setup import Setup
from agonic.errors import LogError
from agonic.headings.compute import heading
from agonic.health.finding import figure
from agonic.samples import Samples


@dataclass(frozen=True, kw_only=True, eq=False)
class LoggedSwing:
    """What `fit_deviation` takes, out of a log, (n,) each, degrees; rows that can be trusted.

    `compass_deg` by the calibration alone, without a card; `true_deg` as logged;
    `declination_deg`; `heel` (n, 2) roll and pitch; `power_state` the current that was drawn, in
    words, and `current_A` its median, where it was logged; `estimated` where the logged heading is
    an autopilot's own.
    """

    compass_deg: Array
    true_deg: Array
    declination_deg: Array
    heel: Array
    power_state: str
    current_A: float | None
    estimated: bool


def find_swing(samples: Samples, setup: Setup) -> LoggedSwing:
    """The swing that a log with a heading of its own is.

    Parameters: samples with `heading_deg`; the setup's one compass, whose card is left out.
    Raises `LogError` where no heading was logged, and as `heading` does.
    """
    if samples.heading_deg is None:
        raise LogError(
            f"{samples.name}: the log holds no heading to compare with; record one (two antennas, "
            "a surveyed line), or note a swing by hand (agonic plan swing)"
        )
    bare = replace(setup, compasses=tuple(replace(c, deviation=None) for c in setup.compasses[:1]))
    found = heading(samples, bare, smooth=False)
    rows = found.trusted & samples.heading_known
    if not rows.any():
        raise LogError(f"{samples.name}: no heading of this log can be trusted (tilted, disturbed)")
    current = None if samples.current_A is None else samples.current_A[rows]
    return LoggedSwing(
        compass_deg=found.compass_deg[rows],
        true_deg=samples.heading_deg[rows],
        declination_deg=np.broadcast_to(found.declination_deg, len(samples))[rows],
        heel=np.stack([found.roll_deg, found.pitch_deg], axis=1)[rows],
        power_state="" if current is None else describe_current(current),
        current_A=None if current is None else float(figure(float(np.median(current)))),
        estimated=samples.heading_estimated,
    )


def describe_current(current: Array) -> str:
    """The state of power that a current tells, in words.

    >>> describe_current(np.array([11.0, 12.0, 12.0, 14.0]))
    'what draws 11 to 14 A switched on'
    """
    low, high = (figure(float(v)) for v in np.percentile(current, (5, 95)))
    return f"what draws {low} to {high} A switched on"
