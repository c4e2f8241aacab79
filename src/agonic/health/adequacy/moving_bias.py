"""A bias that comes and goes along one direction or with the attitude, and two populations."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.health.adequacy.fitted import FEWEST_ROWS, ModelError, Work, make_error
from agonic.maths.estimation.inference.linearised import sums_by
from agonic.maths.one_pass import median

SIGNIFICANT = 1e-3 / 3
MOST_WINDOWS, FEWEST_WINDOWS = 600, 16
FAR = 6.0
"""Products of windows farther from their median than this many median distances count as so far."""
LEAST_VARIANCE = 0.05
"""Of residuals over the noise."""
MEAN = 1.0
"""Square of the mean of what comes and goes over its variance, as of a current that is on for half
of the time: the bias holds the mean, which no residual shows."""
TURNED = 0.7
"""Errors that still are there when directions are as little alike as this last."""
SURELY = 3.0
"""Standard errors by which what lasts has to be seen."""
LIKELY = 0.5
"""How probable it is that what lasts is no noise of the sensor."""
_ENTRIES = ((0, 0), (1, 1), (0, 1), (0, 2), (1, 2))
"""Of a symmetric matrix without trace."""


def find_moving_bias(work: Work) -> list[ModelError]:
    """A disturbance along one direction that comes and goes, by the covariance of residuals.

    A bias that varies with covariance M makes E[r_i r_j] = n_iᵀ M n_j for rows close in time;
    noise with memory alone makes it n_i·n_j. Two populations in random rows are not close in
    time: there the residuals' distribution tells.
    """
    fit, normals = work.linear, work.normals
    close = np.diff(work.rows) == 1
    first = np.flatnonzero(close & (fit.weights[1:] > 0) & (fit.weights[:-1] > 0))
    pairs = (normals[first], normals[first + 1], fit.residuals[first] * fit.residuals[first + 1])
    found = _anisotropy(*pairs, work.fitted.correlation)
    one_sided = _find_one_sided(*pairs, work.fitted.correlation)
    along, spread = (False, np.zeros((3, 3))) if found is None else _find_spread(found.traceless)
    mixed: list[ModelError] = []
    if one_sided is None and not along:
        mixed = _find_populations(work)
        if found is None or float(np.mean(pairs[-1])) < LEAST_VARIANCE:
            return mixed
    p_values = [one.p_value for one in (found, one_sided) if one is not None]
    if one_sided is not None:
        spread = spread + one_sided.variance * np.eye(3)
    size = float(np.sqrt(np.trace(spread))) * work.fitted.noise
    growth = np.zeros((len(work.scale), len(work.scale)))
    growth[:3, :3] = (1.0 + MEAN) * spread * work.fitted.noise**2
    cause = "comes and goes" if along else "by direction"
    return [*mixed, make_error(work, cause, min(p_values), size, growth)]


def find_lasting(work: Work, found: list[ModelError]) -> list[ModelError]:
    """Residuals that last while the sensor turns, beyond what is found: they may go with how it is
    turned, as where it is carried about in an uneven field, and a bias then holds as much.

    Of a field that differs by g over the way the sensor is carried, the magnitude shows what lies
    across the field, and a bias takes up what lies along it (`MEAN` and as much again for what the
    fit takes up): no residual tells it from noise with memory. With m the mean of n_i·n_j over rows
    as far apart as the sensor takes to turn, its variance is E[r_i r_j]/m. Where nothing lasts, the
    products do not go together for longer than that: a longer window, as the residuals' own
    correlation asks for, would hide what lasts behind what lasts.
    """
    fit, normals, lag = work.linear, work.normals, _find_turned(work.normals)
    first = np.flatnonzero((fit.weights[lag:] > 0) & (fit.weights[:-lag] > 0))
    first = first[work.rows[first + lag] - work.rows[first] == lag]
    product = fit.residuals[first] * fit.residuals[first + lag]
    alike = float(np.sum(normals[first] * normals[first + lag]))
    windows = _count_windows(product, 2.0 * lag)
    if windows < FEWEST_WINDOWS / 2 or alike <= 0:
        return []
    sums = np.bincount(np.arange(len(product)) * windows // len(product), product)
    if float(sums.sum()) < SURELY * float(np.linalg.norm(sums)):
        return []
    variance = float(sums.sum()) / alike * work.fitted.noise**2
    known = sum((error.growth[:3, :3] for error in found), np.zeros((3, 3)))
    values, vectors = np.linalg.eigh((1.0 + MEAN) * variance * np.eye(3) - known)
    growth = np.zeros((len(work.scale), len(work.scale)))
    growth[:3, :3] = (vectors * np.maximum(values, 0.0)) @ vectors.T
    error = make_error(work, "lasting", 0.0, float(np.sqrt(variance)), growth)
    return [replace(error, probability=LIKELY)]


def _find_turned(normals: Array) -> int:
    """Rows that it takes until directions are as far apart as `TURNED` says, of how far they are at
    most: those of a vehicle that keeps level stay within a cone."""
    lag, middle = 1, float(np.sum(normals.mean(axis=0) ** 2))
    while lag < len(normals) // 4:
        alike = float(np.mean(np.sum(normals[:-lag] * normals[lag:], axis=1)))
        if alike - middle < TURNED * (1.0 - middle):
            break
        lag = int(np.ceil(lag * 1.25))
    return lag


class _OneSided(NamedTuple):
    """Residuals that last and are larger in some directions than in the opposite ones: their
    variance over all."""

    p_value: float
    variance: float


def _find_one_sided(a: Array, b: Array, product: Array, correlation: float) -> _OneSided | None:
    """Whether products of residuals differ between opposite directions.

    A bias that moves, by whatever cause and along whatever axis, makes n_iᵀ M n_j, the same in
    opposite directions; so does noise of the sensor. A field that is not the same in all attitudes
    (steel below, where the sensor comes near it nose down) does not. What of it depends on the
    direction alone a bias takes up, so that residuals show it by how they scatter, or not at all.
    """
    windows = _count_windows(product, correlation)
    if windows < FEWEST_WINDOWS:
        return None
    isotropic, columns = _separate_directions(a, b)
    beside = np.column_stack([isotropic, columns])
    p_value = _compare(beside, a + b, product, windows)
    if p_value > SIGNIFICANT:
        return None
    variance = float(np.mean(product)) / max(float(np.mean(isotropic)), 0.1)
    return _OneSided(p_value, variance) if variance > LEAST_VARIANCE else None


def _count_windows(product: Array, correlation: float) -> int:
    """Windows a correlation length long; none of few products."""
    if len(product) < FEWEST_ROWS:
        return 0
    return min(int(len(product) / max(correlation, 1.0)), MOST_WINDOWS)


class _Anisotropy(NamedTuple):
    """How the covariance of a bias differs by direction (3, 3), without what all share."""

    p_value: float
    traceless: Array


def _anisotropy(a: Array, b: Array, product: Array, correlation: float) -> _Anisotropy | None:
    """The covariance of a bias that varies by direction, from products of residuals."""
    windows = _count_windows(product, correlation)
    if windows < FEWEST_WINDOWS:
        return None
    isotropic, columns = _separate_directions(a, b)
    p_value = _compare(isotropic[:, None], columns, product, windows)
    if p_value > SIGNIFICANT:
        return None
    gains = isotropic @ columns / (isotropic @ isotropic)
    beside = columns - isotropic[:, None] * gains
    xx, yy, xy, xz, yz = np.linalg.lstsq(beside, product, rcond=None)[0]
    traceless = np.array([[xx, xy / 2, xz / 2], [xy / 2, yy, yz / 2], [xz / 2, yz / 2, 0.0]])
    return _Anisotropy(p_value, traceless)


def _separate_directions(a: Array, b: Array) -> tuple[Array, Array]:
    """What a bias of equal size along all axes makes of products (n,), and of unequal (n, 5)."""
    isotropic = np.sum(a * b, axis=1)
    columns = np.stack(
        [
            a[:, i] * b[:, j] / 2 + a[:, j] * b[:, i] / 2 - (isotropic / 3 if i == j else 0.0)
            for i, j in _ENTRIES
        ],
        axis=1,
    )
    return isotropic, columns


def _find_spread(traceless: Array) -> tuple[bool, Array]:
    """Whether a bias varies along a direction, else across one, and its covariance (3, 3) beyond
    what the others share.

    Across: what goes with the attitude about an axis of the sensor, as where it is carried about in
    a field that differs by place, shows everywhere but along that axis.
    """
    values, vectors = np.linalg.eigh(traceless)
    along = bool(values[2] - values[1] >= values[1] - values[0])
    beyond = np.maximum(values - values[1 if along else 0], 0.0)
    return along, np.asarray((vectors * beyond) @ vectors.T)


def _compare(beside: Array, columns: Array, product: Array, windows: int) -> float:
    """The p-value that products (n,) go by `columns` (n, k), beside others, no more than by chance.

    Means over windows of a correlation length are independent, and scatter alike whatever the
    direction where nothing but noise is in them: an F-test. The score's own scatter, which asks
    for no such noise, knows too little from some dozens of squares: a current that is switched on
    and off every few seconds, of three times the noise, passed.
    """
    from scipy.special import fdtrc  # here, so that what only reads a log loads no SciPy

    window = np.arange(len(product)) * windows // len(product)
    all_sums = sums_by(window, np.column_stack([beside, columns, product]), windows)
    means = all_sums / np.bincount(window)[:, None]
    design, seen = means[:, :-1], means[:, -1]
    middle = median(seen)
    reach = FAR * median(np.abs(seen - middle))
    seen = np.clip(seen, middle - reach, middle + reach)
    alone, whole = (
        float(np.sum((seen - part @ np.linalg.lstsq(part, seen, rcond=None)[0]) ** 2))
        for part in (design[:, : beside.shape[1]], design)
    )
    k, left = columns.shape[1], windows - design.shape[1]
    return float(fdtrc(k, left, (alone - whole) / k / max(whole / left, 1e-300)))


def _find_populations(work: Work) -> list[ModelError]:
    """Readings of two calibrations, δ apart, mixed at random: r = J δ_k with one scatter, against
    one calibration with a scatter that goes by direction (BIC)."""
    kept = np.flatnonzero(work.linear.weights > 0)
    residuals, normals = work.linear.residuals[kept], work.normals[kept]
    found = _anisotropy(normals, normals, residuals**2, work.fitted.correlation)
    if found is None:
        return []
    jacobian = work.linear.jacobian[kept]
    middle = float(np.mean(residuals**2 - _by_direction(normals, found.traceless)))
    variance = np.maximum(middle + _by_direction(normals, found.traceless), LEAST_VARIANCE)
    alone = -0.5 * float(np.sum(residuals**2 / variance + np.log(variance)))
    shares, apart, mixed = _separate(residuals, jacobian, normals, found.traceless)
    further = 2 * jacobian.shape[1] + 2 - 7
    if mixed - alone < 0.5 * further * np.log(len(residuals)) + 8:
        return []
    growth = shares[0] * shares[1] * np.outer(apart, apart) * np.outer(work.scale, work.scale)
    size = float(np.sqrt(shares[0] * shares[1] * np.mean((jacobian @ apart) ** 2)))
    return [make_error(work, "two populations", found.p_value, size * work.fitted.noise, growth)]


def _by_direction(normals: Array, spread: Array) -> Array:
    return np.asarray(np.einsum("ij,jk,ik->i", normals, spread, normals))


def _separate(
    residuals: Array, jacobian: Array, normals: Array, traceless: Array
) -> tuple[Array, Array, float]:
    """Shares (2,) of two calibrations, how far apart they are (p,), and their log-likelihood, by
    expectation and maximisation from two biases along the direction of most scatter."""
    values, vectors = np.linalg.eigh(traceless)
    start = normals @ vectors[:, 2] * np.sqrt(values[2] - values[0])
    expected, shares, sd = np.stack([-start, start], axis=1), np.full(2, 0.5), 1.0
    found = np.zeros((2, jacobian.shape[1]))
    floor = 1e-6 * np.diag(np.diag(jacobian.T @ jacobian))
    for _ in range(100):
        z = (residuals[:, None] - expected) / sd
        likely = np.exp(-0.5 * z**2) * shares
        of = likely / np.maximum(likely.sum(axis=1, keepdims=True), 1e-300)
        shares = np.clip(of.mean(axis=0), 0.02, 0.98)
        for k in range(2):
            weighted = jacobian.T * of[:, k]
            found[k] = np.linalg.solve(weighted @ jacobian + floor, weighted @ residuals)
        expected = jacobian @ found.T
        left = float(np.mean(of * (residuals[:, None] - expected) ** 2) * 2)
        sd = np.sqrt(max(left, LEAST_VARIANCE))
    z = (residuals[:, None] - expected) / sd
    total = np.maximum(np.exp(-0.5 * z**2) @ shares, 1e-300)
    return shares, found[1] - found[0], float(np.sum(np.log(total)) - len(z) * np.log(sd))
