"""A swing out of a log: what a compass indicated in motion, and the heading it should have had."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.arrays import Array
from agonic.calibration.setup import Setup
from agonic.errors import LogError
from agonic.headings.compute import heading
from agonic.headings.files.swing import Swing
from agonic.health.finding import figure
from agonic.samples import Samples


def find_swing(samples: Samples, setup: Setup) -> Swing:
    """The swing that a log with a heading of its own is, of the rows that can be trusted: what the
    calibration alone makes of the setup's one compass, and the logged heading from magnetic north.
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
    remarks = {"compass": samples.name}
    if samples.current_A is not None:
        current = samples.current_A[rows]
        remarks["power_state"] = describe_current(current)
        remarks["current_A"] = repr(float(figure(float(np.median(current)))))
    declination = np.broadcast_to(found.declination_deg, len(samples))
    return Swing(
        compass_deg=found.compass_deg[rows],
        reference_deg=(samples.heading_deg - declination)[rows],
        reference="magnetic",
        roll_deg=found.roll_deg[rows],
        pitch_deg=found.pitch_deg[rows],
        estimated=samples.heading_estimated,
        remarks=remarks,
        source=samples.origin,
    )


def describe_current(current: Array) -> str:
    """The state of power that a current tells, in words."""
    low, high = (figure(float(v)) for v in np.percentile(current, (5, 95)))
    return f"what draws {low} to {high} A switched on"
