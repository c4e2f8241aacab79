"""What the field should have been: from the command line, or from the log's own place and date."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from agonic.errors import AgonicError

if TYPE_CHECKING:
    from agonic.reference import Reference
    from agonic.samples import Samples


def expected(
    samples: Samples, at: str | None, date: str | None, magnitude: float | None
) -> tuple[Reference | None, dict[str, Any]]:
    """The reference for a sensor and the fit settings that go with the place."""
    from agonic.field.place import choose_reference

    where = position(at) if at and magnitude is None else None
    return choose_reference(samples, where, date, magnitude)


def scalar_reference(samples: Samples, wanted: bool | None) -> Reference | None:
    """The scalar instrument beside the sensor as reference, where there is one and it may teach.

    `wanted` true requires it, false leaves it aside, `None` takes it where the log has it.
    """
    from agonic.reference import Reference

    if wanted is False or (wanted is None and samples.scalar is None):
        return None
    if samples.scalar is None:
        raise AgonicError("--scalar: the log holds no scalar instrument (column scalar_nT)")
    return Reference.magnitude(samples.scalar, source="the scalar instrument in the log")


def position(text: str) -> tuple[float, float, float]:
    """Latitude, longitude (degrees) and altitude (metres) of "LAT,LON[,ALT]".

    >>> position("-33.5, 151.2")
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
