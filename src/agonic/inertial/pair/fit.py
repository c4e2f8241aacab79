"""`fit_pair`: an accelerometer and a magnetometer, calibrated together from attitudes at rest."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

from agonic.arrays import Array, Index
from agonic.health.finding import find_facts
from agonic.inertial.maths.shots import (
    DIP,
    MATRIX_M,
    SIGHT,
    Shots,
    differentiate,
    linearise,
    observe,
    split,
)
from agonic.inertial.pair.problem import Problem, Settings, pose
from agonic.inertial.pair.result import FACTS, PairFit, Sight, Solved, describe, find_prior_only
from agonic.inertial.pair.solve import (
    METHOD,
    Solution,
    compare_shots,
    find_outlier,
    make_pair,
    point_ahead,
    solve,
    widen,
)
from agonic.logs.any_form import Given, as_samples
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.maths.rotations.vectors import skew
from agonic.provenance import Provenance
from agonic.reference import Reference
from agonic.samples import Samples

STEEPEST_DEG = 60.0
_INCLINED = np.arange(-STEEPEST_DEG, STEEPEST_DEG + 1.0, 30.0)
_AROUND = np.arange(0.0, 360.0, 45.0)


def face(unknowns: Array, body: Array, angles_deg: Array) -> tuple[Array, Array]:
    """Up and field (k, 3) that the sensors should see in attitudes by azimuth, pitch and roll
    (k, 3), degrees, of the sight; `body` (3, 3) turns the accelerometer's axes into the
    instrument's."""
    rot_nb = Rotation.from_euler("ZYX", angles_deg, degrees=True)
    dip = unknowns[DIP]
    up = rot_nb.apply([0.0, 0.0, -1.0], inverse=True) @ body
    field = rot_nb.apply([np.cos(dip), 0.0, np.sin(dip)], inverse=True) @ body
    return up, field


def list_directions() -> Array:
    """Azimuth, pitch and roll (k, 3), degrees, of all directions within 60° of level."""
    grid = np.meshgrid(_AROUND, _INCLINED, _AROUND, indexing="ij")
    return np.stack([part.ravel() for part in grid], axis=1).astype(np.float64)


TO_ADD = 6
_PITCHES, _AZIMUTHS = (-90.0, -45.0, 0.0, 45.0, 90.0), (0.0, 90.0, 180.0, 270.0)
_ROLLS = tuple(float(roll) for roll in range(-135, 181, 45))
POINTS = {0.0: "north", 90.0: "east", 180.0: "south", 270.0: "west"}
_PITCHED = {
    -90.0: "straight down",
    -45.0: "45° down",
    0.0: "level",
    45.0: "45° up",
    90.0: "straight up",
}


def choose_attitudes(
    unknowns: Array, covariance: Array, theta: Array, body: Array, target: Array
) -> Array:
    """Azimuth, pitch and roll (k, 3), degrees, of attitudes that lower tr(C T) most, in turn."""
    angles = np.array([(a, p, r) for p in _PITCHES for a in _AZIMUTHS for r in _ROLLS])
    jacobian, variance = _observe(unknowns, theta, *face(unknowns, body, angles))
    chosen = []
    for _ in range(TO_ADD):
        spread = jacobian @ covariance
        inner = np.linalg.inv(variance + spread @ np.swapaxes(jacobian, 1, 2))
        gain = np.einsum("nij,njk,kl,nil->n", inner, spread, target, spread)
        best = int(np.argmax(gain))
        chosen.append(best)
        covariance = covariance - spread[best].T @ inner[best] @ spread[best]
    return angles[chosen]


def _observe(unknowns: Array, theta: Array, up: Array, seen: Array) -> tuple[Array, Array]:
    """Jacobian (n, 3, q) and variance (n, 3, 3) of shots at attitudes, without any target."""
    bias_a, shape, bias_m, matrix = split(unknowns)
    force = up @ np.linalg.inv(shape).T + bias_a
    field = seen @ np.linalg.inv(matrix).T + bias_m
    shots = Shots(force, field, np.full(len(force), -1))
    found = linearise(shots, unknowns[: SIGHT.stop])
    jacobian = np.zeros((len(force), 3, len(unknowns)))
    jacobian[:, :, : SIGHT.stop] = found.jacobian[:, :3]
    return jacobian, np.einsum("k,knij->nij", theta, found.variances)[:, :3, :3]


def describe_attitude(azimuth: float, pitch: float, roll: float) -> str:
    """An attitude in words."""
    if abs(pitch) == 90:  # the nose has no azimuth, the upper side has
        return f"nose {_PITCHED[pitch]}, turned by {int(azimuth - np.sign(pitch) * roll) % 360}°"
    side = "left" if roll < 0 else "right"
    rolled = {0.0: "", 180.0: ", upside down"}.get(roll, f", rolled {abs(roll):g}° {side}")
    return f"nose {POINTS[azimuth]}, {_PITCHED[pitch]}{rolled}"


def fit_pair(
    samples: Given,
    reference: Reference | ArrayLike | None = None,
    *,
    accelerometer_bias_sd: float = 0.05,
    accelerometer_shape_sd: float = 0.02,
    soft_iron_sd: float = 0.1,
    turn_sd_deg: float = 5.0,
) -> PairFit:
    """Accelerometer and magnetometer calibrated together, from shots: attitudes at rest.

        up = A (acc − b_a),  field = M (mag − b_m):   |up| = g,  |field| = F,  their angle constant,

    and where shots were taken with the sight kept on a target, rolled about it, the direction of
    the sight is the same at every roll. No attitude need be known. Noise of both sensors and of
    pointing are estimated; a shot that the others contradict is left out and named.

    Parameters
    ----------
    samples : with `acceleration`, a row a shot, or rows by `station`, or a recording with times
        whose stretches at rest are the shots; twelve attitudes or more, 24 are good. `target`
        numbers the target of each shot, 0 for none.
    reference : the magnitude, one or (n,), nT, or the field of the place with its dip; or `None`.
    accelerometer_bias_sd, accelerometer_shape_sd : standard deviations of the priors on the
        accelerometer's biases, in g, and on its scales and cross terms.
    soft_iron_sd : that of the prior on the magnetometer's matrix. turn_sd_deg : that of the turn
        between the sensors, after one by right angles.

    Returns a `PairFit`. Raises `LogError` without acceleration, `CoverageError` with fewer than
    twelve attitudes, `ConvergenceError` where no calibration makes sense of them.

    Source: M. Kok, T. B. Schön, IEEE Sensors Journal 16(14), 2016, for the constant angle; the
    rolled sets after P. Underwood, CREG Journal 114, 2021; noise by restricted likelihood (Zhou,
    Hu, Zhou & Lange 2019).

    Examples
    --------
    >>> from agonic.inertial.pair.simulate import simulate_shots
    >>> made = simulate_shots(seed=1)
    >>> fit = fit_pair(made.samples)
    >>> fit.n, bool(fit.heading_sd_deg < 0.5), len(fit.left_out)
    (24, True, 0)
    """
    samples, reference = as_samples(samples), Reference.of(reference)
    settings = Settings(accelerometer_bias_sd, accelerometer_shape_sd, soft_iron_sd, turn_sd_deg)
    problem = pose(samples, reference, settings)
    solution = solve(problem)
    fit = _make_fit(samples, reference, settings, problem, solution)
    solved = Solved(fit, problem, find_outlier(solution) is not None)
    fit = replace(fit, findings=tuple(find_facts(FACTS, solved)))
    return fit if fit.verdict == "refused" else replace(fit, remarks=describe(fit))


def _make_fit(
    samples: Samples,
    reference: Reference | None,
    settings: Settings,
    problem: Problem,
    solution: Solution,
) -> PairFit:
    """The result, before it is examined."""
    sighted = problem.shots.targets > 0
    magnitude = None if reference is None else float(reference.magnitudes(len(samples)).mean())
    provenance = Provenance(
        inputs=(samples.origin,),
        settings={"fit": "pair", "sight": sighted, **asdict(settings)},
        method=METHOD,
    )
    pair = make_pair(samples, problem, solution, magnitude, sighted, provenance)
    covariance, unknowns = widen(solution), solution.unknowns
    body = point_ahead(unknowns[SIGHT]) if sighted else np.eye(3)
    slope, azimuth = _average_information(unknowns, body, sighted)
    prior_only = find_prior_only(problem, solution.weighted.covariance)
    target = slope + azimuth
    add = choose_attitudes(unknowns, covariance, solution.noise**2, body, target)
    # the dip with the prior of the place taken out again
    known, dip = problem.prior.information[DIP, DIP], float(unknowns[DIP])
    variance = float(solution.weighted.covariance[DIP, DIP])
    left = 1 / variance - known
    free_dip = (dip / variance - known * problem.prior.mean[DIP]) / left
    across = max(float(np.linalg.eigvalsh(covariance[SIGHT, SIGHT])[-1]), 0.0)
    sd_deg, scatter_deg = np.degrees([np.sqrt(across), solution.noise[2]]).tolist()
    sight = Sight(axis=unknowns[SIGHT].copy(), sd_deg=sd_deg, scatter_deg=scatter_deg)
    left_axes, _, right_axes = np.linalg.svd(split(unknowns)[3])
    return PairFit(
        calibration=pair.magnetometer,
        accelerometer=pair.accelerometer,
        covariance=pair.covariance,
        rot_am=left_axes @ right_axes,
        turn_sd_deg=_turn_sd_deg(unknowns, covariance),
        inclination_deg=float(np.degrees(dip)),
        inclination_sd_deg=float(np.degrees(np.sqrt(covariance[DIP, DIP]))),
        free_inclination_deg=float(np.degrees(free_dip)),
        free_inclination_sd_deg=float(np.degrees(np.sqrt(1 / left))),
        sight=sight if sighted else None,
        noise=np.array([pair.accelerometer.noise, pair.magnetometer.noise]),
        heading_sd_deg=_rms_deg(covariance, azimuth),
        slope_sd_deg=_rms_deg(covariance, slope),
        residuals=compare_shots(problem, solution),
        shot=_number_shots(samples, problem),
        target=np.array([0, *problem.names]).astype(np.intp)[problem.shots.target + 1],
        left_out=np.setdiff1d(np.arange(len(problem.rows)), solution.kept),
        prior_only=prior_only,
        to_add=tuple(dict.fromkeys(describe_attitude(*map(float, one)) for one in add)),
    )


def _average_information(unknowns: Array, body: Array, sighted: bool) -> tuple[Array, Array]:
    """Mean of jᵀj (q, q) of slope and azimuth over all directions, each as large a part of all;
    j = ∂(slope, azimuth)/∂(unknowns), targets' own unknowns left out."""
    angles, targets = list_directions(), (len(unknowns) - SIGHT.stop) // 2
    seen = face(unknowns, body, angles)
    moved = differentiate(observe(*seen, unknowns[SIGHT]), unknowns, *seen, targets)
    if not sighted:
        moved[:, :, SIGHT] = 0.0
    weight = np.cos(np.radians(angles[:, 1]))
    weight = weight / weight.sum()
    slope, azimuth = (np.einsum("k,ki,kj->ij", weight, moved[:, k], moved[:, k]) for k in (3, 4))
    return slope, azimuth


def _number_shots(samples: Samples, problem: Problem) -> Index:
    """The number by which a person finds each shot: its station, else its row, from 1."""
    first = np.array([own[0] for own in problem.rows])
    if samples.station is not None:
        return np.asarray(samples.station[first].astype(np.intp))
    one_each = all(len(own) == 1 for own in problem.rows)
    return np.asarray(first + 1 if one_each else np.arange(1, len(first) + 1))


def _rms_deg(covariance: Array, information: Array) -> float:
    return float(np.degrees(np.sqrt(np.einsum("ij,ji->", covariance, information))))


def _turn_sd_deg(unknowns: Array, covariance: Array) -> Array:
    """Standard errors (3,), degrees, of the turn of the magnetometer about each axis. A small turn
    w on the left of M = R S changes it by [w]× M, whose antisymmetric part in the axes after R is
    what a change of M holds of it: to first order in soft iron."""
    matrix = split(unknowns)[3]
    rotation, symmetric = polar(matrix)
    turns = np.stack([(skew(axis) @ rotation @ symmetric).ravel() for axis in np.eye(3)], axis=1)
    shapes = (rotation @ unpack_symmetric(np.eye(6))).reshape(6, 9).T
    onto = np.linalg.inv(np.hstack([turns, shapes]))[:3]
    spread = onto @ covariance[MATRIX_M, MATRIX_M] @ onto.T
    return np.asarray(np.degrees(np.sqrt(np.diag(spread))))
