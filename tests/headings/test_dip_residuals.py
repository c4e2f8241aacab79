"""The standard error of the tilt by the dip of the field: false verticals, and good attitudes."""

from dataclasses import replace

import numpy as np
import pytest

import agonic as ag
from agonic.maths.rotations.attitude import rot_nb
from agonic.samples import Samples
from tests.headings.flights import FIELD, each_row, off_deg, plain, setup_for

SEEDS = range(8)
UNKNOWN = {"horizontal": None, "vertical": None}


def circling(seed: int, bank_deg: float) -> tuple[Samples, np.ndarray]:
    """A vehicle that circles all the time: its accelerometer feels its own down, and little more g.

    Coordinated turns of 3–12°/s, an accelerometer and a magnetometer, no attitude and no gyros.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(2000) / 10.0
    rate = rng.uniform(3, 12) * rng.choice([-1, 1])
    true = (rng.uniform(0, 360) + rate * time) % 360
    roll = np.sign(rate) * bank_deg + 0.3 * np.sin(2 * time)
    dip, declination = np.radians([65.0, 2.0])
    level = np.cos(dip) * np.array([np.cos(declination), np.sin(declination), np.tan(dip)])
    field = FIELD * np.einsum("nij,i->nj", rot_nb(roll, np.ones(2000), true), level)
    gravity = np.array([0.0, 0.0, -9.80665 / np.cos(np.radians(bank_deg))])
    noise = rng.standard_normal((2, 2000, 3))
    acceleration = gravity + 0.05 * noise[0]
    return Samples(time=time, field=field + 20 * noise[1], acceleration=acceleration), true


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("bank_deg", [3.0, 6.0, 10.0, 15.0])
@pytest.mark.parametrize("known", [{}, UNKNOWN])
def test_a_circling_vehicle_s_false_vertical_shows_in_the_dip(bank_deg, known) -> None:
    """Headings are off by up to 27° at 10° of bank: stated, and not trusted."""
    z = []
    for seed in SEEDS:
        samples, true = circling(seed, bank_deg)
        found = each_row(samples, setup_for(plain(), tilt="accelerometer", **known))
        z.append(off_deg(found.true_deg, true) / found.sd_deg)
        if bank_deg >= 10.0:
            assert not found.trusted.any()
    assert 0.8 < rms(np.concatenate(z)) < 1.4
    assert np.abs(np.concatenate(z)).max() < 3.0


@pytest.mark.parametrize("attitude_sd_deg", [0.0, 0.2, 1.0])
def test_recorded_roll_and_pitch_are_as_good_as_the_dip_shows(attitude_sd_deg) -> None:
    """0.5° is assumed; the truth is better or worse."""
    quiet = {"sensors": 1, "stray_nT_A": ((0.0, 0.0, 0.0),), "latency_s": 0.0, "noise": 100.0}
    z, sd = [], []
    for seed in SEEDS:
        made = ag.simulate_vehicle(
            **quiet, heading_sd_deg=0.0, attitude_sd_deg=attitude_sd_deg, n=2500, seed=seed
        )
        north, east, down = made.field_n.mean(axis=0)
        exact = replace(made.truths[0], covariance=np.zeros((12, 12)), noise=100.0)
        setup = ag.Setup(
            compasses=(ag.Compass(calibration=exact),),
            tilt="log",
            declination_deg=float(np.degrees(np.arctan2(east, north))),
            declination_sd_deg=0.0,
            horizontal=float(np.hypot(north, east)),
            vertical=float(down),
        )
        found = each_row(made.samples[0], setup)
        z.append(off_deg(found.true_deg, made.heading_deg) / found.sd_deg)
        sd.append(np.median(found.tilt_sd_deg))
    assert 0.6 < rms(np.concatenate(z)) < 1.25
    assert np.median(sd) < 0.4 if attitude_sd_deg < 0.5 else np.median(sd) > 0.7


def test_on_one_heading_nothing_is_taken_for_known() -> None:
    """Flying east, an error of pitch turns the heading and not the dip."""
    samples, _ = circling(0, 0.0)
    n = len(samples)
    dip = np.radians(65.0)
    east = FIELD * np.array([0.0, -np.cos(dip), np.sin(dip)])
    noise = 20 * np.random.default_rng(0).standard_normal((n, 3))
    straight = samples.with_columns(field=east + noise, roll_deg=np.zeros(n), pitch_deg=np.zeros(n))
    found = each_row(straight, setup_for(plain(), tilt="log"))
    assert found.tilt_sd_deg == pytest.approx(0.5)


def test_a_magnet_that_passes_is_no_tilt() -> None:
    samples, _ = circling(3, 0.0)
    field = samples.field.copy()
    field[300:380] += [0.0, 9000.0, 15_000.0]
    found = each_row(samples.with_columns(field=field), setup_for(plain(), tilt="accelerometer"))
    assert found.flags["disturbed"][300:380].all()
    assert np.median(found.tilt_sd_deg) < 4.0
    assert found.trusted[1000:].all()
