"""The text of an option as what it means."""

from __future__ import annotations

from agonic.errors import AgonicError


def parse_names(text: str) -> tuple[str, ...]:
    """The names of a list with commas.

    >>> parse_names("current_A, second")
    ('current_A', 'second')
    """
    return tuple(name.strip() for name in text.split(",") if name.strip())


def parse_numbers(option: str, text: str, form: str) -> tuple[float, ...]:
    """The numbers of a list with commas, as many as its form has.

    >>> parse_numbers("--range", "−10, 50", "LOW,HIGH in °C")
    (-10.0, 50.0)
    """
    try:
        numbers = tuple(float(part.replace("−", "-")) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != form.count(",") + 1:
        raise AgonicError(f"{option} {text!r} is not {form}")
    return numbers


def parse_nodes(text: str) -> int | tuple[int, int]:
    """The nodes of a network's hidden layer, or of two.

    >>> parse_nodes("3"), parse_nodes("5,3")
    (3, (5, 3))
    """
    counts = [part.strip() for part in text.split(",")]
    if not 1 <= len(counts) <= 2 or not all(count.isdecimal() for count in counts):
        raise AgonicError(
            f"--hidden {text!r} is no number of nodes; give one layer as 3, or two as 5,3"
        )
    return int(counts[0]) if len(counts) == 1 else (int(counts[0]), int(counts[1]))


def parse_count(option: str, text: str, what: str, highest: int | None = None) -> int | str:
    """A whole number, or "auto".

    >>> parse_count("--degree", "3", "a degree", 9), parse_count("--degree", "auto", "a degree")
    (3, 'auto')
    """
    if text == "auto":
        return text
    if not text.isdecimal() or (highest is not None and int(text) > highest):
        numbers = "a whole number" if highest is None else f"0 to {highest}"
        raise AgonicError(f"{option} {text!r} is not {what}; give {numbers}, or auto")
    return int(text)


def parse_position(text: str) -> tuple[float, float, float]:
    """Latitude, longitude (degrees) and altitude (metres) of "LAT,LON[,ALT]".

    >>> parse_position("-33.5, 151.2")
    (-33.5, 151.2, 0.0)
    """
    try:
        numbers = [float(part) for part in text.split(",")]
        latitude, longitude, altitude = (*numbers, 0.0)[:3]
    except ValueError:
        raise AgonicError(
            f"--at {text!r} is not LAT,LON or LAT,LON,ALT in degrees, metres"
        ) from None
    if len(numbers) > 3 or not (-90 <= latitude <= 90 and -180 <= longitude <= 360):
        raise AgonicError(f"--at {text!r} is no place on Earth; give LAT,LON[,ALT]")
    return latitude, longitude, altitude
