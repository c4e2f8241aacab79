"""The standard twelve stations as `Station`s."""

from __future__ import annotations

from functools import cache

from scipy.spatial.transform import Rotation

from agonic.thermal.campaign.description import Station
from agonic.thermal.maths.stations import describe_pose, list_standard_rotations


@cache
def list_standard_stations() -> tuple[Station, ...]:
    """The twelve stations of `thermal.maths.stations`, numbered in the order of least handling.

    >>> [station.pose for station in list_standard_stations()[:2]]
    ['top up, front to the back', 'top up, front to the right']
    """
    return tuple(
        Station(number=number, pose=describe_pose(turned), rot_nb=Rotation.from_matrix(turned))
        for number, turned in enumerate(list_standard_rotations(), start=1)
    )
