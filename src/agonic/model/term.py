"""`Term`: one thing that a reading may contain beside matrix⁻¹ field + bias, and how it is seen.

    raw_i = matrix⁻¹ field_i + bias + Σ_terms E_i u + noise_i,   u ~ N(0, τ²)

E_i is the error of one reading for unknowns u of size one, in units of the field's magnitude over
the gain (the radius of the readings); τ is estimated, under a half-Cauchy prior of the scale that
nature gives (A. Gelman 2006, Bayesian Analysis 1, 515).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index


class Seen(NamedTuple):
    """What a term may depend on, of n rows: `x` (n, 3) readings without their noise from raw zero,
    over the radius, `unit` (n, 3) directions of the field in the axes of the calibrated field,
    `time` (n,) from 0 to 1, `rows` (n,) their numbers in the log, which has `total`.
    `blur` is the noise of a reading over the radius that has no memory, which its x does not have;
    none at rest.
    `reach` is the largest component of x of the log, `length` its largest length: they stay those
    of the log where a term is asked for other readings."""

    x: Array
    unit: Array
    time: Array
    rows: Index
    blur: float
    reach: float
    length: float
    total: int


class Errors(NamedTuple):
    """Errors of the readings: `parts` (b, 3, n), of which every axis has an unknown of its own
    where they are `apart`, else the whole vector has one; (b, 1, n) where all axes have the same
    part, or what they do lies along a `way` (3, n).
    """

    parts: Array
    apart: bool = True
    way: Array | None = None

    @property
    def unknowns(self) -> int:
        """How many unknowns there are."""
        return len(self.parts) * (3 if self.apart else 1)

    def along(self, ways: Array, out: Array | None = None) -> Array:
        """What each unknown does along the vectors (3, n), (k, n); written to `out` if given."""
        out = np.empty((self.unknowns, ways.shape[1])) if out is None else out
        if self.apart:
            np.multiply(ways, self.parts, out=out.reshape(-1, *ways.shape))
        elif self.way is not None:
            np.multiply(np.sum(ways * self.way, axis=0), self.parts[:, 0], out=out)
        else:
            np.einsum("an,ban->bn", ways, self.parts, out=out)
        return out

    def mean_square(self, square: Array) -> float:
        """The mean square length of E u for E[u uᵀ] = square (k, k)."""
        b, axes, n = self.parts.shape
        if self.apart:
            every = square.reshape(b, 3, b, 3)
            by_axis = np.einsum("iaja->aij", every)
            parts = np.broadcast_to(self.parts, (b, 3, n)) if axes == 1 else self.parts
            return float(np.einsum("ian,aij,jan->", parts, by_axis, parts, optimize=True) / n)
        if self.way is not None:
            sizes = np.sum((square @ self.parts[:, 0]) * self.parts[:, 0], axis=0)
            return float(sizes @ np.sum(self.way**2, axis=0) / n)
        return float(np.einsum("ian,ij,jan->", self.parts, square, self.parts, optimize=True) / n)


@dataclass(frozen=True, kw_only=True)
class Term:
    """A row of the table of terms.

    `errors(seen)` gives E, or None where the rows cannot tell. `scale` is the half-Cauchy scale of
    τ over the field, with its `source`; τ is at most `most` times that: a calibration that leans on
    a larger error is none. `odds` how often such a term is there at all. `at_rest`: it errs a
    sensor that stays where it is, so also a heading; then `errors` is asked for level
    readings. `sideways`: it is only seen along the field and in part, and errs everywhere and along
    every axis by so many times that mean square.
    `moves`: it changes the readings of a sensor in time, so that a calibration is of its mean.
    `diluted`: its columns follow noisy rates, so its size comes out too small. `what` says it in
    words and `move` what helps. With `odds` of one it is there for certain, its size is `scale`. Of
    one that has a single unknown, a `quantum` is what an error of the whole field is in `unit`.
    """

    name: str
    errors: Callable[[Seen], Errors | None]
    scale: float
    source: str
    what: str
    move: str
    odds: float = 0.05
    most: float = 30.0
    at_rest: bool = False
    sideways: float = 0.0
    moves: bool = False
    diluted: bool = False
    quantum: float = 0.0
    unit: str = ""


def along_time(signals: Array) -> Errors:
    """A bias along any direction that goes with each of signals (b, n)."""
    return Errors(signals[:, None])
