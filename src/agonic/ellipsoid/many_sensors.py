"""`fit_many`: the adjusted fits of many sensors at once, from 35 numbers of each."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agonic.arrays import Array, Index, Mask
from agonic.ellipsoid.moments_fit import STILL, middle, still
from agonic.ellipsoid.settings import Fixed, Gauge, Model
from agonic.ellipsoid.solve import (
    DISCERNIBLE,
    no_ellipsoid,
    too_few,
)
from agonic.errors import AgonicError, CoverageError, check_choice
from agonic.fit import UNKNOWNS
from agonic.health import MIN_READINGS
from agonic.maths.equation import gauge as gauges
from agonic.maths.equation import moments as kernel
from agonic.maths.equation import quadric
from agonic.maths.equation.affine import model_basis
from agonic.maths.equation.coverage import heading_sd_deg
from agonic.moments import Moments
from agonic.reference import Reference

_SLAB = 2048
"""Sensors at a time: their matrices stay in the cache, and memory is bounded."""
_CENTRED = 0.01
"""Moments whose mean is this near to their centre, over their scale, need not be moved."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Fits:
    """The fits of n sensors, column by column; NaN where `refusal` says why there is none.

    `bias` (n, 3), `matrix` (n, 3, 3), `covariance` (n, 9, 9) as of `Affine`; `model` (n,) the
    word; `magnitude`, `noise`, `condition`, `heading_sd_deg` (n,) as of `Fit`; `p_values` (n, 2)
    of the nested tests, sphere and diagonal within full (NaN where none was made), and
    `discerned` (n,) whether soft iron could have been seen; `spread` (n,) the relative standard
    deviation of the calibrated magnitude; `refusal` (n,) a sentence, or "".
    """

    bias: Array
    matrix: Array
    covariance: Array
    model: NDArray[Any]
    magnitude: Array
    noise: Array
    condition: Array
    heading_sd_deg: Array
    p_values: Array
    discerned: Mask
    spread: Array
    refusal: NDArray[Any]

    def __len__(self) -> int:
        return len(self.noise)

    @property
    def fitted(self) -> Mask:
        """Which sensors have a fit, (n,)."""
        return np.asarray(self.refusal == "", dtype=bool)

    @property
    def sd(self) -> Array:
        """Standard errors of bias x y z, then matrix xx yy zz xy xz yz, (n, 9)."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1)))

    @classmethod
    def empty(cls, n: int) -> Fits:
        """n sensors without a fit yet."""
        texts = {"model": "<U8", "refusal": object}
        shapes = {"bias": (3,), "matrix": (3, 3), "covariance": (9, 9), "p_values": (2,)}
        made: dict[str, Any] = {"discerned": np.zeros(n, dtype=bool)}
        for field in fields(cls):
            if field.name in texts:
                made[field.name] = np.full(n, "", dtype=texts[field.name])
            elif field.name not in made:
                made[field.name] = np.full((n, *shapes.get(field.name, ())), np.nan)
        return cls(**made)


def fit_many(
    sums: ArrayLike,
    centre: ArrayLike,
    scale: ArrayLike,
    reference: Reference | None = None,
    *,
    model: Model = "auto",
    gauge: Gauge = "symmetric",
    inclination_deg: float = 60.0,
    threads: int = 1,
    progress: Callable[[int], None] | None = None,
) -> Fits:
    """What `fit_moments` finds for each of many sensors, all of them at once.

    Parameters
    ----------
    sums : (n, 35) of each sensor as of `Moments`, about `centre` (n, 3) over `scale` (n,).
    reference : one constant magnitude for all; without one each mean gain is set to 1.
    model, gauge, inclination_deg : as in `fit_ellipsoid`.
    threads : how many share the work.
    progress : told how many sensors more are done.

    Returns `Fits`. Raises `AgonicError` for a reference that is not constant.

    Source: adjusted least squares (Markovsky, Kukush & Van Huffel 2004)."""
    check_choice("model", model, get_args(Model))
    check_choice("gauge", gauge, get_args(Gauge))
    if reference is not None and len(reference.values) > 1:
        raise AgonicError("moments hold no rows, so they need one constant reference magnitude")
    of, at, over = (np.asarray(part, dtype=np.float64) for part in (sums, centre, scale))
    found = Fits.empty(len(of))

    def slab(rows: slice) -> int:
        normalised, units = _normalise(of[rows], at[rows], over[rows], reference, found, rows)
        _fit(normalised, units, model, gauge, inclination_deg, found, rows)
        return len(normalised)

    slabs = [slice(k, k + _SLAB) for k in range(0, len(found), _SLAB)]
    with ThreadPoolExecutor(threads) as pool:
        for done in pool.map(slab, slabs):
            if progress is not None:
                progress(done)
    return found


def _normalise(
    sums: Array, centre: Array, scale: Array, reference: Reference | None, found: Fits, rows: slice
) -> tuple[Array, gauges.Units]:
    """Moments about the middle of each sensor's readings, and the way back."""
    sums, centre, scale = sums.copy(), centre.copy(), scale.copy()
    refusal = found.refusal[rows]
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = sums[:, _LINEAR] / sums[:, :1]
        spread = np.sqrt(sums[:, _SQUARES].sum(axis=1) / sums[:, 0] - (mean**2).sum(axis=1))
    near = (np.abs(mean).max(axis=1) < _CENTRED) & (np.abs(spread - 1) < _CENTRED)
    for k in np.flatnonzero(~near & (sums[:, 0] >= 1)):
        one = Moments(centre=centre[k].copy(), scale=float(scale[k]), sums=sums[k])
        try:
            centre[k], scale[k] = middle(one)
        except CoverageError:
            refusal[k] = str(still())
        else:
            sums[k] = one.rebase(centre[k], float(scale[k])).sums
    refusal[near & ~(scale > STILL * np.linalg.norm(centre, axis=1))] = str(still())
    known = None if reference is None else float(reference.magnitudes(1)[0])
    return sums, gauges.Units(centre, scale, known, reference.sd if reference else 0.0)


_AT = {exponents: k for k, exponents in enumerate(kernel.EXPONENTS)}
_LINEAR = [_AT[e] for e in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
_SQUARES = [_AT[e] for e in ((2, 0, 0), (0, 2, 0), (0, 0, 2))]


def _fit(
    sums: Array,
    units: gauges.Units,
    model: Model,
    gauge: Gauge,
    inclination_deg: float,
    found: Fits,
    rows: slice,
) -> None:
    """The fits of a slab, put into its rows of `found`."""
    part = Fits(**{field.name: getattr(found, field.name)[rows] for field in fields(Fits)})
    count = np.round(sums[:, 0]).astype(int)
    least = UNKNOWNS.get(model, UNKNOWNS["sphere"])
    for k in np.flatnonzero(count < least):
        part.refusal[k] = _fewer(int(count[k]), model)
    _choose_models(sums, count, model, part)
    here = np.flatnonzero(part.fitted)
    own = units._replace(centre=units.centre[here], size=units.size[here])
    bias, matrix, covariance, magnitude = gauges.convert_to_units(
        part.bias[here], part.matrix[here], part.covariance[here], own, gauge
    )
    part.bias[here], part.matrix[here], part.covariance[here] = bias, matrix, covariance
    part.magnitude[here] = magnitude
    part.noise[here] *= own.size
    part.heading_sd_deg[here] = heading_sd_deg(
        inclination_deg, part.magnitude[here], matrix, covariance, gauge
    )
    for column in (part.bias, part.matrix, part.covariance, part.noise, part.condition):
        column[~part.fitted] = np.nan


def _fewer(count: int, model: Model) -> str:
    """Why so few readings were not fitted, as `fit_moments` says it."""
    least = f"{count} readings do not determine a sphere; four are needed"
    return least if count < UNKNOWNS["sphere"] else str(too_few(count, model))


def _choose_models(sums: Array, count: NDArray[np.int_], model: Model, part: Fits) -> None:
    """The model asked for, or the full one with tests of those within; a sphere of few readings."""
    if model != "auto":
        _attempt(sums, np.flatnonzero(part.fitted), model, part)
        return
    _attempt(sums, np.flatnonzero(part.fitted & (count < MIN_READINGS)), "sphere", part)
    rows = np.flatnonzero(part.fitted & (count >= MIN_READINGS))
    _attempt(sums, rows, "full", part)
    rows = rows[part.fitted[rows]]
    matrix, covariance = part.matrix[rows], part.covariance[rows]
    worst = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1)[:, 3:].max(axis=1))
    tests = gauges.compare_soft_iron_models(matrix, covariance)
    part.discerned[rows] = worst < DISCERNIBLE * gauges.mean_gain(matrix)
    part.p_values[rows] = np.stack([p for *_, p in tests], axis=1)


def _attempt(sums: Array, rows: Index, model: Fixed, part: Fits) -> None:
    """One model's fit to these rows, in normalised coordinates."""
    if not len(rows):
        return
    psi = kernel.compute_denoised_gram(sums[rows])
    v, variance = quadric.fit_adjusted(psi, model)
    real = quadric.is_ellipsoid(v)
    part.refusal[rows[~real]] = str(no_ellipsoid())
    rows, v, variance = rows[real], v[real], np.maximum(variance[real], 1e-18)
    first, second, third = (of[real] for of in psi)
    bias, matrix = quadric.to_affine(v)
    at = variance[:, None, None]
    covariance, condition = quadric.algebraic_covariance(
        first - at * second + at**2 * third, bias, matrix, model_basis(model), variance
    )
    part.model[rows] = model
    part.bias[rows], part.matrix[rows] = bias, matrix
    part.covariance[rows] = gauges.expand_model_covariance(model, covariance)
    part.noise[rows], part.condition[rows] = np.sqrt(variance), condition
    part.spread[rows] = _spread(v, first)


def _spread(v: Array, gram: Array) -> Array:
    """Relative standard deviation of the calibrated magnitude, from that of |W (x − b)|² ≈ 1.

    |W (x − b)|² − 1 is the quadric over n M⁻¹ n − d; its relative spread is twice that of |·|.
    """
    m, n, d = quadric.split_quadric(v)
    size = np.einsum("ni,ni->n", n, np.linalg.solve(m, n[..., None])[..., 0]) - d
    q = v * quadric.MULTIPLICITY / size[:, None]
    count = gram[:, 9, 9]
    mean = np.einsum("ni,ni->n", q, gram[:, :, 9]) / count
    square = np.einsum("ni,nij,nj->n", q, gram, q) / count
    return np.asarray(np.sqrt(np.maximum(square - mean**2, 0.0)) / 2)
