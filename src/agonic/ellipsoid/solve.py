"""One model's fit in normalised coordinates, and the choice between models."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.ellipsoid.settings import Fixed, Method, Model
from agonic.errors import AgonicError, CoverageError
from agonic.fit import UNKNOWNS, ModelTest
from agonic.health import MIN_READINGS
from agonic.maths.equation import gauge, moments, quadric
from agonic.maths.equation.affine import model_basis, split
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.maximum_likelihood import Estimate, estimate
from agonic.maths.equation.starting_values import nearest_parameters

SIGNIFICANT = 0.01
"""A larger model is kept when the smaller one would be this improbable."""

DISCERNIBLE = 0.01
"""Soft iron (over the mean gain) that must be known this well before its absence counts."""

_PRESENT = {"sphere": "soft iron or unequal gains are", "diagonal": "cross-axis terms are"}
_WHICH = {True: "soft iron or non-orthogonal axes are", False: "unequal gains are"}
"""Which of the first, by whether cross-axis terms tilt the ellipsoid."""


class Found(NamedTuple):
    """One model's fit to points that are centred and scaled to about one, magnitude one; by
    likelihood with the `estimate` that it is of."""

    model: Fixed
    bias: Array
    matrix: Array
    covariance: Array
    noise: float
    correlation: float = 1.0
    residuals: Array | None = None
    weights: Array | None = None
    condition: float = 1.0
    iterations: int = 1
    converged: bool = True
    estimate: Estimate | None = None


def solve_likelihood(
    problem: Problem,
    model: Fixed,
    robust: bool,
    seed: int,
    start: tuple[Array, Array] | None = None,
) -> Found:
    """The maximum-likelihood (with a prior: maximum a posteriori) fit of one model; the minimum
    near the bias and matrix of `start`, where given."""
    return list_numbers(seek(problem, robust, seed, start), model)


def seek(problem: Problem, robust: bool, seed: int, start: tuple[Array, Array] | None) -> Estimate:
    """The estimate of one model, before residuals tell how it scatters."""
    near = None if start is None else nearest_parameters(*start, problem.basis)
    return estimate(problem, robust=robust, seed=seed, start=near)


def list_numbers(estimate: Estimate, model: Fixed) -> Found:
    """What was found of one model."""
    solution, noise = estimate.solution, estimate.noise["magnitude"]
    bias, matrix = split(model_basis(model) @ solution.params)
    return Found(
        model,
        bias,
        matrix,
        gauge.expand_model_covariance(model, solution.covariance),
        noise.sd,
        noise.correlation,
        estimate.residuals["magnitude"],
        estimate.weights,
        solution.condition,
        solution.iterations,
        solution.converged,
        estimate,
    )


def solve_algebraic(sums: Array, model: Fixed, method: Method) -> Found:
    """An algebraic fit from the 35 moments of normalised points."""
    if method == "li-griffiths" and model != "full":
        raise AgonicError(f"Li & Griffiths fit a full ellipsoid, not a {model}")
    psi = moments.compute_denoised_gram(sums)
    variance = 0.0
    try:
        if method == "adjusted":
            v, found = quadric.fit_adjusted(psi, model)
            variance = float(found)
        elif method == "li-griffiths":
            v = quadric.fit_li_griffiths(psi[0])
        else:
            v = quadric.fit_algebraic(psi[0], model)
        bias, matrix = quadric.to_affine(v)
    except ValueError:
        raise no_ellipsoid() from None
    if method != "adjusted":  # their noise: what the algebraic residual leaves per reading
        gradient = 4 * float(np.trace(matrix.T @ matrix)) / 3
        q = v * quadric.MULTIPLICITY
        m, n, d = quadric.split_quadric(v)
        size = float(n @ np.linalg.solve(m, n) - d)
        variance = float(q @ psi[0] @ q) / size**2 / gradient / sums[0]
    variance = max(variance, 1e-18)  # noiseless readings still get a covariance to test with
    cleaned = psi[0] - variance * psi[1] + variance**2 * psi[2]
    covariance, condition = quadric.algebraic_covariance(
        cleaned, bias, matrix, model_basis(model), variance
    )
    return Found(
        model,
        bias,
        matrix,
        gauge.expand_model_covariance(model, covariance),
        float(np.sqrt(variance)),
        condition=float(condition),
    )


def no_ellipsoid() -> CoverageError:
    """The error of readings whose quadric is none."""
    return CoverageError(
        "the readings do not determine an ellipsoid",
        undetermined="shape",
        turns="turn the sensor about all three axes, or fit with method='likelihood'",
    )


def too_few(n: int, model: Model) -> CoverageError:
    """The error of fewer readings than a model has unknowns."""
    return CoverageError(
        f"{n} readings cannot determine the {UNKNOWNS.get(model, 4)} unknowns of a "
        f"{'sphere' if model == 'auto' else model} model",
        turns="record a few hundred readings while turning the sensor about all axes",
    )


def choose_model(
    attempt: Callable[[Fixed], Found], model: Model, n: int
) -> tuple[Found, tuple[ModelTest, ...]]:
    """The fit of the model asked for, or of the full one, and tests of those within it.

    By likelihood the evidence shrinks its soft iron (`model.posterior`).
    """
    if n < UNKNOWNS.get(model, 4):
        raise too_few(n, model)
    if model != "auto":
        return attempt(model), ()
    if n < MIN_READINGS:
        return attempt("sphere"), ()
    full = attempt("full")
    gain = float(np.trace(full.matrix)) / 3
    discerned = float(np.sqrt(np.diag(full.covariance)[3:].max())) < DISCERNIBLE * gain
    compared = gauge.compare_soft_iron_models(full.matrix, full.covariance)
    tilted = bool(compared[1][3] <= SIGNIFICANT)
    tests = tuple(
        ModelTest(
            smaller=small,
            larger=large,
            statistic=x,
            p_value=p,
            sentence=describe_test(small, p, discerned, tilted),
        )
        for small, large, x, p in compared
    )
    return full, tests


def describe_test(smaller: str, p: float, discerned: bool, tilted: bool) -> str:
    """What a test says, in a sentence; `tilted` whether cross-axis terms are seen.

    Unequal gains leave the ellipsoid of the readings upright; what tilts it is soft iron, or sensor
    axes that are not square, which look the same.
    """
    chance = "p < 1e-6" if p < 1e-6 else f"p = {p:.2g}"
    present = p <= SIGNIFICANT
    if present:
        what = f"{_WHICH[tilted] if smaller == 'sphere' else _PRESENT[smaller]} present"
    else:
        what = f"no sign of {'soft iron' if smaller == 'sphere' else 'cross-axis terms'}"
    doubt = "" if present or discerned else ", but too few directions to rule it out"
    return f"{what} ({chance}){doubt}"
