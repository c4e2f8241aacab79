"""From the parameters of the estimate back to a calibration in the units of the readings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.attitude.problem import Scale, Settings
from agonic.calibration.affine import Affine
from agonic.calibration.base import Validity
from agonic.calibration.interference import Interference, signals
from agonic.maths.equation.affine import FREE, model_basis, split
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.maths.equation.starting_values import nearest_parameters
from agonic.maths.equation.symmetric import pack_symmetric
from agonic.provenance import Provenance
from agonic.samples import Samples

Numbers = NDArray[Any]  # real, or complex to differentiate

_STEP = 1e-30  # of a complex step: its square is nothing beside one, so derivatives are exact


def make_calibration(
    estimate: Estimate,
    problem: Problem,
    scale: Scale,
    samples: Samples,
    settings: Settings,
    name: str,
) -> Affine:
    """The calibration, with the joint covariance of all that was estimated."""
    mixed = "second" in settings.sources
    gauge = FREE if mixed else problem.gauge

    def numbers(params: Numbers) -> Numbers:
        bias, matrix, slopes = _in_units(params, problem, scale)
        bias = bias - slopes @ scale.middle
        if mixed:
            bias, matrix, slopes = _of_readings(bias, matrix, slopes, settings.sources)
        flat = slopes.reshape(*slopes.shape[:-2], -1)
        return np.concatenate([bias, _entries(matrix, gauge), flat], axis=-1)

    found, covariance = _propagate(numbers, estimate)
    size = model_basis("full", gauge).shape[1]
    plain = _affine(found[:size], gauge, covariance[:size, :size], estimate, scale, samples)
    facts = {f.name: getattr(plain, f.name) for f in fields(Affine)} | {
        "model": problem.model,
        "frame_out": "b" if problem.dip is not None else samples.frame,
        "provenance": Provenance(
            inputs=(samples.origin,),
            settings={"fit": name, **settings.recorded(), "reference": scale.reference},
            method=("huber-1981",),
        ),
    }
    if problem.terms is None:
        return Affine(**facts)
    facts["covariance"] = _add_magnitude_sd(covariance, found, size, scale)
    return Interference(
        **facts,
        sources=settings.sources,
        coefficients=found[size:].reshape(3, -1),
        second_sensor=samples.second_sensor if mixed else None,
        typical=None if mixed else scale.middle,
    )


def make_mean_calibration(
    estimate: Estimate, problem: Problem, scale: Scale, samples: Samples
) -> Affine:
    """The affine calibration that this is while the sources stay at their mean."""

    def numbers(params: Numbers) -> Numbers:
        bias, matrix, _ = _in_units(params, problem, scale)
        return np.concatenate([bias, _entries(matrix, problem.gauge)], axis=-1)

    found, covariance = _propagate(numbers, estimate)
    return _affine(found, problem.gauge, covariance, estimate, scale, samples)


def find_parameters(near: Affine, problem: Problem, scale: Scale) -> Array:
    """The parameters of a problem at a calibration: `make_calibration` backwards."""
    assert near.magnitude is not None
    bias, matrix, slopes = near.bias, near.matrix, np.zeros((3, len(scale.spread)))
    if isinstance(near, Interference):
        slopes = near.coefficients
        if "second" in near.sources:
            names = signals(near.sources)  # `_of_readings` backwards
            of_second = [names.index(f"second_{axis}") for axis in "xyz"]
            back = np.eye(3) - slopes[:, of_second]  # (1 + K)⁻¹
            one = np.asarray(np.linalg.inv(back))
            bias, matrix, slopes = one @ bias, matrix @ back, one @ slopes
        bias = bias + slopes @ scale.middle
    bias = (bias - scale.centre) / scale.size
    own = nearest_parameters(bias, matrix * (scale.size / near.magnitude), problem.basis)
    return np.concatenate([own, (slopes * scale.spread / scale.size).ravel()])


def _affine(
    found: Array, gauge: str, covariance: Array, estimate: Estimate, scale: Scale, samples: Samples
) -> Affine:
    bias, matrix = split(model_basis("full", gauge) @ found)
    return Affine(
        bias=bias,
        matrix=matrix,
        covariance=_add_magnitude_sd(covariance, found, len(found), scale),
        unit_in=samples.unit,
        unit_out="nT",
        gauge=gauge,
        magnitude=scale.magnitude,
        noise=estimate.noise["magnitude"].sd * scale.size,
        sensor=samples.name,
        device_id=samples.device_id,
        frame_in=samples.frame,
        frame_out=samples.frame,
        validity=Validity.of(samples),
    )


def _in_units(params: Numbers, problem: Problem, scale: Scale) -> tuple[Numbers, Numbers, Numbers]:
    """Bias (…, 3) at the mean of the sources, matrix (…, 3, 3), and slopes (…, 3, k), in the units
    of the readings."""
    m, k = problem.basis.shape[1], len(scale.spread)
    bias, matrix = split(params[..., :m] @ problem.basis.T)
    slopes = (
        params[..., m : m + 3 * k].reshape(*params.shape[:-1], 3, k) * scale.size / scale.spread
    )
    return scale.centre + scale.size * bias, matrix * (scale.magnitude / scale.size), slopes


def _of_readings(
    bias: Numbers, matrix: Numbers, slopes: Numbers, sources: tuple[str, ...]
) -> tuple[Numbers, Numbers, Numbers]:
    """From slopes on the difference second − raw to slopes on the second reading itself. W (raw − b
    − K (second − raw)) = W (1 + K) (raw − (1 + K)⁻¹ b − (1 + K)⁻¹ K second)"""
    names = signals(sources)
    of_second = [names.index(f"second_{axis}") for axis in "xyz"]
    one = np.eye(3) + slopes[..., of_second]
    own = np.linalg.solve(one, bias[..., None])[..., 0]
    return own, matrix @ one, np.linalg.solve(one, slopes)


def _entries(matrix: Numbers, gauge: str) -> Numbers:
    """The entries of a matrix in the order of a calibration's covariance."""
    entries = pack_symmetric(matrix)
    lower = matrix[..., [1, 2, 2], [0, 0, 1]]
    return np.concatenate([entries, lower], axis=-1) if gauge == FREE else entries


def _propagate(numbers: Callable[[Numbers], Numbers], estimate: Estimate) -> tuple[Array, Array]:
    """A function of the estimate's parameters (…, m) and the covariance of its values."""
    params = estimate.solution.params
    found = numbers(params + 1j * _STEP * np.eye(len(params)))
    change = found.imag.T / _STEP
    return found[0].real, change @ estimate.solution.covariance @ change.T


def _add_magnitude_sd(covariance: Array, found: Array, size: int, scale: Scale) -> Array:
    """The covariance with what the uncertain magnitude of the reference adds to the matrix."""
    stretch = np.zeros(len(found))
    stretch[3:size] = found[3:size] * scale.sd / scale.magnitude
    return covariance + np.outer(stretch, stretch)
