"""The text of an option as what it means."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from agonic.errors import AgonicError

if TYPE_CHECKING:
    from agonic.arrays import Array


def parse_names(text: str) -> tuple[str, ...]:
    """The names of a list with commas."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def parse_numbers(option: str, text: str, form: str) -> tuple[float, ...]:
    """The numbers of a list with commas, as many as its form has."""
    try:
        numbers = tuple(float(part.replace("−", "-")) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != form.count(",") + 1:
        raise AgonicError(f"{option} {text!r} is not {form}")
    return numbers


def parse_nodes(text: str) -> int | tuple[int, int]:
    """The nodes of a network's hidden layer, or of two."""
    counts = [part.strip() for part in text.split(",")]
    if not 1 <= len(counts) <= 2 or not all(count.isdecimal() for count in counts):
        raise AgonicError(
            f"--hidden {text!r} is not a number of nodes; give one layer as 3, or two as 5,3"
        )
    return int(counts[0]) if len(counts) == 1 else (int(counts[0]), int(counts[1]))


def parse_count(option: str, text: str, what: str, highest: int | None = None) -> int | str:
    """A whole number, or "auto"."""
    if text == "auto":
        return text
    if not text.isdecimal() or (highest is not None and int(text) > highest):
        numbers = "a whole number" if highest is None else f"0 to {highest}"
        raise AgonicError(f"{option} {text!r} is not {what}; give {numbers}, or auto")
    return int(text)


def parse_position(text: str) -> tuple[float, float, float]:
    """Latitude, longitude (degrees) and altitude (metres) of "LAT,LON[,ALT]"."""
    try:
        numbers = [float(part) for part in text.split(",")]
        latitude, longitude, altitude = (*numbers, 0.0)[:3]
    except ValueError:
        raise AgonicError(
            f"--at {text!r} is not LAT,LON or LAT,LON,ALT in degrees, metres"
        ) from None
    if len(numbers) > 3 or not (-90 <= latitude <= 90 and -180 <= longitude <= 360):
        raise AgonicError(f"--at {text!r} is not a place on Earth; give LAT,LON[,ALT]")
    return latitude, longitude, altitude


_WAYS = {
    "forward": (1, 0, 0),
    "backward": (-1, 0, 0),
    "right": (0, 1, 0),
    "left": (0, -1, 0),
    "down": (0, 0, 1),
    "up": (0, 0, -1),
}
"""Along the body's axes: forward, right, down."""


def parse_mounting(text: str) -> Array:
    """The rotation (3, 3) from the sensor's axes to the body's of "x up, y forward". Two axes are
    enough; a third has to agree."""
    import numpy as np

    along: dict[str, Array] = {}
    for part in text.replace(" points ", " ").split(","):
        match part.lower().split():
            case [("x" | "y" | "z") as axis, way] if way in _WAYS and axis not in along:
                along[axis] = np.array(_WAYS[way], dtype=np.float64)
            case _:
                raise _unclear(text)
    if len(along) < 2:
        raise _unclear(text)
    axes: Any = [along.get(axis) for axis in "xyz"]
    for k in range(3):
        if axes[k] is None:
            axes[k] = np.cross(axes[(k + 1) % 3], axes[(k + 2) % 3])
    turn = np.stack(axes, axis=1)
    if not np.array_equal(turn.T @ turn, np.eye(3)) or np.linalg.det(turn) < 0:
        raise AgonicError(
            f"--mounting {text!r} is not a mounting: two axes point the same way, or the three are "
            "left-handed; check where each axis points"
        )
    return turn + 0.0


def _unclear(text: str) -> AgonicError:
    return AgonicError(
        f"--mounting {text!r} is not understood; say where two axes of the sensor point in the "
        f'vehicle: "x up, y forward" ({", ".join(_WAYS)})'
    )
