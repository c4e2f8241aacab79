"""The standard twelve stations as `Station`s, and the turns between stations in words."""

from __future__ import annotations

from functools import cache

from scipy.spatial.transform import Rotation

from agonic.thermal.campaign.description import Station
from agonic.thermal.maths import stations as kernel


@cache
def list_standard_stations() -> tuple[Station, ...]:
    """The twelve stations of `thermal.maths.stations`, numbered in the order of least handling.

    >>> [station.pose for station in list_standard_stations()[:2]]
    ['top up, front to the back', 'top up, front to the right']
    """
    return tuple(
        Station(
            number=number, pose=kernel.describe_pose(turned), rot_nb=Rotation.from_matrix(turned)
        )
        for number, turned in enumerate(kernel.list_standard_rotations(), start=1)
    )


def describe_turn(before: Rotation | None, after: Rotation | None) -> str:
    """What to do with the box between two stations.

    >>> one, two = (station.rot_nb for station in list_standard_stations()[:2])
    >>> describe_turn(one, two)
    'turn it 90° to the right (clockwise seen from above)'
    """
    if before is None or after is None:
        return "set it as described"
    return kernel.describe_turn(before.as_matrix(), after.as_matrix())
