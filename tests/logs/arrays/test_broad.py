"""Recordings with optical truth: latency, a magnet that comes and goes, and a poor motion."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.attitude.latency import LatencyFit, fit_latency
from agonic.attitude.undo_latency import undelayed
from agonic.maths.rotations.attitude import rot_nb

pytestmark = pytest.mark.recordings

MAGNET_COMES_OR_GOES_S = 2.0  # it is felt while a hand brings it near


@cache
def trial(recordings: Path, number: str) -> ag.Samples:
    (path,) = (recordings / "vehicle" / "broad").glob(f"{number}_*.mat")
    return ag.read(path)


def heading_error(field: np.ndarray, samples: ag.Samples) -> np.ndarray:
    """Degrees by which a field points off magnetic north when optics turn it into n."""
    turned = rot_nb(samples.roll_deg, samples.pitch_deg, samples.heading_deg)
    north, east, _ = np.einsum("nij,nj->in", turned, field)
    return np.degrees(np.arctan2(east, north))


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


def spread(samples: ag.Samples, field: np.ndarray) -> float:
    """Standard deviation of the heading error while the sensor turns."""
    turning = np.degrees(np.linalg.norm(samples.rotation_rate, axis=1)) > 50
    error = heading_error(field, samples)[turning]
    middle = np.angle(np.mean(np.exp(1j * np.radians(error))))
    return float(np.std((error - np.degrees(middle) + 180) % 360))


@pytest.fixture(scope="module")
def fits(recordings: Path) -> dict[str, LatencyFit]:
    return {n: fit_latency(trial(recordings, n)) for n in ("02", "07", "12", "32", "34")}


@pytest.mark.slow
def test_the_magnetometer_is_late_by_the_same_in_every_trial(fits) -> None:
    assert 1000 * fits["07"].latency_s == pytest.approx(14, abs=4)
    assert 1000 * fits["07"].sd_s < 0.5
    for fit in fits.values():
        assert fit.method == "attitude"
        assert fit.significant
        assert 1000 * fit.latency_s == pytest.approx(15, abs=3)  # optics start within 2 ms
        assert fit.residual_after <= fit.residual_before


@pytest.mark.slow
@pytest.mark.parametrize("number", ["02", "07"])
def test_beside_the_gyro_it_is_late_too(recordings: Path, number: str) -> None:
    fit = fit_latency(trial(recordings, number), method="gyro")
    assert fit.significant
    assert 1000 * fit.latency_s == pytest.approx(11, abs=1)


@pytest.mark.slow
def test_undone_the_heading_spread_of_fast_turns_falls_to_a_third(recordings: Path, fits) -> None:
    samples = trial(recordings, "07")
    assert 11.0 < spread(samples, samples.field) < 13.0
    on_time = undelayed(samples, fits["07"].latency_s)
    assert spread(on_time, on_time.field) < 3.5
    calibrated = ag.fit_ellipsoid(on_time).calibration.correct(on_time.field)
    assert spread(on_time, calibrated) < 4.5


@pytest.mark.slow
@pytest.mark.parametrize(("number", "as_read_deg"), [("32", 80.0), ("34", 29.0)])
def test_a_fit_across_a_magnet_is_refused_and_one_to_its_stretch_serves(
    recordings: Path, fits, number: str, as_read_deg: float
) -> None:
    samples = undelayed(trial(recordings, number), fits[number].latency_s)
    (changed,) = (f for f in ag.fit_ellipsoid(samples).findings if f.severity == "refuse")
    assert changed.name == "field changed"
    on, off = (float(words.split()[0]) for words in changed.what.split("t = ")[1:])
    time = samples.time - samples.time[0]
    inside = (time > on + MAGNET_COMES_OR_GOES_S) & (time < off - MAGNET_COMES_OR_GOES_S)
    stretch = samples.select(inside)
    assert rms(heading_error(stretch.field, stretch)) > as_read_deg
    for model in ("sphere", "auto"):
        fit = ag.fit_ellipsoid(stretch, model=model)
        assert fit.verdict != "refused"
        assert rms(heading_error(fit.calibration.correct(stretch.field), stretch)) < 4.5


@pytest.mark.slow
def test_a_translation_alone_is_refused(recordings: Path, fits) -> None:
    samples = undelayed(trial(recordings, "12"), fits["12"].latency_s)
    assert ag.fit_ellipsoid(samples).verdict == "refused"
