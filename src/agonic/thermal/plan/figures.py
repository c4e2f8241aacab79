"""Drawings of a plan as SVG: how the box stands at a station, and the temperature over time."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.report.axes import Axis, fit_axis
from agonic.report.figure import Figure, figure
from agonic.report.marks import curve, span
from agonic.report.markup import Markup, element
from agonic.thermal.campaign.profile import Profile
from agonic.thermal.maths.stations import FACES

HALF = np.array([1.25, 0.85, 0.5])
"""Half the length (front), width (right side) and height (bottom) of the box."""
AZIMUTH_DEG, ELEVATION_DEG = 28.0, 30.0
"""The eye stands at the door, this far to the left and above: it sees what looks to the door, to
the left and up."""

_SCALE = 44.0
_BOX = (220.0, 184.0)
_CENTRE = (110.0, 76.0)
_FLOOR = 1.75
"""Half the side of the floor."""


def _find_view() -> Array:
    """Rows: right, down and away from the eye, in the chamber's axes (back, right, down)."""
    a, e = np.radians(AZIMUTH_DEG), np.radians(ELEVATION_DEG)
    away = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return np.stack([right, np.cross(away, right), away])


def draw_pose(rot_nb: Rotation, label: str) -> Markup:
    """The box as it stands, seen from the door of the chamber from above."""
    view = _find_view()
    turned = view @ rot_nb.as_matrix()
    low = float(np.abs(rot_nb.as_matrix()[2]) @ HALF)
    parts = [_draw_floor(view, low)]
    for normal, name in FACES.items():
        if (turned @ normal)[2] < -1e-9:
            side = name.removesuffix(" side")
            parts += _draw_face(side, np.array(normal, dtype=np.float64), turned)
    return element(
        "svg",
        *parts,
        class_="pose",
        viewBox=f"0 0 {_BOX[0]:g} {_BOX[1]:g}",
        role="img",
        aria_label=label,
    )


def _project(points: Array) -> Array:
    return np.asarray(points[..., :2] * _SCALE + _CENTRE)


def _draw_face(name: str, normal: Array, turned: Array) -> list[Markup]:
    """A visible face: its outline and its name, written along it."""
    axis = int(np.argmax(np.abs(normal)))
    others = [k for k in range(3) if k != axis]
    corners = np.tile(normal * HALF, (4, 1))
    for k, signs in zip(others, ((-1, 1, 1, -1), (-1, -1, 1, 1)), strict=True):
        corners[:, k] = np.array(signs) * HALF[k]
    seen = _project(corners @ turned.T)
    centre = _project(turned @ (normal * HALF))
    along = _find_writing(turned, others)
    matrix = " ".join(f"{value:.3f}" for value in (*along[0], *along[1], *centre))
    return [
        element("polygon", points=_format_points(seen), class_=f"face {name}"),
        element("text", name, transform=f"matrix({matrix})", class_="name", dy="0.35em"),
    ]


def _find_writing(turned: Array, others: list[int]) -> Array:
    """The two edges of a face along which its name reads: rightwards, and down."""
    edges = np.stack([turned[:2, k] for k in others])
    flat = int(np.argmax(np.abs(edges[:, 0])))
    across, down = edges[flat], edges[1 - flat]
    across = across * (1 if across[0] >= 0 else -1)
    down = down * (1 if across[0] * down[1] - across[1] * down[0] > 0 else -1)
    return np.stack([across, down])


def _draw_floor(view: Array, low: float) -> Markup:
    """The floor so far below the middle of the box, its edge at the door named."""
    ends = ((-_FLOOR, -_FLOOR), (_FLOOR, -_FLOOR), (_FLOOR, _FLOOR), (-_FLOOR, _FLOOR))
    seen = _project(np.array([[x, y, low] for x, y in ends]) @ view.T)
    middle = _project(view @ np.array([-_FLOOR, 0.0, low]))
    along = (view @ np.array([0.0, 1.0, 0.0]))[:2]
    across = (view @ np.array([-1.0, 0.0, 0.0]))[:2]
    matrix = " ".join(f"{value:.3f}" for value in (*along, *across, *middle))
    name = element("text", "door", transform=f"matrix({matrix})", class_="door", dy="-0.4em")
    return element("g", element("polygon", points=_format_points(seen), class_="floor"), name)


def _format_points(pixels: Array) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in pixels)


def draw_profile(profile: Profile) -> Figure:
    """The chamber's temperature over the time of a station, the recording marked."""
    heating, hold = (segment.duration_s / 3600 for segment in profile.before)
    time, level = profile.corners
    begun = heating + hold
    x = Axis("hours", 0.0, begun + float(time[-1]) / 3600)
    first = [profile.room_C, profile.highest_C, profile.highest_C]
    return figure(
        "Temperature of the chamber",
        x,
        fit_axis("°C", np.array([*first, *level])),
        span("recorded", begun, x.high, words="recorded"),
        curve("course before", [0.0, heating, begun], first),
        curve("course", begun + time / 3600, level),
    )
