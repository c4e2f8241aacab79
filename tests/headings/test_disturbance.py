"""Disturbances in the standard error: what magnitude and dip show, the compass may have across."""

import numpy as np
import pytest

from agonic.headings.compute import heading
from agonic.maths.rotations.attitude import rot_nb
from agonic.samples import Samples
from tests.headings.flights import FIELD, off_deg, plain, setup_for

SEEDS = range(6)
DIP, DECLINATION = np.radians([65.0, 2.0])


def turning(seed: int, disturb_nT: float, *, carried: bool) -> tuple[Samples, np.ndarray]:
    """A sensor that is turned by hand, in the second half near something magnetic.

    What is carried along keeps its direction in the sensor; what is in the room, one in the room.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(3000) / 20.0
    slow = rng.uniform(0.1, 0.6, 3)
    true = (rng.uniform(0, 360) + 200 * np.sin(slow[0] * time) + 5 * time) % 360
    roll, pitch = 30 * np.sin(slow[1] * time), 30 * np.sin(slow[2] * time + 1.0)
    level = np.cos(DIP) * np.array([np.cos(DECLINATION), np.sin(DECLINATION), np.tan(DIP)])
    to_body = rot_nb(roll, pitch, true)
    side = rng.standard_normal(3)
    magnet = disturb_nT * side / np.linalg.norm(side)
    # a magnet that is passed comes and goes; its field turns as the way about it does
    ways = rng.standard_normal((3, 3))
    passing = sum(np.outer(np.sin((k + 1) * 0.15 * time + k), way) for k, way in enumerate(ways))
    added = magnet if carried else disturb_nT / 2.0 * np.einsum("nij,ni->nj", to_body, passing)
    field = FIELD * np.einsum("nij,i->nj", to_body, level)
    field = field + np.where(time[:, None] > 75.0, added, 0.0)
    noise = 100.0 * rng.standard_normal((3000, 3))
    return Samples(time=time, field=field + noise, roll_deg=roll, pitch_deg=pitch), true


def scored(disturb_nT: float, *, carried: bool, half: slice) -> tuple[np.ndarray, np.ndarray]:
    """Errors over their standard errors, and which rows are trusted, of all seeds."""
    z, trusted = [], []
    for seed in SEEDS:
        samples, true = turning(seed, disturb_nT, carried=carried)
        found = heading(samples, setup_for(plain(), tilt="log", tilt_sd_deg=0.0))
        z.append((off_deg(found.true_deg, true) / found.sd_deg)[half])
        trusted.append(found.trusted[half])
    return np.concatenate(z), np.concatenate(trusted)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("carried", [True, False])
@pytest.mark.parametrize("disturb_nT", [1000.0, 4000.0, 15_000.0])
def test_the_standard_error_grows_with_what_shows(disturb_nT, carried) -> None:
    """Without it 4000 nT, within 10 % of the magnitude, are ten standard errors."""
    z, trusted = scored(disturb_nT, carried=carried, half=slice(1600, None))
    assert 0.5 < rms(z) < 1.4
    if trusted.any():
        assert rms(z[trusted]) < 1.4


def test_before_it_comes_nothing_grows() -> None:
    before, trusted = scored(15_000.0, carried=True, half=slice(0, 1480))
    assert 0.8 < rms(before) < 1.2
    assert trusted.all()


def test_a_magnet_that_is_passed_is_seen_where_its_field_hides_too() -> None:
    """For a moment the field has the expected magnitude and dip, and points anywhere."""
    time = np.arange(1000) / 50.0
    level = np.cos(DIP) * np.array([np.cos(DECLINATION), np.sin(DECLINATION), np.tan(DIP)])
    east = np.array([-np.sin(DECLINATION), np.cos(DECLINATION), 0.0])
    field = (
        np.tile(level, (1000, 1)) + np.where(np.abs(time - 10.0) < 1.0, 0.6, 0.0)[:, None] * east
    )
    hidden = np.abs(time - 10.2) < 0.1
    field[hidden] = np.cos(DIP) * east + [0.0, 0.0, np.sin(DIP)]
    samples = Samples(time=time, field=FIELD * field, roll_deg=0.0 * time, pitch_deg=0.0 * time)
    found = heading(samples, setup_for(plain(noise=100.0), tilt="log", tilt_sd_deg=0.1))
    off = np.abs(off_deg(found.true_deg, 0.0)) > 5.0
    assert hidden[off].any()
    assert not found.trusted[off].any()
    assert found.trusted[~off].mean() > 0.9
