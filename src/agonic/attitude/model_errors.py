"""Whether the magnitude's residuals show something that an attitude-aided fit does not have."""

from __future__ import annotations

from functools import partial

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.attitude.problem import Scale
from agonic.calibration.affine import Affine
from agonic.health import Fitted, examine_model
from agonic.health.adequacy import ModelError, Residuals, View, Views
from agonic.maths.equation.affine import magnitude_residual, model_basis, split
from agonic.maths.equation.channels import Problem, field_of_terms, pieces
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.maths.equation.unmodelled import tilt_signals
from agonic.maths.estimation.leastsq import inverse
from agonic.samples import Samples


def find_model_errors(
    affine: Affine, estimate: Estimate, samples: Samples, usable: Mask, part: Problem, scale: Scale
) -> tuple[ModelError, ...]:
    """What the residuals of the usable rows show, with what it leaves open of the heading.

    What dip, azimuth and priors know of the calibration stands beside the magnitude as a prior, so
    "prior" is no finding here; what lasts, dip and azimuth show. Parameters: the calibration with
    sources at their mean; `part`, the problem of the usable rows.
    """
    assert affine.noise is not None
    assert affine.covariance is not None
    sources = field_of_terms(part, estimate.solution.params) * scale.size
    readings, magnitudes = samples.field[usable] - sources, part.magnitude * scale.magnitude
    of_magnitude = estimate.noise["magnitude"]
    _, local = magnitude_residual(readings, affine.bias, affine.matrix, magnitudes, affine.noise)
    jacobian = local @ model_basis("full", affine.gauge) / affine.noise
    own = (jacobian * estimate.weights[:, None]).T @ jacobian / of_magnitude.correlation
    units = _units(part, scale)
    # what an inertial unit feels is wrong as the vehicle moves, which is no error of the sensor
    more = part.dip is not None and part.shared is None
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
        look=partial(_look, estimate, part, units, readings, scale) if more else None,
        own_prior=_prior_information(estimate, part, units),
    )
    found = examine_model(fitted)
    return tuple(one for one in found if one.cause not in ("prior", "lasting"))


def _units(part: Problem, scale: Scale) -> Array:
    """What the normalised parameters are times, in the units of the readings; 1 for further ones
    than bias and matrix."""
    m = part.basis.shape[1]
    return np.asarray(np.r_[np.full(3, scale.size), np.full(m - 3, scale.magnitude / scale.size)])


def _list_kinds(estimate: Estimate, part: Problem, units: Array) -> tuple[Residuals, ...]:
    """All kinds of residuals, over their noise."""
    params, m, kinds = estimate.solution.params, len(units), []
    for channel, noise in estimate.noise.items():
        sides = zip(*pieces(part, channel, estimate.noise["magnitude"].sd)(params), strict=True)
        residuals, jacobian = (np.concatenate(side) / noise.sd for side in sides)
        jacobian[:, :m] /= units
        kinds.append(Residuals(residuals, jacobian, -jacobian[:, :3], noise.correlation))
    return tuple(kinds)


def _look(
    estimate: Estimate, part: Problem, units: Array, readings: Array, scale: Scale, rows: Index
) -> Views:
    """All kinds of residuals of some rows, also with a further draw of noise of the readings, and
    of the attitude."""
    noise = estimate.noise["magnitude"].sd * np.random.default_rng(0).normal(size=readings.shape)
    blur, some, own = noise[rows], part.subset(rows), readings[rows]
    seen = (
        (own, some),
        (own + blur * scale.size, some._replace(points=some.points + blur)),
        (own, _blur_attitude(estimate, part).subset(rows)),
    )
    return Views(
        *(View(at, _list_kinds(estimate, one, units), _list_signals(one)) for at, one in seen)
    )


def _blur_attitude(estimate: Estimate, part: Problem) -> Problem:
    """The problem with a further draw of errors of tilt and heading, as residuals have them."""
    assert part.dip is not None
    rng, noise, params = np.random.default_rng(1), estimate.noise, estimate.solution.params
    _, matrix = split(part.basis @ params[: part.basis.shape[1]])
    radius = 1.0 / np.cbrt(abs(float(np.linalg.det(matrix))))
    down, read = part.dip.down, noise["magnitude"].sd ** 2
    tilted = np.sqrt(max(noise["dip"].sd ** 2 - read, 0.0)) / radius
    turn = tilted * np.cross(rng.normal(size=down.shape), down)
    again = down + np.cross(turn, down)
    again /= np.linalg.norm(again, axis=1, keepdims=True)
    blurred = part._replace(dip=part.dip._replace(down=again))
    if part.across is None:
        return blurred
    below, level = (radius * float(of.mean()) for of in (part.dip.vertical, part.dip.horizontal))
    headed = max(noise["azimuth"].sd ** 2 - read - (tilted * below) ** 2, 0.0)
    turn += np.sqrt(headed) / level * rng.normal(size=(len(down), 1)) * down
    return blurred._replace(across=part.across + np.cross(turn, part.across))


def _prior_information(estimate: Estimate, part: Problem, units: Array) -> Array:
    params = estimate.solution.params
    by = np.r_[units, np.ones(len(params) - len(units))]
    return np.asarray(part.prior_information(params) / np.outer(by, by))


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
    units = np.r_[np.full(3, scale.size), np.full(len(growth) - 3, scale.magnitude / scale.size)]
    grown = estimate.solution.covariance.copy()
    grown[: len(units), : len(units)] += growth / np.outer(units, units)
    return estimate._replace(solution=estimate.solution._replace(covariance=grown))


def _known_otherwise(information: Array, size: Array) -> Array:
    """The nearest information matrix that is positive, in units of the sizes of the parameters."""
    outer = np.outer(size, size)
    values, vectors = np.linalg.eigh(information / outer)
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T * outer)
