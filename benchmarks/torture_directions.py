"""Swings, gravity, north and star sensors whose assumptions are broken; kinds of `torture_wings`.

Each kind makes a run of a seed: what was said, and the error over the stated one.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.alignment.gravity import fit_gravity
from agonic.headings.deviation import fit_deviation
from agonic.maths.rotations.deviation import basis
from benchmarks.torture_outcome import WRONG, Outcome, judge

Array = NDArray[np.float64]
CIRCLE = np.arange(0.0, 360.0, 15.0)
SIDES = ((0, 0, 0), (2, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0))
FIELD_N = np.array([18_870.0, 1_390.0, 45_750.0])
MATTERS_DEG = 0.5
DEVIATION = np.array([1.0, -6.0, 4.0, 2.0, -1.0])


def swing(
    drift: float = 0.0,
    *,
    walk: float = 0.0,
    closed: bool = False,
    stated: float | None = None,
    copied: bool = False,
    headings: int = 8,
) -> Callable[[int], Outcome]:
    """Headings with 0.4° of noise beside a reference that drifts or walks by so much on the way,
    or was copied from the compass; the first heading once more at the end; a noise that is stated.
    """

    def run(seed: int) -> Outcome:
        rng = np.random.default_rng(seed)
        compass = np.append(np.arange(0, 360, 360 / headings), [0.0] if closed else [])
        n = len(compass)
        wrong = drift * np.arange(n) / headings + walk / np.sqrt(n) * rng.normal(size=n).cumsum()
        wrong = wrong + 0.4 * rng.normal(size=n)
        truth = basis(compass)[:, :5] @ DEVIATION
        fit = fit_deviation(compass, compass + (0.0 if copied else truth) + wrong, noise_deg=stated)
        away = fit.calibration.at(CIRCLE) - basis(CIRCLE)[:, :5] @ DEVIATION
        sd = np.sqrt(np.mean(fit.calibration.sd_at(CIRCLE) ** 2))
        return judge(fit, away / max(sd, MATTERS_DEG / WRONG))

    return run


def gravity(
    orientations: int = 6, *, force: float = 0.0, bias: float = 0.0, iron: float = 0.0
) -> Callable[[int], Outcome]:
    """Six sides within 10°, and more at random: an accelerometer (m/s²) and a magnetometer (nT) of
    a bias in any direction, iron near some of the places (nT).
    """

    def run(seed: int) -> Outcome:
        rng = np.random.default_rng(seed)
        sides = Rotation.from_rotvec(np.pi / 2 * np.array(SIDES))
        sides = Rotation.concatenate([sides, Rotation.random(orientations - 6, rng=rng)])
        poses = Rotation.from_rotvec(np.radians(10) * rng.normal(size=(orientations, 3))) * sides
        turn = Rotation.from_rotvec(np.radians(3) * rng.normal(size=3))
        field = poses.inv().apply(FIELD_N + iron * rng.normal(size=(orientations, 3)))
        seen = turn.inv().apply(field) + bias * rng.normal(size=3)
        felt = poses.inv().apply([0.0, 0.0, -9.81]) + force * rng.normal(size=3)
        station = np.repeat(np.arange(orientations), 40)
        samples = ag.Samples(
            time=0.02 * np.arange(len(station)),
            field=seen[station] + 20.0 * rng.normal(size=(len(station), 3)),
            acceleration=felt[station] + 0.03 * rng.normal(size=(len(station), 3)),
            station=station,
            unit="nT",
        )
        fit = fit_gravity(samples)
        away = (Rotation.from_matrix(fit.rot_bm) * turn.inv()).as_rotvec()
        return judge(fit, away / np.sqrt(np.trace(fit.estimate.covariance[:3, :3]) / 3))

    return run


DIRECTIONS: dict[str, Callable[[int], Outcome]] = {
    "swing *": swing(),
    "swing, first heading again *": swing(closed=True),
    "swing, noise stated *": swing(stated=0.4),
    **{
        f"swing, reference drifts by 4°{how}": swing(4.0, **settings)
        for how, settings in {
            "": {},
            ", noise stated": {"stated": 0.4},
            ", first heading again": {"closed": True},
            ", first heading again, noise stated": {"closed": True, "stated": 0.4},
        }.items()
    },
    "swing, reference walks by 3°": swing(walk=3.0, headings=12),
    "swing, reference copied from the compass": swing(copied=True),
    "gravity, six orientations *": gravity(),
    "gravity, accelerometer's bias 0.05 m/s²": gravity(force=0.05),
    "gravity, twelve, bias 200 nT": gravity(12, bias=200.0),
    "gravity, eight, iron of 200 nT": gravity(8, iron=200.0),
}
