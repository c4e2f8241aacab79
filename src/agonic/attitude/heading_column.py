"""Whether the heading of a log is what it should be: true, clockwise from north, in degrees; and
whether the azimuth of the field agrees with it, or with what a gyro tells."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.coverage import OPEN_DEG
from agonic.fit import Channel
from agonic.health import Finding, figure
from agonic.maths.rotations.angles import wrap_deg

HEADING_DOUBTFUL_DEG = 5.0
HEADING_REFUSED_DEG = 20.0


def check_azimuth(
    channels: Mapping[str, Channel], radius: float, inclination_deg: float, *, felt: bool = False
) -> Finding | None:
    """The finding that the azimuth of the calibrated field scatters by too much.

    Parameters: the size of the field in the unit of the readings, and its dip; `felt` where a gyro
    tells the azimuth and not a known heading.
    """
    if "azimuth" not in channels:
        return None
    level = max(radius * np.cos(np.radians(inclination_deg)), 1e-9)
    off = float(np.degrees(channels["azimuth"].noise / level))
    if off <= HEADING_DOUBTFUL_DEG:
        return None
    if felt:
        beside = "the azimuth by the gyro: its unit, axes, sign or clock are wrong"
        move = "check unit, axes and times of the gyro"
    else:
        beside = "that of the known heading: it is wrong, late, or in radians"
        move = "check the heading, its unit and its zero, or fit without it (levelled)"
    spread = f"by {figure(off)}°" if off < OPEN_DEG else "over the whole circle"
    return Finding(
        "heading",
        "refuse" if off > HEADING_REFUSED_DEG else "check",
        f"the field's azimuth scatters {spread} about {beside}",
        move,
    )


OFFSET_DOUBTFUL_DEG = 5.0
"""No sensor is misaligned about the vertical by more, unless somebody meant it to."""
MAGNETIC_WITHIN_DEG = 2.0
"""A heading that is off by the declination to this is magnetic, where the declination is larger."""
FOLLOWS = 0.9
"""Length of the mean direction of the differences: those of 26° (one standard deviation)."""
CLEARER = 0.05
"""By so much more must another reading of the column follow the field."""


class Relation(NamedTuple):
    """How a column follows the heading by the field: heading = sign · unit · column + offset.

    `follows` is the length of the mean direction of the differences, 1 where they are all alike.
    """

    radians: bool
    sign: int
    offset_deg: float
    follows: float


def find_relation(by_field_deg: Array, logged_deg: Array) -> Relation:
    """The way in which a logged heading (n,) follows that by the field (n,), degrees.

    >>> heading = np.arange(0.0, 360.0, 10.0)
    >>> relation = find_relation(heading, (90.0 - heading) % 360.0)
    >>> relation.sign, round(relation.offset_deg), round(relation.follows, 3)
    (-1, 90, 1.0)
    """
    units = (False, True) if np.abs(logged_deg).max() <= 2 * np.pi + 0.01 else (False,)
    tried = []
    for radians in units:
        column = np.degrees(logged_deg) if radians else logged_deg
        for sign in (1, -1):
            mean = np.exp(1j * np.radians(by_field_deg - sign * column)).mean()
            offset = float(np.degrees(np.angle(mean)))
            tried.append(Relation(radians, sign, offset, float(np.abs(mean))))
    best = max(tried, key=lambda relation: relation.follows)
    return best if best.follows > tried[0].follows + CLEARER else tried[0]


def check_heading_column(
    by_field_deg: Array, logged_deg: Array, declination_deg: float
) -> Finding | None:
    """The finding that the logged heading (n,) is not the true one, with what it looks like.

    Parameters: `by_field_deg` (n,) the true heading by the field in the sensor's own axes.
    """
    relation = find_relation(by_field_deg, logged_deg)
    if relation.follows < FOLLOWS:
        return None  # its scatter is told, and nothing that it looks like
    looks = describe_relation(relation, declination_deg)
    if not looks:
        return None
    turned = relation.sign > 0 and not relation.radians  # as of a sensor that sits turned
    return Finding(
        "mounting" if turned else "heading",
        "check" if looks.startswith("off by") else "refuse",
        f"the logged heading is not the true heading by the field: it looks {looks}",
        "give the true heading in degrees, clockwise from north, or leave the column out",
    )


def describe_relation(relation: Relation, declination_deg: float) -> str:
    """What a heading column looks like; nothing for one that is as it should be.

    >>> describe_relation(Relation(False, 1, 0.4, 1.0), 3.0)
    ''
    >>> describe_relation(Relation(False, 1, -11.8, 1.0), -12.0)
    'magnetic: it is off by the declination of -12°'
    """
    said, offset = [], relation.offset_deg
    if relation.radians:
        said.append("in radians")
    if relation.sign < 0:
        said.append("negated, counted anticlockwise")
    quarter = round(offset / 90.0) % 4
    near = abs(float(wrap_deg(offset - 90.0 * quarter))) < 15.0
    if near and quarter:
        origin = ("", "east", "south", "west")[quarter]
        said.append(f"counted from {origin}" + (" (off by 180°)" if quarter == 2 else ""))
    elif abs(declination_deg) > MAGNETIC_WITHIN_DEG + 1 and (
        abs(float(wrap_deg(offset - declination_deg))) < MAGNETIC_WITHIN_DEG
    ):
        said.append(f"magnetic: it is off by the declination of {declination_deg:.0f}°")
    elif abs(offset) > OFFSET_DOUBTFUL_DEG:
        said.append(
            f"off by {figure(offset)}° throughout (magnetic, another zero, or the sensor sits "
            "turned about the vertical)"
        )
    return ", ".join(said)
