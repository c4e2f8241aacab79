"""The standard twelve stations as `Station`s, and the turns between stations in words."""

from __future__ import annotations

from functools import cache

from scipy.spatial.transform import Rotation

from agonic.thermal.campaign.description import Station
from agonic.thermal.maths import stations as kernel


@cache
def standard_stations() -> tuple[Station, ...]:
    """The twelve stations of `thermal.maths.stations`, numbered in the order of least handling.

    >>> [station.pose for station in standard_stations()[:2]]
    ['top up, front to the back', 'top up, front to the right']
    """
    return tuple(
        Station(number=number, pose=kernel.pose(turned), rot_nb=Rotation.from_matrix(turned))
        for number, turned in enumerate(kernel.twelve(), start=1)
    )


def turn_words(before: Rotation | None, after: Rotation | None) -> str:
    """What to do with the box between two stations.

    >>> one, two = (station.rot_nb for station in standard_stations()[:2])
    >>> turn_words(one, two)
    'turn it 90° to the right (clockwise seen from above)'
    """
    if before is None or after is None:
        return "set it as described"
    return kernel.turn(before.as_matrix(), after.as_matrix())
