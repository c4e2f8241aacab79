"""Swings, gravity, north and star sensors whose assumptions are broken; kinds of `torture_wings`.

Each kind makes a run of a seed: what was said, and the error over the stated one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.alignment.gravity import fit_gravity
from agonic.alignment.north.di_flux import fit_di_flux
from agonic.alignment.north.fit import fit_north
from agonic.alignment.simulation.laboratory import simulate_di_flux, simulate_north
from agonic.alignment.simulation.session import simulate_session
from agonic.alignment.star_sensor.fit import fit_alignment
from agonic.headings.deviation import fit_deviation
from agonic.maths.rotations.deviation import basis
from benchmarks.torture_outcome import WRONG, Outcome, correlated, judge

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


def north(
    drift_arcsec: float = 0.0, *, settles: bool = False, turning: bool = True, stated: bool = True
) -> Callable[[int], Outcome]:
    """A gyrotheodolite whose zero drifts, or settles by so much; its turning points, or its swing
    alone; the noise of a reading stated or not.
    """

    def run(seed: int) -> Outcome:
        made = simulate_north(seed=seed, orientations=0)
        size = drift_arcsec / 3600 * np.random.default_rng(seed).choice([-1, 1])
        swing, points = made.session.swing, made.session.turning_deg

        def moved(part: Array) -> Array:
            return size * (np.exp(-part / 0.2) if settles else part)

        followed = swing.reading_deg + moved(swing.time_s / swing.time_s[-1])
        session = replace(
            made.session,
            turning_deg=points + moved(np.linspace(0, 1, len(points))) if turning else None,
            swing=None if turning else replace(swing, reading_deg=followed),
            transits=None,
            reading_sd_arcsec=made.session.reading_sd_arcsec if stated else None,
        )
        fit = fit_north(session)
        away = (fit.north_deg - made.north_deg) * 3600 / fit.sd_arcsec
        return judge(fit, np.array([away]))

    return run


def theodolite(noise: float = 0.5, *, drift: float = 0.0, slip: float = 0.0):
    """A DI-flux sheet with so much noise a setting, an offset of the fluxgate that drifts (nT), one
    of the circles' settings misread (″)."""

    def run(seed: int) -> Outcome:
        made, rng = simulate_di_flux(seed=seed, noise=noise), np.random.default_rng(seed)
        circle = made.sheet.horizontal_deg.copy()
        circle[2 * rng.integers(8)] += slip / 3600
        course = drift * np.linspace(0, 1, len(circle)) * rng.choice([-1, 1])
        fit = fit_di_flux(
            replace(made.sheet, horizontal_deg=circle, reading=made.sheet.reading + course)
        )
        away = 3600 * np.array(
            [
                (fit.declination_deg - made.declination_deg) / fit.declination_sd_arcsec,
                (fit.inclination_deg - made.inclination_deg) / fit.inclination_sd_arcsec,
            ]
        )
        return judge(fit, away)

    return run


def star_sensor(
    each: float = 0.0, *, one: float = 0.0, late_s: float = 0.0, walk: float = 0.0
) -> Callable[[int], Outcome]:
    """A star sensor that errs in each orientation, or in one alone (″), or is late (s); a reference
    that walks by so much (nT)."""

    def run(seed: int) -> Outcome:
        made, rng = simulate_session(seed=seed), np.random.default_rng(seed)
        star, beside = made.session.star, made.session.reference
        number = star.orientation - star.orientation.min()
        wrong = each * rng.normal(size=(number.max() + 1, 3))
        wrong[rng.integers(len(wrong))] += one / np.sqrt(3) * rng.choice([-1, 1], 3)
        turn = Rotation.from_rotvec(np.radians(wrong / 3600)[number]).as_matrix()
        walked = correlated(rng, beside.field.shape, float(np.exp(-1 / 600)), walk)
        session = replace(
            made.session,
            star=replace(star, rot_ci=turn @ star.rot_ci, time=star.time + late_s),
            reference=beside.with_columns(field=beside.field + walked),
        )
        fit = fit_alignment(session)
        away = Rotation.from_matrix(fit.solution.unknowns.rot_mc @ made.rot_mc.T).as_rotvec()
        variances = fit.solution.covariance[:3, :3]
        return judge(fit, away / np.sqrt(np.trace(variances) / 3))

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
    "north by turning points *": north(),
    "north by turning points, zero drifts by 20″": north(20.0),
    "north by turning points, zero drifts by 20″, no noise stated": north(20.0, stated=False),
    "north by turning points, zero settles by 30″": north(30.0, settles=True),
    "north by the swing, zero drifts by 20″": north(20.0, turning=False),
    "DI-flux *": theodolite(),
    "DI-flux, 3 nT a setting": theodolite(3.0),
    "DI-flux, offset drifts by 5 nT": theodolite(drift=5.0),
    "DI-flux, a circle misread by 60″": theodolite(slip=60.0),
    "star sensor *": star_sensor(),
    "star sensor, 5″ in each orientation": star_sensor(5.0),
    "star sensor, 100″ in one orientation": star_sensor(one=100.0),
    "star sensor, 1 s late": star_sensor(late_s=1.0),
    "star sensor, reference walks by 3 nT": star_sensor(walk=3.0),
}
