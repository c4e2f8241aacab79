"""From samples to what the estimator takes: points of about one about their centre, magnitudes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.affine import Affine
from agonic.ellipsoid.calibration import Scale
from agonic.ellipsoid.evidence import rows_of
from agonic.ellipsoid.settings import Fixed, Settings
from agonic.errors import AgonicError, CoverageError
from agonic.health import FEWEST, find_rounding, find_usable_rows
from agonic.maths.equation.channels import Problem
from agonic.reference import Reference
from agonic.samples import Samples


class Posed(NamedTuple):
    """Which rows are usable (n,), their scale, points (k, 3) and magnitudes, (1,) or (k,), and what
    rounding scatters a point."""

    usable: Mask
    scale: Scale
    points: Array
    magnitude: Array
    rounding: float

    def problem(self, model: Fixed, soft_iron_sd: float | None) -> Problem:
        """The problem of one model."""
        return Problem(self.points, self.magnitude, model, soft_iron_sd, rounding=self.rounding)

    @property
    def origin(self) -> Array:
        """What is to be added to points (3,) for readings from zero, over the same size."""
        return np.asarray(self.scale.centre / self.scale.size)

    def robust(self, settings: Settings) -> bool:
        """Whether outliers are down-weighted: there are enough readings to tell one from the
        rest."""
        return settings.robust and len(self.points) >= 2 * FEWEST


def pose(samples: Samples, reference: Reference | None, method: str) -> Posed:
    """What samples and reference ask of the estimator."""
    usable = find_usable_rows(samples.field)
    scale, magnitude = normalise(samples, reference, usable, method)
    points = (samples.field[rows_of(usable)] - scale.centre) / scale.size
    return Posed(usable, scale, points, magnitude, find_rounding(samples.field) / scale.size)


def normalise_start(near: Affine, scale: Scale) -> tuple[Array, Array]:
    """Bias and matrix of a calibration for readings of size one about their centre."""
    assert near.magnitude is not None
    return (near.bias - scale.centre) / scale.size, near.matrix * (scale.size / near.magnitude)


def normalise(
    samples: Samples, reference: Reference | None, usable: Mask, method: str
) -> tuple[Scale, Array]:
    """Centre and size of the readings, and magnitudes scaled to mean one, (1,) or (n,)."""
    readings = samples.field[rows_of(usable)]
    centre = np.ones(len(readings)) @ readings / len(readings)
    size = float(np.linalg.norm(readings - centre) / np.sqrt(len(readings)))
    if size <= 1e-9 * float(np.linalg.norm(centre)):
        raise CoverageError(
            "there is one usable reading only"
            if len(readings) == 1
            else "the readings never change: the sensor did not turn, or it is stuck",
            turns="turn it about all three axes while recording",
        )
    if reference is None:
        return Scale(centre, size, None), np.ones(1)
    magnitudes = reference.magnitudes(len(samples))
    if len(magnitudes) > 1:
        if method != "likelihood":
            raise AgonicError(
                f"method {method!r} needs a constant magnitude; use method='likelihood'"
            )
        magnitudes = magnitudes[usable]
    mean = float(magnitudes.mean())
    return Scale(centre, size, mean, reference.sd), magnitudes / mean
