"""`check_pair`: whether a setup still holds, by a few shots before a survey; what may have changed
in the instrument, and what that does to headings."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import chdtrc

from agonic.arrays import Array, Index
from agonic.calibration.affine import Affine
from agonic.calibration.base import require_covariance
from agonic.calibration.setup import Setup
from agonic.errors import AgonicError, CoverageError, UnitError
from agonic.health import Finding, Judged, figure
from agonic.inertial.maths.shots import BIAS_A, BIAS_M, DIP, TARGETS, Shots, linearise, observe
from agonic.inertial.pair.fit import list_directions
from agonic.inertial.pair.problem import average_shots, begin, number_targets
from agonic.logs.any_form import Given, as_samples
from agonic.maths.equation.affine import correction_jacobian, model_basis
from agonic.maths.rotations.vectors import skew
from agonic.readable import Shown
from agonic.samples import Samples
from agonic.units import STANDARD_GRAVITY_M_S2

AHEAD = np.eye(3)[0]


class Suspect(NamedTuple):
    """Three numbers that may have changed: ∂residuals (r, 3), and ∂azimuth of x (k, 3), rad."""

    name: str
    unit: str
    by: Array
    moved: Array


class Change(NamedTuple):
    """A change that would explain the shots: what, how large (3,), and its sd. `turns_deg` is what
    it does to headings within 60° of level, rms; `chance` the probability that no change explains
    as much by it."""

    name: str
    size: Array
    sd: Array
    unit: str
    turns_deg: float
    chance: float


def list_suspects(
    by_setup: Array, accelerometer: Affine, magnetometer: Affine, dip: float
) -> tuple[Suspect, ...]:
    """The bias of each sensor, and the turn between the two."""
    rot_nb = Rotation.from_euler("ZYX", list_directions(), degrees=True)
    up = rot_nb.apply([0.0, 0.0, -1.0], inverse=True)
    field = rot_nb.apply([np.cos(dip), 0.0, np.sin(dip)], inverse=True)
    channels = observe(up, field, AHEAD)
    by_up, by_field = channels.by_up[:, 4], channels.by_field[:, 4]
    size, degree = float(magnetometer.magnitude or 1.0), np.radians(1.0)
    turns = np.stack([(skew(axis) @ magnetometer.matrix).ravel() for axis in np.eye(3)], axis=1)
    onto = model_basis("full", magnetometer.gauge)[3:, 3:].T @ turns * degree
    by_bias = -by_field @ magnetometer.matrix / size
    by_force = -by_up @ accelerometer.matrix / STANDARD_GRAVITY_M_S2
    by_turn = np.cross(field, by_field) * degree
    unit = magnetometer.unit_in
    return (
        Suspect("the magnetometer's bias", unit, by_setup[:, 12:15], by_bias),
        Suspect("the accelerometer's bias", "m/s²", by_setup[:, :3], by_force),
        Suspect("the turn between the sensors", "°", by_setup[:, 15:] @ onto, by_turn),
    )


def estimate_change(suspect: Suspect, projector: Array, residuals: Array) -> tuple[Change, float]:
    """The change at its best: (HᵀPH)⁻¹HᵀPy, and what it explains, a χ² of three; and three standard
    errors of it, as it turns headings, rms degrees."""
    information = suspect.by.T @ projector @ suspect.by
    spread = np.linalg.pinv(information, rcond=1e-10, hermitian=True)
    # residuals are what the setup assumes against the truth: the truth is the other way
    size = -spread @ (suspect.by.T @ projector @ residuals)
    gain = -float(residuals @ projector @ suspect.by @ size)
    variance = np.einsum("ki,ij,kj->k", suspect.moved, spread, suspect.moved)
    turns_deg, sd_deg = np.degrees(np.sqrt([np.mean((suspect.moved @ size) ** 2), variance.mean()]))
    sd, unit, chance = np.sqrt(np.diag(spread)), suspect.unit, float(chdtrc(3, gain))
    return Change(suspect.name, size, sd, unit, float(turns_deg), chance), float(3 * sd_deg)


MIN_SHOTS = 6
RARE, ODD = 1e-3, 0.01
"""Probabilities: of an alarm where nothing changed, and of what one shot may explain."""
SPOILS_DEG = 2.0
"""A change of the heading beyond which the setup is of no use."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PairCheck(Judged):
    """The result of `check_pair`.

    `statistic` is the χ² of `freedom` residuals with the errors that the setup states, `chance` the
    probability of one as large where nothing changed. `changes` are what could explain it,
    likeliest first. `seen_deg` is the change of headings, by another bias of the magnetometer, that
    these shots would have shown. `odd` are indices of shots that alone explain it; `shot` (n,)
    their numbers.
    """

    statistic: Annotated[float, Shown()]
    freedom: Annotated[int, Shown()]
    chance: Annotated[float, Shown()]
    changes: tuple[Change, ...]
    seen_deg: Annotated[float, Shown()]
    odd: Index
    shot: Index
    findings: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = ()


class _Linear(NamedTuple):
    """Residuals (r,), by the setup's errors (r, 24), by what is free (r, f), and noise (r, r).
    `shot` (r,) is the shot of each; `dip` of the field, rad."""

    residuals: Array
    by_setup: Array
    by_free: Array
    noise: Array
    shot: Index
    dip: float

    def without(self, shot: int) -> _Linear:
        """The residuals of the other shots."""
        keep = self.shot != shot
        return self._replace(
            residuals=self.residuals[keep],
            by_setup=self.by_setup[keep],
            by_free=self.by_free[keep],
            noise=self.noise[np.ix_(keep, keep)],
            shot=self.shot[keep],
        )


def check_pair(samples: Given, setup: Setup, *, pointing_sd_deg: float = 0.2) -> PairCheck:
    """Whether accelerometer and magnetometer still are what a setup says, by a few shots at rest.

        χ² = yᵀ (V + J C Jᵀ)⁻¹ y

    over the size of gravity, of the field, the angle between them, and the direction of the sight
    on each target; V is the noise of the shots, C the covariance that the setup states. The field
    of the place and the targets are free.

    Parameters
    ----------
    samples : as for `fit_pair`, six shots or more in attitudes far from each other; eight are good.
    setup : with the calibration of the accelerometer, as `fit_pair` makes it.
    pointing_sd_deg : of the sight on a target.

    Returns a `PairCheck`: good where nothing speaks against the setup; else the change that
    explains the shots best. Raises `AgonicError` for a setup without an accelerometer's
    calibration, `CoverageError` with too few shots.

    Source: score tests for a change, after C. R. Rao, Proceedings of the Cambridge Philosophical
    Society 44, 1948.

    >>> from agonic.inertial.pair.fit import fit_pair
    >>> from agonic.inertial.pair.simulate import simulate_shots
    >>> setup = fit_pair(simulate_shots(seed=2).samples).make_setup()
    >>> later = simulate_shots(seed=2, attitudes=8, targets=0, survey=1)
    >>> check_pair(later.samples, setup).verdict
    'good'
    """
    samples = as_samples(samples)
    accelerometer, magnetometer = _calibrations(samples, setup)
    linear, shot = _pose(samples, accelerometer, magnetometer, pointing_sd_deg)
    covariance = np.zeros((24, 24))
    covariance[:12, :12] = require_covariance(accelerometer.covariance)
    covariance[12:, 12:] = require_covariance(magnetometer.covariance)
    projector, statistic, freedom = _test(linear, covariance)
    chance = float(chdtrc(freedom, statistic))
    suspects = list_suspects(linear.by_setup, accelerometer, magnetometer, linear.dip)
    changes = [estimate_change(one, projector, linear.residuals) for one in suspects]
    odd = (ODD, -1)  # the one shot without which the others agree with the setup, if there is one
    for i in range(len(shot) if chance < RARE else 0):
        _, without, own = _test(linear.without(i), covariance)
        odd = max(odd, (float(chdtrc(own, without)), i))
    check = PairCheck(
        statistic=statistic,
        freedom=freedom,
        chance=chance,
        changes=tuple(sorted((one for one, _ in changes), key=lambda change: change.chance)),
        seen_deg=changes[0][1],
        odd=np.array([odd[1]] if odd[1] >= 0 else [], dtype=np.intp),
        shot=shot,
    )
    return _judge(check)


def _calibrations(samples: Samples, setup: Setup) -> tuple[Affine, Affine]:
    """Of the accelerometer and of the magnetometer that the samples are of."""
    if setup.accelerometer is None:
        raise AgonicError(
            "the setup has no calibration of an accelerometer; make one with agonic fit pair"
        )
    named = [c.calibration for c in setup.compasses if c.sensor == samples.name]
    found = (named or [setup.compasses[0].calibration])[0]
    if not isinstance(found, Affine):
        raise AgonicError(f"a {found.kind} calibration cannot be checked so; give an affine one")
    if samples.unit != found.unit_in:
        raise UnitError(
            f"the setup is for readings in {found.unit_in} and these are in {samples.unit}; read "
            "them with the unit of the setup"
        )
    return setup.accelerometer, found


def _pose(
    samples: Samples, accelerometer: Affine, magnetometer: Affine, pointing_sd_deg: float
) -> tuple[_Linear, Index]:
    """The residuals of the shots, and their numbers."""
    rows, force, reading = average_shots(samples)
    if len(rows) < MIN_SHOTS:
        raise CoverageError(
            f"{len(rows)} shots at rest were given and {MIN_SHOTS} are needed, better eight",
            turns="level towards four directions, and the same upside down",
        )
    up = accelerometer.correct(force) / STANDARD_GRAVITY_M_S2
    seen = magnetometer.correct(reading)
    size = float(np.median(np.linalg.norm(seen, axis=1)))
    sighted = bool(accelerometer.provenance.settings.get("sight"))
    target = number_targets(samples, rows)[0] if sighted else np.full(len(rows), -1)
    shots = Shots(up, seen / size, target)
    start = begin(shots, np.eye(3), AHEAD)
    found = linearise(shots, start)
    by_up, by_field = (-found.jacobian[:, :, sensor] for sensor in (BIAS_A, BIAS_M))
    by_setup = np.concatenate(
        [
            by_up @ _local(force, accelerometer) / STANDARD_GRAVITY_M_S2,
            by_field @ _local(reading, magnetometer) / size,
        ],
        axis=2,
    )
    for one in (accelerometer, magnetometer):
        if one.noise is None:
            raise AgonicError(f"the calibration of {one.sensor} does not say its noise")
    scatter = (
        by_up @ accelerometer.matrix * ((accelerometer.noise or 0.0) / STANDARD_GRAVITY_M_S2),
        by_field @ magnetometer.matrix * ((magnetometer.noise or 0.0) / size),
    )
    noise = sum(by @ np.swapaxes(by, 1, 2) for by in scatter)
    noise = noise + found.variances[2] * np.radians(pointing_sd_deg) ** 2
    longer = np.zeros((len(rows), 5, 1))
    longer[:, 1] = 1.0
    free = np.concatenate([longer, found.jacobian[:, :, [DIP]], found.jacobian[:, :, TARGETS:]], 2)
    n, keep = len(rows), found.there.ravel()
    whole = np.zeros((n, 5, n, 5))
    whole[range(n), :, range(n), :] = noise
    linear = _Linear(
        residuals=found.residuals.ravel()[keep],
        by_setup=by_setup.reshape(5 * n, -1)[keep],
        by_free=free.reshape(5 * n, -1)[keep],
        noise=whole.reshape(5 * n, 5 * n)[np.ix_(keep, keep)],
        shot=np.repeat(np.arange(n), 5)[keep],
        dip=float(start[DIP]),
    )
    return linear, np.arange(n) + 1


def _local(raw: Array, calibration: Affine) -> Array:
    """∂(calibrated)/∂(what its covariance is about), (n, 3, 12)."""
    by = correction_jacobian(raw, calibration.bias, calibration.matrix)
    return np.asarray(by @ model_basis("full", calibration.gauge))


def _test(linear: _Linear, covariance: Array) -> tuple[Array, float, int]:
    """P with what is free projected out, χ² and its degrees of freedom."""
    total = linear.noise + linear.by_setup @ covariance @ linear.by_setup.T
    inverse = np.linalg.inv(total)
    across = inverse @ linear.by_free
    projector = np.asarray(inverse - across @ np.linalg.solve(linear.by_free.T @ across, across.T))
    freedom = len(linear.residuals) - int(linear.by_free.shape[1])
    return projector, float(linear.residuals @ projector @ linear.residuals), freedom


def _judge(check: PairCheck) -> PairCheck:
    """The check with its findings and its sentence."""
    if check.chance >= RARE:
        said = (
            f"still good: {len(check.shot)} shots agree with the setup (χ² {check.statistic:.1f} "
            f"of {check.freedom})",
            "another bias of the magnetometer that turns headings by "
            f"{figure(check.seen_deg)}° would have been seen",
        )
        return replace(check, remarks=said)
    if len(check.odd):
        number = check.shot[check.odd[0]]
        what = f"shot {number} alone does not agree with the setup"
        move = "repeat it: it was not at rest, or near iron"
        return replace(check, findings=(Finding("odd shot", "check", what, move),))
    best = check.changes[0]
    size = ", ".join(figure(float(value), 2) for value in best.size)
    grave = best.turns_deg > SPOILS_DEG
    what = (
        f"the shots do not agree with the setup (χ² {check.statistic:.0f} of {check.freedom}); "
        f"best explained by a change of {best.name} by ({size}) {best.unit}, which turns headings "
        f"by {figure(best.turns_deg)}°"
    )
    move = "look for new iron, batteries or screws, and calibrate again with agonic fit pair"
    finding = Finding("setup changed", "refuse" if grave else "check", what, move)
    return replace(check, findings=(finding,))
