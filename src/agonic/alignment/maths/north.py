"""North from a hanging gyro: its transits and its whole swing; `reversals` has turning points.

The spin axis of a gyro that hangs from a band swings about the meridian; the readings of the circle
that follow it are

    u(t) = N + e^(−λt) (p cos ωt + q sin ωt),

N the reading of the circle at north. Readings and N are in degrees and increase to the east.
"""

from __future__ import annotations

from functools import partial
from typing import Annotated, NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.noise.residuals import correlation_length
from agonic.maths.estimation.noise.student import compute_widening, exceed_stated
from agonic.readable import Shown


def compute_schuler_means(turning: Array) -> Array:
    """N_i = (u_i + 2 u_{i+1} + u_{i+2})/4 of turning points (n,), (n − 2,). Free of the amplitude
    and, to first order, of its decay."""
    return np.convolve(turning, [0.25, 0.5, 0.25], mode="valid")


def fit_reversals(turning: Array, reading_sd: float | None = None) -> North:
    """North of n ≥ 3 turning points: the mean of the Schuler means, its standard error from their
    spread. Neighbouring means share readings. With M (n − 2, n) from readings to means and Q what
    centres them, E Σ(N_i − N̄)² = σ² tr(QMMᵀ), and N̄ = wᵀu has the variance σ² wᵀw. With a single
    mean, or a `reading_sd` that is stated, σ is that, unless the turning points scatter by more
    about u_i = N + (−1)ⁱ (a + b i)."""
    n = len(turning)
    onto = np.stack([compute_schuler_means(row) for row in np.eye(n)], axis=1)
    means, weight = onto @ turning, onto.mean(axis=0)
    freedom, excess, noise = len(means) - 1, 1.0, reading_sd or float("nan")
    if reading_sd:
        sign, step = (-1.0) ** np.arange(n), np.arange(n) - (n - 1) / 2
        line = regress(np.stack([np.ones(n), sign, sign * step], axis=1), turning, reading_sd)
        excess = line.excess
    elif freedom:
        spread = float(((means - means.mean()) ** 2).sum() / ((onto - weight) ** 2).sum())
        noise = float(np.sqrt(spread)) * compute_widening(freedom)
    sd = excess * noise * float(np.sqrt(weight @ weight))
    return North(float(means.mean()), sd, freedom, excess, *_fit_drift(turning, reading_sd))


def _fit_drift(turning: Array, reading_sd: float | None) -> tuple[float, float]:
    """How far N moves from the first turning point to the last, and its standard error. u_i = N + d
    i/(n − 1) + (−1)ⁱ (a + b i + c i²): the decay of the amplitude is smooth. Of four turning points
    c is that of a steady decay, b²/2a. The noise is the stated one, or what is left, and more where
    more is left."""
    n = len(turning)
    along = np.linspace(-0.5, 0.5, n)
    sign = (-1.0) ** np.arange(n)
    design = np.stack([np.ones(n), sign, sign * along, along], axis=1)
    if n == 4:
        _, a, b, _ = np.linalg.solve(design, turning)
        turning = turning - sign * along**2 * (b * b / (2 * a) if a else 0.0)
    else:
        design = np.column_stack([design, sign * along**2])
    if n - design.shape[1] < (0 if reading_sd else 1):
        return 0.0, float("inf")
    line = regress(design, turning, reading_sd)
    return float(line.found[3]), float(np.sqrt(line.covariance[3, 3]))


class North(NamedTuple):
    """The circle's reading at the gyro's north and its standard error, degrees, or NaN. `freedom`
    is how many independent differences the standard error rests on; `excess` how many times the
    stated noise the readings scatter, 1 where chance explains it. `drift_deg` is how far N moves
    over the readings and `drift_sd_deg` its standard error, where they show one."""

    reading_deg: Annotated[float, Shown(key="gyro_north_deg")]
    sd_deg: float
    freedom: Annotated[int, Shown()]
    excess: float = 1.0
    drift_deg: float = 0.0
    drift_sd_deg: float = float("inf")

    @property
    def sd_arcsec(self) -> Annotated[float, Shown()]:
        """The standard error in arcseconds."""
        return 3600.0 * self.sd_deg


class Swing(NamedTuple):
    """A damped sinusoid: N, p, q, λ, ω with covariance, residuals (n,) and noise of a reading.
    `correlation` is how many successive readings count as one. `north` has the drift of N over the
    record, where the fit converged."""

    params: Array
    covariance: Array
    residuals: Array
    noise: float
    correlation: float
    converged: bool
    north: North


class Regression(NamedTuple):
    """Coefficients (c,) with covariance (c, c), and what is `left` of the readings (n,). `excess`
    is how many times the stated noise they scatter, 1 where chance explains it."""

    found: Array
    covariance: Array
    freedom: int
    excess: float
    left: Array


def regress(design: Array, values: Array, stated_sd: float | Array | None = None) -> Regression:
    """Least squares of values (n,) on a design (n, c), their noise as stated or by what is left.
    The stated noise is widened where the values scatter by more; without one it is that of the
    residuals by Student's t, NaN where nothing is left for it."""
    size = np.linalg.norm(design, axis=0)
    inverse = leastsq.inverse((design / size).T @ (design / size)) / np.outer(size, size)
    found = np.linalg.lstsq(design / size, values, rcond=None)[0] / size
    left, freedom = values - design @ found, len(values) - design.shape[1]
    excess, noise = 1.0, float("nan")
    if stated_sd is not None:
        stated = np.broadcast_to(stated_sd, left.shape)
        excess = exceed_stated(float(((left / stated) ** 2).sum()), freedom, 1.0)
        noise = excess * float(np.sqrt((stated**2).mean()))
    elif freedom > 0:
        noise = float(np.sqrt(left @ left / freedom)) * compute_widening(freedom)
    return Regression(found, noise**2 * inverse, freedom, excess, left)


def fit_transits(
    setting_deg: Array,
    product: Array,
    product_sd: Array | None,
    constant: float | None = None,
    constant_sd: float = 0.0,
) -> tuple[North, float, float]:
    """North N = N′ + c a Δt of n transits, with c and its standard error. Where c is not given it
    comes from the settings: a Δt = (N − N′)/c is a straight line in N′, and N where it crosses
    zero; of two settings c = (N′₂ − N′₁)/(a₁Δt₁ − a₂Δt₂). The noise is that of a Δt, `product_sd`,
    unless transits scatter by more, or else that of the spread."""
    ones = np.ones(len(product))
    if constant is not None:
        stated = None if product_sd is None else constant * product_sd
        mean = regress(ones[:, None], setting_deg + constant * product, stated)
        sd = float(np.hypot(np.sqrt(mean.covariance[0, 0]), constant_sd * product.mean()))
        north = North(float(mean.found[0]), sd, mean.freedom, mean.excess)
        return north, constant, constant_sd
    middle = float(setting_deg.mean())
    line = regress(np.stack([ones, setting_deg - middle], axis=1), product, product_sd)
    height, slope = line.found
    by_line = np.array([-1 / slope, height / slope**2])
    sd = float(np.sqrt(by_line @ line.covariance @ by_line))
    north = North(middle - float(height / slope), sd, line.freedom, line.excess)
    return north, float(-1 / slope), float(np.sqrt(line.covariance[1, 1])) / slope**2


def fit_swing(time_s: Array, reading_deg: Array, reading_sd: float | None = None) -> Swing:
    """The damped sinusoid through a whole record (n,), by Levenberg–Marquardt. The noise is taken
    from the residuals, with their correlation, unless it is stated and they scatter by no more."""
    since = time_s - time_s[0]
    start = _start(since, reading_deg)
    pieces = partial(_pieces, since, reading_deg)
    scale = reading_sd or max(float(np.std(reading_deg)), 1e-9) * 1e-2
    first = leastsq.solve(lambda p: [pieces(p)], start, scale=scale, tolerance=1e-6)
    freedom = max(len(since) - len(start), 1)
    squares = float(first.residuals @ first.residuals)
    excess = exceed_stated(squares, freedom, reading_sd) if reading_sd else 1.0
    noise = excess * (reading_sd or max(float(np.sqrt(squares / freedom)), 1e-12))
    correlation = correlation_length(first.residuals, np.ones(len(since)))
    _, jacobian = pieces(first.params)
    covariance = noise**2 * correlation * leastsq.inverse(jacobian.T @ jacobian)
    drift = _drift(since, first.residuals, jacobian) if first.converged else ()
    sd = float(np.sqrt(covariance[0, 0]))
    north = North(float(first.params[0]), sd, len(since) - len(start), excess, *drift)
    found = first.params, covariance, first.residuals, noise
    return Swing(*found, correlation, first.converged, north)


def _drift(since: Array, residuals: Array, jacobian: Array) -> tuple[float, float]:
    """How far N moves, linearly, over the record, by what the swing leaves; its standard error.
    Residuals are the swing less the readings. The noise is that left beside the drift."""
    line = regress(np.column_stack([jacobian, since / since[-1] - 0.5]), -residuals)
    correlation = correlation_length(line.left, np.ones(len(line.left)))
    return float(line.found[-1]), float(np.sqrt(correlation * line.covariance[-1, -1]))


def evaluate_swing_deg(params: Array, since_s: Array) -> Array:
    """N + e^(−λt) (p cos ωt + q sin ωt) at seconds since the first reading, (n,)."""
    north, p, q, decay, omega = params
    phase = omega * since_s
    return np.asarray(north + np.exp(-decay * since_s) * (p * np.cos(phase) + q * np.sin(phase)))


def _pieces(since: Array, reading: Array, params: Array) -> tuple[Array, Array]:
    """Residuals and Jacobian by N, p, q, λ, ω."""
    _, p, q, decay, omega = params
    damped = np.exp(-decay * since)
    cosine, sine = damped * np.cos(omega * since), damped * np.sin(omega * since)
    wave, slope = p * cosine + q * sine, q * cosine - p * sine
    jacobian = np.stack([np.ones_like(since), cosine, sine, -since * wave, since * slope], axis=1)
    return params[0] + wave - reading, jacobian


def _start(since: Array, reading: Array) -> Array:
    """The undamped sinusoid of the frequency, among many from 0.4 periods in the record on, that
    leaves least."""
    span = float(since[-1])
    highest = np.pi / max(float(np.median(np.diff(since))), span / 200)
    trials = np.geomspace(0.4 * 2 * np.pi / span, highest, 400)
    phase = np.multiply.outer(trials, since)
    designs = np.stack([np.ones_like(phase), np.cos(phase), np.sin(phase)], axis=-1)
    basis = np.linalg.qr(designs).Q
    along = (reading - reading.mean()) @ basis  # the mean is in every design
    best = int(np.argmax((along**2).sum(axis=-1)))
    linear, *_ = np.linalg.lstsq(designs[best], reading, rcond=None)
    return np.array([*linear, 0.0, trials[best]])


class Pointing(NamedTuple):
    """The mean direction of readings in both faces, the collimation, standard errors; degrees."""

    reading_deg: float
    sd_deg: float
    collimation_deg: float
    freedom: int
    excess: float = 1.0


def average_faces(reading_deg: Array, reading_sd: float | None = None) -> Pointing:
    """A sighting read in one or both faces: those of the second stand half a turn away. A line of
    sight that is off by the collimation reads too much in the first face and as much too little in
    the second, so the mean of the faces is free of it. The face of the first reading is the
    first."""
    off = (reading_deg - reading_deg[0] + 180.0) % 360.0 - 180.0
    second = np.abs(off) > 90.0
    off = np.where(second, (off + 360.0) % 360.0 - 180.0, off)
    design = np.stack([np.ones(len(off)), np.where(second, -1.0, 1.0)], axis=1)
    if not second.any():
        design = design[:, :1]
    mean = regress(design, off, reading_sd)
    collimation = float(mean.found[1]) if second.any() else float("nan")
    reading = float((reading_deg[0] + mean.found[0]) % 360.0)
    sd = float(np.sqrt(mean.covariance[0, 0]))
    return Pointing(reading, sd, collimation, mean.freedom, mean.excess)
