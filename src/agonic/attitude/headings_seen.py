"""The headings and the tilt that a vehicle showed, and those that it would have to add."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.equation.coverage import find_level_down, make_level_axes
from agonic.maths.rotations.tilt import heading_by_vectors_deg

WIDEST_GAP_DEG = 60.0
LEAST_TILT_DEG = 10.0


class HeadingsSeen(NamedTuple):
    """What a vehicle showed: the sectors of 15° that its headings were in, and its tilt."""

    sectors: Index
    widest: int
    gap_deg: int
    tilt_deg: float


def find_headings_seen(field: Array, down: Array) -> HeadingsSeen:
    """The headings and the tilt of a vehicle, by field and down (n, 3) in a sensor's axes."""
    axes = make_level_axes(find_level_down(down)).T
    field, down = field @ axes, down @ axes
    heading = heading_by_vectors_deg(field, down)
    sectors = np.unique((heading // 15).astype(np.intp) % 24)
    gaps = np.diff(np.append(sectors, sectors[0] + 24)) - 1
    widest = int(np.argmax(gaps))
    tilt = float(np.degrees(np.arccos(np.clip(np.percentile(down[:, 2], 5), -1.0, 1.0))))
    return HeadingsSeen(sectors, widest, 15 * int(gaps[widest]), tilt)


def describe_turns(field: Array, down: Array) -> str:
    """The headings and the tilt that a vehicle would have to add.

    Parameters: field and down (n, 3) in body axes, of the readings that count.

    >>> level = np.tile([0.0, 0.0, 1.0], (2, 1))
    >>> describe_turns(np.array([[1.0, 0.0, 2.0], [0.0, -1.0, 2.0]]), level)
    'turn through all headings (seen: 0° to 105°), and bank and pitch by 20° or more on the way'
    """
    seen = find_headings_seen(field, down)
    said = []
    if seen.gap_deg > WIDEST_GAP_DEG:
        first = 15 * seen.sectors[(seen.widest + 1) % len(seen.sectors)]
        last = 15 * (seen.sectors[seen.widest] + 1)
        said.append(f"turn through all headings (seen: {first}° to {last % 360}°)")
    if seen.tilt_deg < LEAST_TILT_DEG:
        said.append("bank and pitch by 20° or more on the way")
    return ", and ".join(said)
