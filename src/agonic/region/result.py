"""`FieldMap`: the field of a region with its uncertainty, and where to measure next."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array, Mask
from agonic.errors import ValidityError
from agonic.health import Finding
from agonic.health.finding import Judged
from agonic.readable import Shown
from agonic.region.maths.equivalent_sources import Process, Readings, predict


class FieldAt(NamedTuple):
    """Field and gradient at places (n), with how well they are known.

    `field` (n, 3), nT, has the `covariance` (n, 3, 3); `gradient` (n, 3, 3) is ∂field_i/∂x_k in
    nT/m, with `gradient_sd` of each.
    """

    field: Array
    covariance: Array
    gradient: Array
    gradient_sd: Array

    @property
    def sd(self) -> Array:
        """Standard errors (n, 3) of the field, nT."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2)))

    @property
    def magnitude(self) -> Array:
        """Strength (n,), nT."""
        return np.asarray(np.linalg.norm(self.field, axis=1))

    @property
    def magnitude_sd(self) -> Array:
        """Standard errors of the strength, nT."""
        unit = self.field / self.magnitude[:, None]
        return np.asarray(np.sqrt(np.einsum("ni,nij,nj->n", unit, self.covariance, unit)))

    @property
    def direction_sd_deg(self) -> Array:
        """Standard error of the direction, of both angles together, degrees."""
        total = np.trace(self.covariance, axis1=1, axis2=2) - self.magnitude_sd**2
        return np.asarray(np.degrees(np.sqrt(np.maximum(total, 0.0)) / self.magnitude))


@dataclass(frozen=True, kw_only=True, eq=False)
class FieldMap(Judged):
    """The map of a region: the field at any place in it, which has neither curl nor divergence.

    Parameters
    ----------
    name : of the region. readings : those it rests on. low, high : corners (3,) of their box, m.
    noise : of a reading on an axis, nT, with noise_sd. distance : of the sources from the box, m.
    left_out : readings (n,) that contradict all others, in the order that was given.
    next_places : where to measure next (k, 3), m, one after the other.
    surprise : the mean square of what readings left out differ by, over its variance; 1 where
        what is stated of errors is right.
    """

    name: str
    readings: Readings
    processes: tuple[Process, ...]
    weights: Array
    low: Annotated[Array, Shown(key="low_m")]
    high: Annotated[Array, Shown(key="high_m")]
    noise: Annotated[float, Shown(key="noise_nT", sd="noise_sd", unit="nT of a reading on an axis")]
    noise_sd: Annotated[float, Shown(key="noise_sd_nT")]
    distance: Annotated[float, Shown(key="source_distance_m")]
    left_out: Mask
    next_places: Annotated[Array, Shown(key="next_m")]
    surprise: float
    findings: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = ()

    def at(self, places: ArrayLike) -> FieldAt:
        """Field and gradient at places, averaged over the distances of sources that are likely.

        Parameters: places (n, 3), m, in the axes of the region. Raises `ValidityError` for places
        more than half the sources' distance outside of the box of the readings: what stands there
        is not known.

        >>> grid = np.stack(np.meshgrid(*[np.linspace(0, 2, 4)] * 3), axis=-1).reshape(-1, 3)
        >>> from agonic.region.fit import fit_map
        >>> made = fit_map(grid, [18e3, 0, 44e3] + 100 * grid @ np.diag([1, 1, -2]), noise=1.0)
        >>> here = made.at([[1.0, 1.0, 1.0]])
        >>> here.field.round(-1).tolist(), here.gradient[0].diagonal().round(-1).tolist()
        ([[18100.0, 100.0, 43800.0]], [100.0, 100.0, -200.0])
        """
        at = np.atleast_2d(np.asarray(places, dtype=np.float64))
        reach = self.distance / 2
        beyond = ((at < self.low - reach) | (at > self.high + reach)).any(axis=1)
        if beyond.any():
            raise ValidityError(
                f"{beyond.sum()} of {len(at)} places lie more than {reach:.2g} m outside of the "
                f"readings ({_write(self.low)} to {_write(self.high)} m); measure there first",
                mask=beyond,
            )
        parts = np.array_split(at, -(-len(at) // 200))  # so that memory stays small
        made = [self._average(part) for part in parts]
        mean, covariance = (np.concatenate(one) for one in zip(*made, strict=True))
        gradient_sd = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)[:, 3:])
        by_axes = (-1, 3, 3)
        return FieldAt(
            mean[:, :3],
            covariance[:, :3, :3],
            mean[:, 3:].reshape(by_axes),
            gradient_sd.reshape(by_axes),
        )

    def _average(self, at: Array) -> tuple[Array, Array]:
        """Mean (n, 12) and covariance over the processes, with what they differ by."""
        told = zip(*(predict(one, at) for one in self.processes), strict=True)
        means, spreads = (np.stack(one) for one in told)
        mean = np.tensordot(self.weights, means, 1)
        apart = (means - mean)[..., None]
        return mean, np.tensordot(self.weights, spreads + apart * apart.swapaxes(-1, -2), 1)


def _write(corner: Array) -> str:
    return "(" + ", ".join(f"{v:.2f}" for v in corner) + ")"
