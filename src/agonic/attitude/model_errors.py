"""Whether the magnitude's residuals show something that an attitude-aided fit does not have."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Mask
from agonic.attitude.problem import Scale
from agonic.calibration.affine import Affine
from agonic.health import Fitted, examine_model
from agonic.health.adequacy import ModelError
from agonic.maths.equation.affine import magnitude_residual, model_basis
from agonic.maths.equation.channels import Problem, field_of_terms
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.maths.equation.unmodelled import tilt_signals
from agonic.maths.estimation.leastsq import inverse
from agonic.samples import Samples


def find_model_errors(
    affine: Affine, estimate: Estimate, samples: Samples, usable: Mask, part: Problem, scale: Scale
) -> tuple[ModelError, ...]:
    """What the residuals of the usable rows show, with what it leaves open of the heading.

    What dip, azimuth and priors know of the calibration stands beside the magnitude as a prior, so
    "prior" is no finding here. Parameters: the calibration with sources at their mean; `part`, the
    problem of the usable rows.
    """
    assert affine.noise is not None
    assert affine.covariance is not None
    sources = field_of_terms(part, estimate.solution.params) * scale.size
    readings, magnitudes = samples.field[usable] - sources, part.magnitude * scale.magnitude
    of_magnitude = estimate.noise["magnitude"]
    _, local = magnitude_residual(readings, affine.bias, affine.matrix, magnitudes, affine.noise)
    jacobian = local @ model_basis("full", affine.gauge) / affine.noise
    own = (jacobian * estimate.weights[:, None]).T @ jacobian / of_magnitude.correlation
    fitted = Fitted(
        calibration=affine,
        readings=readings,
        time=None if samples.time is None else samples.time[usable],
        weights=estimate.weights,
        wanted=magnitudes,
        noise=affine.noise,
        correlation=of_magnitude.correlation,
        prior=_known_otherwise(inverse(affine.covariance) - own, np.sqrt(np.diag(own))),
        signals=_list_signals(part),
    )
    found = examine_model(fitted)
    return tuple(one for one in found if one.cause != "prior")


def _list_signals(part: Problem) -> dict[str, Array]:
    """What a disturbance may go with: the vehicle's bank and pitch."""
    if part.dip is None:
        return {}
    ahead, right, _ = part.dip.down.T
    return {"follows bank": tilt_signals(right), "follows pitch": tilt_signals(ahead)}


def grow(estimate: Estimate, errors: tuple[ModelError, ...], scale: Scale) -> Estimate:
    """The estimate grown in its covariance by what the errors leave open."""
    if not errors:
        return estimate
    growth = np.sum([error.growth for error in errors], axis=0)
    units = np.full(len(growth), scale.magnitude / scale.size)
    units[:3] = scale.size
    grown = estimate.solution.covariance.copy()
    grown[: len(units), : len(units)] += growth / np.outer(units, units)
    return estimate._replace(solution=estimate.solution._replace(covariance=grown))


def _known_otherwise(information: Array, size: Array) -> Array:
    """The nearest information matrix that is positive, in units of the sizes of the parameters."""
    outer = np.outer(size, size)
    values, vectors = np.linalg.eigh(information / outer)
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T * outer)
