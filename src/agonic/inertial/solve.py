"""The estimate from samples, acceleration and rates: felt first, then with the attitude free."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.arrays import Array, Mask
from agonic.attitude.problem import estimate_usable
from agonic.calibration.setup import LATENCY_SD_S
from agonic.inertial.attitude import Inertial, estimate_attitude, find_parts
from agonic.inertial.maths.factors import GRAVITY_SD, Log
from agonic.inertial.maths.joint import Joint, estimate_jointly, estimate_part
from agonic.inertial.problem import (
    INCLINATION_SD,
    NODDING_S,
    Settings,
    orient,
    pose,
    with_tilt,
    without_errors,
)
from agonic.inertial.start import (
    Solved,
    choose_speed,
    find_field,
    make_dipping,
    pose_felt,
    thin_out,
)
from agonic.maths.equation.affine import FREE
from agonic.maths.equation.channels import Problem, compute_residuals
from agonic.maths.equation.coverage import KEEPS_LEVEL
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.maths.estimation.loss import squares, tukey
from agonic.maths.estimation.noise.residuals import estimate_noise
from agonic.maths.rotations.attitude import make_rotation
from agonic.maths.rotations.vectors import skew
from agonic.reference import Reference
from agonic.samples import Samples
from agonic.units import STANDARD_GRAVITY_M_S2

_STEADY = 1e-3
"""Weight of no turn about the mean down, which downs that hardly differ do not tell."""


def keep_level(solved: Solved) -> Solved:
    """The estimate in axes whose level is the one that the accelerometer reads, bias and all. A
    matrix without a turn of its own cannot be turned, and stays; so does that of a sensor which was
    turned all ways. An accelerometer's bias b is taken out of every down d before the field is
    compared with it, but whoever takes a heading has the tilt from the accelerometer as it reads.
    On a vehicle that stays near level the two differ by one turn of all rows, which the bias and
    the turn between the sensors share as they like. So the calibration is turned along, W → exp(ρ)
    W: then what is not known of b does not touch the heading either. The turn that leaves least of
    the downs' differences δd is

        Σ |δd − ρ × d|² → min,   δd = −(b − (b·d) d)/g,   (1 − ⟨d dᵀ⟩) ρ = −⟨d⟩ × b/g.
    """
    problem = solved.problem
    near = float(np.linalg.norm(solved.felt.down.mean(axis=0))) > KEEPS_LEVEL
    if problem.gauge != FREE or problem.model != "full" or not near:
        return solved
    lean = find_lean(solved.felt.down)
    turn = make_rotation(lean @ solved.errors[:3])
    # the attitude that was felt, in turned axes; an error of the bias leans these as well
    down, ahead = solved.felt.down @ turn.T, solved.felt.ahead
    down_by = turn @ solved.felt.down_by
    down_by[:, :, :3] += skew(down) @ lean
    ahead = None if ahead is None else ahead @ turn.T
    felt = solved.felt._replace(down=down, down_by=down_by, ahead=ahead)
    assert problem.shared is not None
    tilted = with_tilt(solved.samples, felt)
    posed = pose(tilted, solved.reference, felt, solved.settings, problem.shared.taken_out)
    solution = solved.found.solution
    jacobian = _turn_parameters(solved, turn, lean)
    m = problem.basis.shape[1]
    params = solution.params.copy()
    params[:m] = jacobian[:m, :m] @ params[:m]
    back = np.linalg.inv(jacobian)
    solution = solution._replace(
        params=params,
        covariance=jacobian @ solution.covariance @ jacobian.T,
        information=back.T @ solution.information @ back,
    )
    return solved._replace(
        found=solved.found._replace(solution=solution),
        problem=posed[0],
        scale=posed[1],
        samples=tilted,
        felt=felt,
    )


def find_lean(down: Array) -> Array:
    """The turn of level by each m/s² of an accelerometer's bias, (3, 3) rad."""
    mean = down.mean(axis=0)
    told = np.eye(3) - down.T @ down / len(down) + _STEADY * np.outer(mean, mean)
    return np.asarray(-np.linalg.solve(told, skew(mean)) / STANDARD_GRAVITY_M_S2) + 0.0


def _turn_parameters(solved: Solved, turn: Array, lean: Array) -> Array:
    """Derivatives (p, p) of the parameters in turned axes by those before: W' = exp(lean b) W."""
    problem, p = solved.problem, len(solved.found.solution.params)
    basis = problem.basis
    m, first = basis.shape[1], p - len(solved.sds)
    turned = np.eye(12)
    turned[3:, 3:] = np.kron(turn, np.eye(3))
    jacobian = np.eye(p)
    back = np.linalg.pinv(basis)
    jacobian[:m, :m] = back @ turned @ basis
    matrix = (turned @ basis @ solved.found.solution.params[:m])[3:].reshape(3, 3)
    by_bias = np.stack([(skew(axis) @ matrix).ravel() for axis in lean.T], axis=1)
    jacobian[:m, first : first + 3] = back[:, 3:] @ by_bias * solved.sds[:3]
    return jacobian


def solve(samples: Samples, reference: Reference | None, settings: Settings) -> Solved:
    """The estimate: first beside the attitude that is felt, then with the attitude free. Without
    horizontal and vertical intensity these are found first; an error of a known dip, of the
    reference's standard deviation, is one unknown of all rows. What is left of a delay is another:
    a log may read its sensors anywhere between two of its rows."""
    if samples.time is not None and len(samples) > 1:
        interval = float(np.median(np.diff(samples.time)))
        settings = replace(settings, delay_sd_s=float(np.hypot(LATENCY_SD_S, interval / 12**0.5)))
    near = None
    if reference is None or reference.values.ndim == 1:
        settings = replace(settings, inclination_sd=INCLINATION_SD)
        reference, near = find_field(samples, reference, settings)
    elif samples.rotation_rate is not None:
        size = float(reference.magnitudes(len(samples)).mean())
        settings = replace(settings, inclination_sd=reference.sd / size)
    solved = choose_speed(samples, reference, settings, near)
    return free_attitude(solved) if solved.felt.ahead is not None else solved


def solve_part(whole: Solved, among: Mask) -> Solved:
    """The same from some of the readings (n,), beside all that the inertial unit recorded; what the
    whole found of noise, and of the unit where no attitude is free, holds for them too."""
    found = whole.found
    if whole.joined is None:
        some = whole.usable & among
        some = some if whole.felt.ahead is None else thin_out(some)
        start = found.solution.params
        found = estimate_usable(whole.problem, some, whole.settings, start)
    else:
        found = _move(found, *estimate_part(*whole.joined, among))
    return keep_level(whole._replace(found=found))


def free_attitude(solved: Solved) -> Solved:
    """The joint estimate, attitudes free, from the one beside the attitude that was felt."""
    found, samples = solved.found, solved.samples
    assert samples.time is not None
    params, q = found.solution.params, len(solved.sds)
    felt = estimate_attitude(without_errors(samples, solved.errors))
    try:
        joint = _estimate(solved, felt)
    except np.linalg.LinAlgError:
        return solved._replace(usable=thin_out(solved.usable), contradictory=True)
    p = len(params)
    taken_out, reference = joint.params[p - q : p], solved.reference
    again = estimate_attitude(without_errors(samples, taken_out * solved.sds))
    if solved.settings.inclination_sd:
        if solved.settings.inclination_free:
            level, below = reference.values.T
            dip = float(np.arctan2(below, level).mean() + taken_out[-1] * solved.sds[-1])
            reference = make_dipping(np.hypot(level, below), dip)
        taken_out[-1] = 0.0  # of a reference that is known the offset stays among the unknowns
    tilted, _, problem, scale = pose_felt(samples, reference, again, solved.settings, taken_out)
    return solved._replace(
        found=_compare(_move(found, joint.params, joint.covariance), problem, solved.usable, joint),
        problem=problem,
        scale=scale,
        samples=tilted,
        reference=reference,
        felt=again,
        gain=joint.gain,
        tilt_noise=joint.tilt_noise,
        walk_deg=float(np.degrees(joint.sds[2] * np.sqrt(np.median(np.diff(samples.time))))),
        joined=(solved.problem, joint),
    )


def _move(found: Estimate, params: Array, covariance: Array) -> Estimate:
    """The estimate with the parameters of a joint one, which has further ones after them."""
    p = len(found.solution.params)
    solution = found.solution._replace(params=params[:p], covariance=covariance[:p, :p])
    return found._replace(solution=solution)


def _estimate(solved: Solved, felt: Inertial) -> Joint:
    samples, params = solved.samples, solved.found.solution.params
    noise, stretch_sd = solved.found.noise["magnitude"], solved.settings.accelerometer_scale_sd
    loss = noise.loss if solved.found.weights.all() else tukey()  # outliers of the start are back
    # what each reading counts at the start, by its magnitude
    rows, weights = np.flatnonzero(solved.usable), np.zeros(len(solved.usable))
    left = compute_residuals(solved.problem.subset(rows), "magnitude", params)
    weights[rows] = loss.weight((left / noise.sd) ** 2)
    gains = GRAVITY_SD * np.eye(3)[None]
    if stretch_sd is not None:
        gains = np.concatenate([gains, stretch_sd * np.eye(9).reshape(9, 3, 3)])
    time, force, rate = samples.time, samples.acceleration, samples.rotation_rate
    assert time is not None
    assert force is not None
    assert rate is not None
    noises, parts = (felt.force_sd, felt.rate_sd), find_parts(time)
    log = Log(time, force, rate, parts, *noises, solved.sds, gains, NODDING_S, solved.headings)
    return estimate_jointly(
        solved.problem,
        log,
        params,
        orient(solved.problem, samples, felt, params),
        weights,
        noise.sd,
        loss,
        solved.settings.robust,
    )


def _compare(found: Estimate, problem: Problem, usable: Mask, joint: Joint) -> Estimate:
    """The estimate with residuals, noise and weights of each channel, on all usable rows."""
    part = problem if usable.all() else problem.subset(np.flatnonzero(usable))
    params, noise, residuals = found.solution.params, {}, {}
    weights = joint.weights[usable]
    for channel, before in found.noise.items():
        left = compute_residuals(part, channel, params)
        unknowns = len(params) + part.eliminated.get(channel, 0)
        robust = before.loss != squares() or not found.weights.all()
        least = max(part.rounding, 1e-9)
        one = estimate_noise(left, robust, unknowns, None, least)
        noise[channel], residuals[channel] = one, left
        weights = np.minimum(weights, one.loss.weight((left / one.sd) ** 2))
    noise["magnitude"] = noise["magnitude"]._replace(sd=float(joint.sds[0]))
    return found._replace(noise=noise, residuals=residuals, weights=weights)
