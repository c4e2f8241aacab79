"""Where a maximum-likelihood estimate starts from, found on a few hundred readings."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation import moments, quadric
from agonic.maths.equation.affine import FREE, join
from agonic.maths.equation.channels import Dip, Problem, compute_residuals, pieces
from agonic.maths.equation.crowding import choose_evenly
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.loss import cauchy, squares
from agonic.maths.estimation.noise.residuals import robust_scale
from agonic.maths.estimation.robust.least_median import fit_least_median_sphere

_MAX_CONDITION = 100.0  # the condition of what a start is found from at once
_MAX_VERTICAL_ERROR = 0.1  # of the field: tilts that are wrong by 6°
_STEPS = (0.01, 0.03, 0.1)  # of the prior on soft iron, loosened
_STEPS_BY_MAGNITUDE = (0.02, 0.05, 0.1)
_RELAX_ROWS = 1000  # readings that lead to where all of them have their minimum


def fit_at_once(few: Problem, robust: bool) -> Array | None:
    """Parameters without a start: by the whole field or its vertical part linear ones, by one
    magnitude the adjusted fit (`quadric`) where that is an ellipsoid; None where none is known.

    A start by the vertical part leaves most of the noise to the magnitude. Where the channels'
    correlation lengths settle depends on that, so both are weighed by their scatter first.
    """
    if few.dip is None:
        return fit_algebraic(few)
    if few.gauge != FREE or few.model != "full":
        return None
    found = _fit_vertical(few, few.dip) if few.across is None else _fit_field(few, few.dip)
    if found is None:
        return None
    bias, matrix, slopes = found
    start = nearest_parameters(bias, matrix, few.basis)
    params = np.concatenate([start, slopes.ravel(), np.zeros(few.shared_count)])
    return params if few.across is not None else _relax(few, params, (), robust)


def _fit_field(few: Problem, dip: Dip) -> tuple[Array, Array, Array] | None:
    """raw = A field + bias + K terms by least squares: bias, A⁻¹ and K; None where rows hardly tell
    A."""
    assert few.across is not None
    level = np.cross(few.across, dip.down)
    field = dip.horizontal[:, None] * level + dip.vertical[:, None] * dip.down
    found = _solve_linear(np.column_stack([field, np.ones(len(field)), _terms(few)]), few.points)
    if found is None or np.linalg.cond(found[:3]) > _MAX_CONDITION:
        return None
    return found[3], np.asarray(np.linalg.inv(found[:3].T)), found[4:].T


def _fit_vertical(few: Problem, dip: Dip) -> tuple[Array, Array, Array] | None:
    """down·(W raw − W bias − W K terms) = vertical by least squares: bias, W and K.

    None where rows hardly tell W, as those of a vehicle that stays level, or where roll and pitch
    are not those of the sensor: equations that do not hold, or a W turned by a right angle.
    """
    given = np.column_stack([few.points, -np.ones(len(few.points)), -_terms(few)])
    by_entry = np.einsum("ni,nj->nij", dip.down, given).reshape(len(given), -1)
    vertical = np.broadcast_to(dip.vertical, len(given))
    found = _solve_linear(by_entry, vertical)
    if found is None or np.std(by_entry @ found - vertical) > _MAX_VERTICAL_ERROR:
        return None
    matrix, others = np.split(found.reshape(3, -1), [3], axis=1)
    if np.linalg.eigvalsh(matrix + matrix.T)[0] <= 0.0 or np.linalg.cond(matrix) > _MAX_CONDITION:
        return None
    own = np.asarray(np.linalg.solve(matrix, others), dtype=np.float64)
    return own[:, 0], matrix, own[:, 1:]


def _solve_linear(given: Array, wanted: Array) -> Array | None:
    """Least squares; None where rows hardly tell the unknowns."""
    found, _, _, told = np.linalg.lstsq(given, wanted, rcond=None)
    return np.asarray(found, dtype=np.float64) if told[0] <= _MAX_CONDITION * told[-1] else None


def _terms(few: Problem) -> Array:
    """Those of sources on board (n, k), which may be none."""
    return np.zeros((len(few.points), 0)) if few.terms is None else few.terms


def fit_algebraic(few: Problem) -> Array | None:
    """The adjusted fit (`quadric`), where there is only one magnitude and it is an ellipsoid."""
    if not few.magnitude_only or len(few.magnitude) > 1:
        return None
    psi = moments.compute_denoised_gram(moments.accumulate(few.points, np.zeros(3), 1.0))
    v, _ = quadric.fit_adjusted(psi, few.model)
    if not quadric.is_ellipsoid(v):
        return None
    return _start(few, *quadric.to_affine(v, float(few.magnitude[0])))


def find_starts(few: Problem, algebraic: Array | None, robust: bool, seed: int) -> Iterator[Array]:
    """Parameters to start from, each made when it is asked for.

    With the attitude, or with sources on board: the middle of the readings. Then the sphere of most
    readings, which outliers cannot reach, and the algebraic fit where there is one. From all of
    these the prior on soft iron is relaxed step by step.
    """
    steps = _STEPS_BY_MAGNITUDE if few.magnitude_only else _STEPS
    if not few.magnitude_only:
        yield _relax(few, _middle(few), steps, robust)
    bias, gain = fit_least_median_sphere(few.points, few.magnitude, seed=seed)
    yield _relax(few, _start(few, bias, gain * np.eye(3)), steps, robust)
    if algebraic is not None:
        yield _relax(few, algebraic, steps[-1:], robust)


def nearest_parameters(bias: Array, matrix: Array, basis: Array) -> Array:
    """The parameters (m,) of a model nearest to a bias and matrix (least squares).

    Parameters: bias (3,), matrix (3, 3), basis (12, m) of the model.
    """
    return np.asarray(np.linalg.lstsq(basis, join(bias, matrix), rcond=None)[0])


def _start(few: Problem, bias: Array, matrix: Array) -> Array:
    terms = 0 if few.terms is None else few.terms.shape[1]
    others = np.zeros(3 * terms + few.shared_count)
    return np.concatenate([nearest_parameters(bias, matrix, few.basis), others])


def _middle(few: Problem) -> Array:
    """The mean of the readings, less the vertical field where down is known."""
    bias = few.points.mean(axis=0)
    turning = np.sqrt(np.var(few.points - bias, axis=0).sum())
    level = float(np.mean(few.magnitude))
    if few.dip is not None:
        level = float(np.mean(few.dip.horizontal))
        down, vertical = few.dip.down.mean(axis=0), float(np.mean(few.dip.vertical))
        bias = bias - down * vertical * turning / level
    return _start(few, bias, level / max(turning, 1e-9) * np.eye(3))


def _relax(few: Problem, params: Array, steps: tuple[float, ...], robust: bool) -> Array:
    """From a start to the minimum with the prior on soft iron loosened step by step."""
    if len(few.points) > _RELAX_ROWS:
        few = few.subset(choose_evenly(len(few.points), _RELAX_ROWS))
    loss = cauchy() if robust else squares()
    final = few.soft_iron_sd or np.inf
    tighter = [sd for sd in steps if sd < final]
    for sd in (*tighter, few.soft_iron_sd, few.soft_iron_sd):
        channels = []
        for channel in few.channels:
            residuals = compute_residuals(few, channel, params)
            scale = max(robust_scale(residuals, len(params)), 1e-9)
            channels.append(leastsq.Channel(pieces(few, channel), scale, loss))
        params = leastsq.minimise(
            channels, params, prior=few.prior(sd), tolerance=0.1, max_iterations=25, move=few.move
        ).params
    return params
