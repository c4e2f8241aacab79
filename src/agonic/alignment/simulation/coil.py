"""`simulate_coil`: a coil whose current is reversed before a magnetometer, and its truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from agonic.alignment.session import Site
from agonic.alignment.session.laboratory import Attitude, CoilSession
from agonic.alignment.simulation.session import read_field, vary_field
from agonic.arrays import Array
from agonic.calibration.alignment import Alignment
from agonic.maths.rotations.attitude import make_rotation, rot_nb
from agonic.maths.rotations.frames import ARCSEC_RAD
from agonic.readable import Readable

MOST_VARIATION, PERIODS_S = 20.0, (1400.0, 2300.0, 3700.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedCoil(Readable):
    """A session and its truth: the coil's vector (3,) by the ampere, nT/A, in the magnetometer's
    axes, its axis in north-east-down, and its angle to the axis as drawn."""

    session: CoilSession
    vector: Array
    axis_n: Array
    geometric_deg: float


def simulate_coil(
    *,
    reversals: int = 100,
    readings: int = 5,
    field: float = 20_000.0,
    constant: float = 40_000.0,
    levels: Sequence[float] = (1.0,),
    tilt_deg: float = 0.08,
    noise: float = 0.5,
    reference_noise: float = 0.3,
    bias: ArrayLike = (12.0, -40.0, 25.0),
    even: float = 0.0,
    alignment_sd_arcsec: float = 1.0,
    attitude_sd_arcsec: float = 2.0,
    site: Site | None = None,
    begins: datetime = datetime(2024, 3, 12, 9, 0, tzinfo=UTC),
    seed: int = 0,
) -> SimulatedCoil:
    """A coil that gives `field` nT at its largest current, its axis tilted from the one as drawn.

    Parameters
    ----------
    reversals, readings : of the current, and of the magnetometer in between, one a second.
    constant : nT/A. levels : shares of the largest current, in turn.
    tilt_deg : of the axis, degrees.
    noise, reference_noise : nT. bias : (3,) nT, of the magnetometer. even : nT at the largest
        current that does not reverse.
    alignment_sd_arcsec, attitude_sd_arcsec : of alignment and attitude as the observer knows them.
    site, begins : where and when; None for a usual site. seed : of the noise.

    Source: the model of `fit_coil`.

    >>> simulate_coil(reversals=4, readings=2).session.magnetometer.current_A.tolist()
    [0.5, 0.5, -0.5, -0.5, 0.5, 0.5, -0.5, -0.5, 0.5, 0.5]
    """
    rng = np.random.default_rng(seed)
    place = site or Site(latitude_deg=52.0725, longitude_deg=12.6750)
    rot_bm = make_rotation(rng.uniform(-0.5, 0.5, 3))
    rot_bn = rot_nb(0.4, -0.7, 63.0).T
    drawn = np.array([0.0, 0.0, 1.0])
    off = np.radians(tilt_deg) * rng.standard_normal(2)
    axis_b = make_rotation(np.array([*off, 0.0])) @ drawn
    vector = constant * rot_bm.T @ axis_b
    share = np.tile(np.repeat(np.asarray(levels, dtype=np.float64), 2), reversals)[: reversals + 1]
    current = field / constant * share * np.where(np.arange(reversals + 1) % 2, -1.0, 1.0)
    flowing = np.repeat(current, readings)
    time = np.arange(len(flowing), dtype=np.float64)
    beside = vary_field(time, MOST_VARIATION, PERIODS_S, rng)
    rising = even * (flowing * constant / field) ** 2
    true = beside @ (rot_bm.T @ rot_bn).T + np.outer(flowing, vector) + rising[:, None]
    known = make_rotation(alignment_sd_arcsec * ARCSEC_RAD * rng.standard_normal(3)) @ rot_bm
    stood = make_rotation(attitude_sd_arcsec * ARCSEC_RAD * rng.standard_normal(3)) @ rot_bn
    return SimulatedCoil(
        session=CoilSession(
            name="simulated",
            magnetometer=read_field(
                true + np.asarray(bias), noise, rng, begins, time, current_A=flowing
            ),
            reference=read_field(beside, reference_noise, rng, begins, time, "reference"),
            geometric_axis=drawn,
            geometric_frame="b",
            alignment=Alignment(
                rotation=Rotation.from_matrix(known),
                covariance=np.eye(3) * (alignment_sd_arcsec * ARCSEC_RAD) ** 2,
                sensor="magnetometer",
            ),
            attitude=Attitude(
                rot_pn=stood, covariance=np.eye(3) * (attitude_sd_arcsec * ARCSEC_RAD) ** 2
            ),
            site=place,
        ),
        vector=vector,
        axis_n=rot_bn.T @ axis_b,
        geometric_deg=float(np.degrees(np.arccos(min(axis_b @ drawn, 1.0)))),
    )
