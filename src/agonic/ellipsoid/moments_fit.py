"""`fit_moments`: the adjusted fit from 35 numbers."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np

from agonic.arrays import Array
from agonic.coverage import compute_coverage
from agonic.ellipsoid.evidence import find_gain
from agonic.ellipsoid.problem import (
    Scale,
    describe_result,
    make_calibration,
    state_accuracy,
)
from agonic.ellipsoid.settings import CITATIONS, Gauge, Model, describe_reference
from agonic.ellipsoid.solve import choose_model, solve_algebraic
from agonic.errors import AgonicError, CoverageError, check_choice
from agonic.fit import Fit
from agonic.health import check_scale
from agonic.maths.equation import moments as kernel
from agonic.model.verdict import check_coverage
from agonic.moments import Moments
from agonic.provenance import Provenance
from agonic.reference import Reference

STILL = 1e-9
"""Readings that move by less, over their size, do not move but for rounding."""


def fit_moments(
    sums: Moments,
    reference: Reference | None = None,
    *,
    model: Model = "auto",
    gauge: Gauge = "symmetric",
    inclination_deg: float = 60.0,
) -> Fit:
    """The adjusted least-squares fit from moments alone, whatever amount of data they sum up.

    The magnitude must be constant; residuals and what needs them (outliers, changes) are not
    available.

    Parameters: `sums`, 35 moments; `reference`, a constant magnitude, nT; `model`, `gauge`,
    `inclination_deg` degrees, returns and sources as in `fit_ellipsoid`.

    >>> u = np.random.default_rng(0).normal(size=(500, 3))
    >>> field = 50_000 * u / np.linalg.norm(u, axis=1, keepdims=True)
    >>> fit = fit_moments(Moments.of(field + [100.0, 0, 0]), Reference.constant(50_000))
    >>> fit.calibration.bias.round(3) + 0.0
    array([100.,   0.,   0.])
    """
    check_choice("model", model, get_args(Model))
    check_choice("gauge", gauge, get_args(Gauge))
    if reference is not None and len(reference.values) > 1:
        raise AgonicError("moments hold no rows, so they need one constant reference magnitude")
    if sums.count < 4:
        raise CoverageError(f"{sums.count} readings do not determine a sphere; four are needed")
    normalised, scale = normalise_moments(sums, reference)
    found, tests = choose_model(
        lambda fixed: solve_algebraic(normalised, fixed, "adjusted"), model, sums.count
    )
    chosen = {
        "fit": "ellipsoid",
        "model": model,
        "method": "adjusted from moments",
        "gauge": gauge,
        "reference": describe_reference(reference),
    }
    affine = replace(
        make_calibration(found, scale, sums.unit, gauge),
        provenance=Provenance(settings=chosen, method=CITATIONS["adjusted"]),
    )
    coverage = compute_coverage(affine, np.zeros(80, dtype=np.int64), inclination_deg)
    fit = Fit(
        calibration=affine,
        n=sums.count,
        residuals=None,
        weights=None,
        noise=affine.noise or 0.0,
        correlation=1.0,
        condition=found.condition,
        iterations=1,
        converged=True,
        coverage=coverage,
        tests=tests,
        accuracy=state_accuracy(affine, coverage),
        remarks=describe_result(affine, tests, reference is not None),
    )
    return fit.with_findings(
        check_scale(find_gain(affine), affine.unit_in), check_coverage(coverage)
    )


def normalise_moments(sums: Moments, reference: Reference | None) -> tuple[Array, Scale]:
    """The 35 moments of centred and scaled readings, and the way back to their units."""
    centre, size = middle(sums)
    known = None if reference is None else float(reference.magnitudes(1)[0])
    scale = Scale(centre, size, known, reference.sd if reference else 0.0)
    return sums.rebase(centre, size).sums, scale


def still() -> CoverageError:
    """The error of readings that are all the same."""
    return CoverageError("the readings never change", turns="turn the sensor about all axes")


def middle(sums: Moments) -> tuple[Array, float]:
    """Mean and rms distance from it of the readings that went in."""
    plain = sums.rebase(sums.centre, 1.0).sums / sums.count
    at = {exponents: k for k, exponents in enumerate(kernel.EXPONENTS)}
    mean = np.array([plain[at[e]] for e in ((1, 0, 0), (0, 1, 0), (0, 0, 1))])
    square = sum(plain[at[e]] for e in ((2, 0, 0), (0, 2, 0), (0, 0, 2))) - mean @ mean
    centre = sums.centre + mean
    if not square > max(1e-12 * float(mean @ mean), STILL**2 * float(centre @ centre)):
        raise still()
    return centre, float(np.sqrt(square))
