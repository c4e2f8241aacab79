"""Gyro and accelerometer beside a compass: their axes, and whether they turn as it does."""

from __future__ import annotations

from agonic.arrays import Array
from agonic.calibration.base import Calibration, correct_field, has_two_axes
from agonic.calibration.setup import Setup
from agonic.errors import LogError
from agonic.headings.tilt_source import find_axes, find_mounting
from agonic.health.inertial_unit import check_clipping, find_faults
from agonic.new_rows import find_fresh
from agonic.samples import Samples

_COLUMNS = ("rotation_rate", "acceleration")


def find_rate_mounting(samples: Samples, setup: Setup, calibration: Calibration) -> Array:
    """The turn (3, 3) from the axes of the rates to those of the body."""
    if setup.accelerometer is not None and samples.acceleration is not None:
        return find_axes(setup.accelerometer)
    return find_mounting(calibration)


def mend_unit(
    samples: Samples, setup: Setup, calibration: Calibration, *, smooth: bool
) -> tuple[Samples, tuple[str, ...]]:
    """The samples without a gyro that does not turn as the calibrated field does, and without an
    accelerometer that does not turn as the gyro does or has another unit, and what to say of it;
    as they are where neither is used, for no tilt and not to `smooth` headings.

    Raises LogError where the tilt has to come from a sensor that is left out.
    """
    used = smooth or any(_needs(samples, setup, column) for column in _COLUMNS)
    if not used or samples.time is None or has_two_axes(calibration):
        return samples, ()
    turn = find_rate_mounting(samples, setup, calibration)
    there = {"rotation_rate": samples.rotation_rate}
    if setup.accelerometer is None:  # which knows its own unit and axes
        there["acceleration"] = samples.acceleration
    turned = {name: values @ turn.T for name, values in there.items() if values is not None}
    compass = Samples(time=samples.time, field=correct_field(calibration, samples))
    notes = _describe_limits(samples)
    for column, finding, mended in find_faults(compass.with_columns(**turned)):
        if mended is None and _needs(samples, setup, column):
            raise LogError(finding.sentence)
        samples = samples.with_columns(**{column: None if mended is None else mended @ turn})
        out = "; it was left out" if finding.severity == "refuse" else ""
        notes.append("; ".join(part for part in (finding.what + out, finding.move) if part))
    return samples, tuple(notes)


def _describe_limits(samples: Samples) -> list[str]:
    """What a gyro that clips, or is slower than the log, cannot have told."""
    rate = samples.rotation_rate
    if rate is None:
        return []
    clipped, fresh = check_clipping(samples), float(find_fresh(rate).mean())
    said = [] if clipped is None else [clipped.sentence]
    if fresh < 1.0:
        said.append(
            f"the gyro has a new reading in one of {1 / fresh:.0f} rows only: faster turns are "
            "not seen, and the tilt may be off by more than is stated"
        )
    return said


def _needs(samples: Samples, setup: Setup, column: str) -> bool:
    """Whether the tilt cannot be had without the gyro, or without the acceleration."""
    if column == "rotation_rate":
        return setup.tilt == "gyro"
    recorded = samples.roll_deg is not None and samples.pitch_deg is not None
    return setup.tilt in ("gyro", "accelerometer") or (setup.tilt == "auto" and not recorded)
