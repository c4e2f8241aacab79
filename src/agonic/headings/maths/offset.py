"""By how much a compass and a gyro's heading differ, smoothed forwards and backwards in time.

At N moments the states are the offset o, magnetic less gyro heading; what disturbs the compass, a;
and the gyro's bias b on three axes. Errors s that all moments share are in units of their sd:

    gyro       o_{k+1} − o_k + Δγ·b_k + Δς·s       a random walk
    compass    z_k − o_k − m_k a_k − h_k·s         white noise
    bias       b_{k+1} − b_k                       a random walk
    rest       r_k − b_k                           where the log is at rest
    a          of variance one, forgotten with a time constant (Gauss–Markov)

All is linear. States are eliminated by their block tridiagonal normal equations (Rauch, Tung &
Striebel 1965); the marginal likelihood tells how large noise and disturbances are. Of the shared
errors those of the gyro's gain are found, and of the calibration where no tilt was recorded. The
others, of tilt and delay, are left as they are and counted in the variance (Schmidt 1966): a
vehicle that rocks by a degree would seem to show them, and shows the errors of the model.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from agonic.arrays import Array, Mask
from agonic.headings.maths.rest import NO_REST, Rest
from agonic.maths.estimation.filters.block_tridiagonal import invert
from agonic.maths.estimation.filters.smoother import Sums, eliminate, sum_residuals

BIAS_SD = float(np.radians(1.0))
"""rad/s: of a gyro's bias on each axis, at the start, where nothing tells more."""
STATES = 5
GYRO = 6
"""Of the shared errors, those of the gyro's gain: the first ones."""
_FIELD, _BIAS = 1, np.arange(2, 5)


class Sizes(NamedTuple):
    """Of what disturbs the compass, rad, its time constant, s; of the gyro's walk, rad in √s; of
    the compass's noise at one moment beside what is stated, rad; and of the errors of the gyro's
    gain, over those of a poor one."""

    field: float
    field_s: float
    walk: float
    noise: float
    gain: float


LIKELY = Sizes(np.radians(1.0), 3.0, np.radians(0.04), np.radians(0.3), 0.5)
"""Of a vehicle about which nothing is known."""
TOLD_LOG_SD = 0.4
"""Of the logarithm of what disturbs the compass, where the tilt's errors tell it."""
_LOG_SD = np.array([1.0, 1.0, 0.1, 1.2, 1.0])
_LARGEST_STEP = 4.0  # in standard deviations of the prior
_STEP = 0.05  # of the differences, in standard deviations


class Observed(NamedTuple):
    """What is known at N moments, in rad and s.

    `joined` (N − 1,) is false over a pause. `offset` z and the `variance` of its noise (N,),
    infinite where the compass tells nothing; `field_size` m (N,), about one. `by_bias` and
    `by_gain` (N − 1, 6) are Δγ and Δς, the gyro's gain being the first of the shared
    errors; `by_shared` (N, p) the h_k. `bias_sd` of the gyro's bias on each axis, rad/s; `rest`
    where the rates tell it. The first `found` of the shared errors are found.
    """

    time: Array
    joined: Mask
    offset: Array
    variance: Array
    field_size: Array
    by_bias: Array
    by_gain: Array
    by_shared: Array
    bias_sd: float = BIAS_SD
    rest: Rest = NO_REST
    found: int = GYRO

    def subset(self, start: int, stop: int) -> Observed:
        """Moments in a row."""
        pairs = slice(start, stop - 1)
        own = ("time", "offset", "variance", "field_size", "by_shared")
        kept = {name: getattr(self, name)[start:stop] for name in own}
        kept |= {name: getattr(self, name)[pairs] for name in ("joined", "by_bias", "by_gain")}
        return self._replace(rest=self.rest.subset(start, stop), **kept)


class System(NamedTuple):
    """Normal equations of states and shared errors, and what of twice the negative logarithm of the
    likelihood does not depend on either; the first `found` of the shared errors are found."""

    sums: Sums
    constant: float
    found: int


class Solution(NamedTuple):
    """States (N, 5), shared errors (p,), ∂states/∂shared (N, 5, p), covariance of the shared."""

    states: Array
    shared: Array
    by_shared: Array
    covariance: Array


def assemble(seen: Observed, sizes: Sizes, weights: Array) -> System:
    """The equations; `weights` (N,) of the compass."""
    n, p = seen.by_shared.shape
    told, rows = np.isfinite(seen.variance), _list_rows(seen, sizes)
    weight = weights / (np.where(told, seen.variance, 1.0) + sizes.noise**2)
    span = np.maximum(np.diff(seen.time), 1e-9)
    walk = seen.joined / (sizes.walk**2 * span)
    by_gain = np.zeros((n - 1, 1, p))
    by_gain[:, 0, :GYRO] = sizes.gain * seen.by_gain
    before, after = np.zeros((2, n - 1, 1, STATES))
    before[:, 0, 0], after[:, 0, 0], before[:, 0, _BIAS] = -1.0, 1.0, seen.by_bias
    weight = np.where(told, weight, 0.0)
    compass = sum_residuals(-seen.offset[:, None], weight, seen.by_shared[:, None], rows[:, None])
    total = compass.add(sum_residuals(np.zeros((n - 1, 1)), walk, by_gain, before, after))
    constant = total.cost - np.log(weight[told]).sum() - np.log(walk[seen.joined]).sum()
    total.params[range(p), range(p)] += 1.0
    total.diagonal[:, range(STATES), range(STATES)] += 1e-9
    at, read, precision = seen.rest.at, seen.rest.bias, 1.0 / seen.rest.variance[:, None]
    total.diagonal[at[:, None], _BIAS, _BIAS] += precision
    total.before[at[:, None], _BIAS] -= precision * read
    constant += (precision * read**2).sum()
    # what disturbs the compass and the gyro's bias go on by themselves: the share that is kept from
    # a moment to the next, the weight of what comes new, and that of the first moment
    kept = np.where(seen.joined, np.exp(-span / sizes.field_s), 0.0)[:, None]
    # rad/s in √s: 0.01°/s in a minute, of a common gyro that warms up
    drift = 1.0 / (np.radians(0.0015) ** 2 * span)[:, None]
    fresh = 1.0 / np.maximum(1.0 - kept**2, 1e-9)
    own = ((np.array([_FIELD]), kept, fresh, 1.0), (_BIAS, 1.0, drift, seen.bias_sd**-2))
    for number, share, weight_of_new, first in own:
        total.diagonal[0, number, number] += first
        total.diagonal[:-1, number, number] += share**2 * weight_of_new
        total.diagonal[1:, number, number] += weight_of_new
        total.below[:, number, number] -= share * weight_of_new
    constant -= np.log(fresh).sum()  # of the sizes; the bias's drift is known
    return System(total, float(constant), seen.found)


def _list_rows(seen: Observed, sizes: Sizes) -> Array:
    """What states add to the compass, (N, 5)."""
    rows = np.zeros((len(seen.time), STATES))
    rows[:, 0], rows[:, _FIELD] = 1.0, sizes.field * seen.field_size
    return rows


def solve(system: System) -> Solution:
    """States and shared errors."""
    by_shared, alone, information, gradient, *_ = eliminate(system.sums)
    inverse = np.linalg.inv(information)
    shared, k = np.zeros(len(gradient)), system.found
    shared[:k] = -(inverse @ gradient)[:k]
    # these are found beside all errors; those that are left at zero err by what they are
    covariance = np.eye(len(gradient))
    covariance[:k], covariance[:, :k] = inverse[:k], inverse[:, :k]
    return Solution(alone + by_shared @ shared, shared, by_shared, covariance)


def find_variances(system: System, solution: Solution, doubt: float = 1.0) -> Array:
    """Of the offset at each moment, (N,); `doubt` multiplies what depends on the sizes."""
    moved = solution.by_shared[:, 0]
    own = invert(system.sums.states).diagonal[:, 0, 0]
    return np.asarray(doubt * own + np.einsum("np,pq,nq->n", moved, solution.covariance, moved))


def predict(seen: Observed, sizes: Sizes, solution: Solution) -> Array:
    """What the compass should tell less the gyro, (N,), by all that is known of it."""
    told = np.einsum("ni,ni->n", _list_rows(seen, sizes), solution.states)
    return np.asarray(told + seen.by_shared @ solution.shared)


def compute_cost(system: System) -> float:
    """Twice the negative logarithm of the likelihood, all that is found integrated out."""
    k, sums = system.found, system.sums
    part = sums._replace(
        mixed=sums.mixed[:, :, :k], params=sums.params[:k, :k], own=sums.own[:, :k]
    )
    found = eliminate(part)
    root = np.linalg.cholesky(found.information)
    spread = found.log_determinant + 2 * float(np.log(np.diag(root)).sum())
    gained = float(found.gradient @ np.linalg.solve(found.information, found.gradient))
    return system.constant + spread - gained - found.gained


def find_sizes(seen: Observed, weights: Array, start: Sizes, field: float = 0.0) -> Sizes:
    """The likeliest sizes under weak priors, from a start.

    `field`, rad, where it is more than is likely of any vehicle, is what else is known to disturb
    the compass: few stretches of a log tell how large that is.
    """
    told = field > LIKELY.field
    middle = np.log(LIKELY._replace(field=field) if told else LIKELY)
    log_sd = np.array([TOLD_LOG_SD if told else _LOG_SD[0], *_LOG_SD[1:]])

    def cost(steps: Array) -> float:
        sizes = Sizes(*np.exp(middle + steps * log_sd))
        return compute_cost(assemble(seen, sizes, weights)) + float(steps @ steps)

    def slope(steps: Array) -> Array:
        here = cost(steps)
        return np.array([(cost(steps + m) - here) / _STEP for m in _STEP * np.eye(len(steps))])

    found = minimize(
        cost,
        (np.log(start) - middle) / log_sd,
        jac=slope,
        method="L-BFGS-B",
        bounds=[(-_LARGEST_STEP, _LARGEST_STEP)] * len(middle),
        options={"maxiter": 12, "ftol": 1e-6},
    )
    return Sizes(*np.exp(middle + found.x * log_sd))
