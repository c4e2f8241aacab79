"""What the field should have been: from the command line, or from the log's own place and date."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from agonic.errors import AgonicError

if TYPE_CHECKING:
    from pathlib import Path

    from agonic.reference import Reference
    from agonic.samples import Samples


def find_reference(
    samples: Samples,
    at: str | None,
    date: str | None,
    magnitude: float | None,
    model: str | None = None,
) -> tuple[Reference | None, dict[str, Any]]:
    """The reference for a sensor and the fit settings that go with the place."""
    from agonic.console.parse import parse_position
    from agonic.field.place import choose_reference

    where = parse_position(at) if at and magnitude is None else None
    return choose_reference(samples, where, date, magnitude, model)


def find_scalar_reference(samples: Samples, wanted: bool | None) -> Reference | None:
    """The scalar instrument beside the sensor as reference, where there is one and it may teach.

    `wanted` true requires it, false leaves it aside, `None` takes it where the log has it.
    """
    from agonic.reference import Reference

    if wanted is False or (wanted is None and samples.scalar is None):
        return None
    if samples.scalar is None:
        raise AgonicError("--scalar: the log holds no scalar instrument (column scalar_nT)")
    return Reference.magnitude(samples.scalar, source="the scalar instrument in the log")


def set_track(samples: Samples, altitude_m: float | None, elements: Path | None) -> Samples:
    """The samples with an altitude for all of them, or positions from two-line elements."""
    import numpy as np

    if altitude_m is not None and elements is not None:
        raise AgonicError(
            "give --altitude or --tle, not both: elements have altitudes of their own"
        )
    if altitude_m is not None:
        return samples.with_columns(altitude_m=np.full(len(samples), altitude_m))
    if elements is None:
        return samples
    from agonic.logs.space.tle import positions_from_tle

    if samples.time is None or samples.epoch is None:
        raise AgonicError(f"--tle {elements}: {samples.name} has no date; give --date")
    return samples.with_columns(**positions_from_tle(elements, samples.time, samples.epoch))
