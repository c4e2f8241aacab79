"""The standard error where tilt has to be found: honest whatever the vehicle does, by each source.

Flights, boats and cars with an accelerometer that leans by half a degree, gyros with a bias, and no
attitude in the log. A seed is a vehicle; errors last, so each has few independent headings.
"""

from functools import cache

import numpy as np
import pytest

from agonic.headings.result import Heading
from agonic.headings.tilt_source import find_attitude
from agonic.samples import Samples
from agonic.simulation import simulate
from tests.headings.flights import FIELD, each_row, off_deg, plain, setup_for, truth_of

SEEDS = range(6)
LEAN = np.radians(0.5) * 9.80665
ATTITUDE = {"roll_deg": None, "pitch_deg": None, "heading_deg": None}
TRACK = {"latitude_deg": None, "longitude_deg": None, "altitude_m": None}
STILL = {"stray_nT_A": (0.0, 0.0, 0.0)}
MOTIONS = {
    "cruise": ("flight", {"leg_s": 100.0, **STILL}),
    "banked turns": ("flight", STILL),
    "orbits": ("flight", {"turns_deg": (700.0, 1500.0), **STILL}),
    "boat": ("boat", {}),
    "car": ("car", {}),
}


@cache
def driven(motion: str, seed: int) -> tuple[Samples, Samples]:
    """What is true, and what a logger with such sensors makes of it."""
    kind, settings = MOTIONS[motion]
    true = simulate(
        kind,
        n=4000,
        rate_Hz=20.0,
        seed=seed,
        noise=0.0,
        inclination_deg=65.0,
        declination_deg=2.0,
        calibration=plain(),
        magnitude=FIELD,
        **settings,
    ).samples
    rng = np.random.default_rng(seed + 99)
    noise = rng.standard_normal((2, len(true), 3))
    side = rng.uniform(0, 2 * np.pi)
    lean = LEAN * np.array([2**0.5 * np.cos(side), 2**0.5 * np.sin(side), rng.standard_normal()])
    drift = np.radians(0.2) * rng.standard_normal(3)
    logged = true.with_columns(
        acceleration=true.acceleration + lean + 0.05 * noise[0],
        rotation_rate=true.rotation_rate + drift + 0.002 * noise[1],
        **ATTITUDE,
    )
    return true, logged


def scored(motion: str, tilt: str, **without) -> tuple[np.ndarray, np.ndarray, list[Heading]]:
    """Error, and error over sd, of every row of every seed."""
    errors, found = [], []
    for seed in SEEDS:
        true, logged = driven(motion, seed)
        found.append(each_row(logged.with_columns(**without), setup_for(plain(), tilt=tilt)))
        errors.append(off_deg(found[-1].true_deg, truth_of(true)))
    error = np.concatenate(errors)
    return error, error / np.concatenate([one.sd_deg for one in found]), found


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.slow
@pytest.mark.parametrize("motion", ["cruise", "banked turns", "orbits", "car"])
def test_by_gyro(motion) -> None:
    """The speed in turns is learned from the log, and what that leaves is told."""
    error, z, found = scored(motion, "gyro", **TRACK)
    # 0.6 in turns: an accelerometer's lean turns with the vehicle, and the filter averages it
    assert 0.55 < rms(z) < 1.3
    assert rms(error) < 3.0
    assert all("speed in turns is taken as" in " ".join(one.notes) for one in found)


@pytest.mark.slow
def test_by_gyro_in_a_boat_the_track_tells_the_speed() -> None:
    _, with_track, found = scored("boat", "gyro")
    _, without, blind = scored("boat", "gyro", **TRACK)
    assert 0.5 < rms(with_track) < 1.3
    assert 0.6 < rms(without) < 1.3
    sd, larger = (np.median([one.tilt_sd_deg for one in some]) for some in (found, blind))
    assert sd < larger


@pytest.mark.parametrize(
    ("motion", "least"),
    [("cruise", 0.1), ("banked turns", 0.5), ("orbits", 0.6), ("boat", 0.6), ("car", 0.5)],
)
@pytest.mark.parametrize("gyros", [True, False])
def test_by_accelerometer(motion, least, gyros) -> None:
    """|f| tells of acceleration by its square: a flight that mostly cruises is rather doubted."""
    without = {} if gyros else {"rotation_rate": None}
    error, z, found = scored(motion, "accelerometer", **TRACK, **without)
    assert least < rms(z) < 1.3
    assert rms(error) > 5.0  # what 0.5° of tilt would hide
    sure = np.concatenate([one.trusted for one in found])
    assert rms(z[sure]) < 1.3
    if motion != "boat":  # it rocks all the time
        assert rms(error[sure]) < 0.6 * rms(error[~sure])


@pytest.mark.parametrize("motion", ["boat", "car"])
def test_taken_level_and_told_by_the_log_how_level_it_was(motion) -> None:
    z, told = [], []
    for seed in SEEDS:
        true, logged = driven(motion, seed)
        seen = logged.with_columns(roll_deg=true.roll_deg, pitch_deg=true.pitch_deg)
        found = each_row(seen, setup_for(plain(), tilt="level"))
        z.append(off_deg(found.true_deg, truth_of(true)) / found.sd_deg)
        told += found.notes
    assert 0.7 < rms(np.concatenate(z)) < 1.3
    assert sum("by the log it was tilted by" in note for note in told) == len(SEEDS)


def test_taken_level_where_nothing_tells() -> None:
    """A boat that rolls by 5° in a rule of 3°; who knows better states it."""
    bare = {"acceleration": None, "rotation_rate": None}
    _, z, found = scored("boat", "level", **bare)
    assert 0.8 < rms(z) < 1.6
    assert "taken to be level to 3°" in found[0].notes[0]
    _, logged = driven("boat", 0)
    stated = each_row(
        logged.with_columns(**bare), setup_for(plain(), tilt="level", tilt_sd_deg=4.0)
    )
    assert stated.tilt_sd_deg == pytest.approx(4.0)
    assert not any("level" in note for note in stated.notes)
    assert np.median(stated.sd_deg) == pytest.approx(4.0 * np.tan(np.radians(65.0)), rel=0.05)


def test_what_is_stated_of_the_sensor_counts_beside_what_it_feels() -> None:
    _, logged = driven("car", 0)
    plainly, doubted = (
        find_attitude(logged, setup_for(plain(), tilt="gyro", tilt_sd_deg=sd), plain()).sd_deg
        for sd in (0.0, 2.0)
    )
    assert np.sqrt(doubted**2 - plainly**2) == pytest.approx(2.0, rel=1e-6)
