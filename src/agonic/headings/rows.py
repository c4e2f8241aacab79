"""What the rows of a log say, each by itself: tilt, indications, and the compass to trust."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.calibration.setup import Compass, Setup
from agonic.headings.attitude import Attitude
from agonic.headings.compass_heading import Indication, Readings, compute_indication
from agonic.headings.dip_residuals import refine_tilt_sd
from agonic.headings.disagreement import choose_compass, compare_with_expected
from agonic.headings.disturbance import add_disturbance, bridge_disturbed
from agonic.headings.expected_field import Surroundings
from agonic.headings.tilt_source import find_attitude
from agonic.samples import Samples


class CompassRows(NamedTuple):
    """A compass, its readings, what it indicates, and how far that is from what is expected."""

    compass: Compass
    readings: Readings
    indicated: Indication
    distance: Array | None


class RowHeadings(NamedTuple):
    """The tilt, what each compass says, and the one that each row (n,) is taken from."""

    tilt: Attitude
    compasses: tuple[CompassRows, ...]
    used: Index
    notes: tuple[str, ...]


def find_row_headings(
    first: Samples,
    seen: Sequence[tuple[Compass, Readings]],
    setup: Setup,
    around: Surroundings,
) -> RowHeadings:
    """Each row by itself; the samples of the first compass tell the tilt."""
    tilt = find_attitude(first, setup, seen[0][0].calibration)
    tilt = refine_tilt_sd(tilt, list(seen), around, setup, first.time)
    notes: list[str] = []
    compasses, own = [], []
    for compass, readings in seen:
        found, unknown = compute_indication(readings, compass, tilt, around)
        verdict = compare_with_expected(compass, found, around, setup, tilt.source)
        notes += [*unknown, *verdict.notes]
        own.append(verdict.distance)
        found, distance = add_disturbance(
            found,
            verdict.distance,
            readings,
            compass.calibration,
            tilt,
            around,
            setup.magnitude_limit,
            first.time,
        )
        distance = bridge_disturbed(distance, first.time)
        compasses.append(CompassRows(compass, readings, found, distance))
    # the row's own distance chooses, as in a vehicle, which knows no later rows
    used = choose_compass(own, [one.readings.missing for one in compasses], len(first))
    return RowHeadings(tilt, tuple(compasses), np.asarray(used), tuple(notes))
