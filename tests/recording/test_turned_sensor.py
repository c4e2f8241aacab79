"""A sensor that sits turned in its vehicle, calibrated by the magnitude beside what tells down."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.ellipsoid import fit_ellipsoid
from agonic.fit import Fit
from agonic.maths.rotations.attitude import down_b
from agonic.maths.rotations.turn_beside import find_turn_beside
from agonic.recording.mounting import undo_turn
from agonic.samples import Samples
from agonic.simulation.vehicle import simulate_vehicle


def fly(seed: int, *, turn_deg: float = 0.0, lasting_s: float = 5.0) -> tuple[Fit, Samples]:
    """A flight of 200 s whose attitude errs by 0.3° for that long, and the fit to its magnitude."""
    flown = simulate_vehicle(
        n=2000,
        rate_Hz=10.0,
        sensors=1,
        correlation_s=lasting_s,
        stray_nT_A=(0.0, 0.0, 0.0),
        seed=seed,
    )
    samples = flown.samples[0]
    turned = Rotation.from_euler("x", turn_deg, degrees=True).apply(np.array(samples.field))
    samples = samples.with_columns(field=turned)
    return fit_ellipsoid(samples), samples


@pytest.mark.slow
def test_errors_of_the_attitude_that_last_are_no_turn() -> None:
    """The estimate over its stated error, per axis, and no finding in any flight."""
    z = []
    for seed in range(24):
        fit, samples = fly(seed, lasting_s=(5.0, 20.0, 60.0)[seed % 3])
        assert samples.roll_deg is not None
        down = down_b(samples.roll_deg, samples.pitch_deg)
        found = find_turn_beside(fit.calibration.correct(samples.field), down, 3e-3)
        turn = Rotation.from_matrix(found.turn).as_rotvec()
        z.append(turn / np.sqrt(np.diag(found.covariance)))
        told = undo_turn(fit, samples, None, "")
        assert {"turned sensor", "mounting"}.isdisjoint(f.name for f in told.findings)
        assert told.calibration is fit.calibration
    assert np.sqrt(np.mean(np.square(z))) == pytest.approx(0.9, abs=0.2)


@pytest.mark.parametrize(("turn_deg", "lasting_s"), [(5.0, 5.0), (5.0, 60.0), (25.0, 20.0)])
def test_a_turn_is_found_with_its_sign_and_undone(turn_deg: float, lasting_s: float) -> None:
    fit, samples = fly(2, turn_deg=turn_deg, lasting_s=lasting_s)
    plain, _ = fly(2, lasting_s=lasting_s)
    found = undo_turn(fit, samples, None, "")
    assert found.verdict == "good"
    (told,) = [one for one in found.findings if one.name == "mounting"]
    assert told.severity == "note"
    assert f"roll −{turn_deg:.0f}."[:6] in told.what or f"roll −{turn_deg - 1:.0f}." in told.what
    assert found.accuracy is not None
    assert found.accuracy.vehicle_deg is not None
    wanted = plain.calibration.correct(np.array(plain.calibration.bias) + np.eye(3) * 3e4)
    turned = Rotation.from_euler("x", turn_deg, degrees=True).apply(np.eye(3) * 3e4)
    off = found.calibration.correct(np.array(fit.calibration.bias) + turned) - wanted
    assert np.degrees(np.abs(off).max() / 3e4) < 4 * found.accuracy.vehicle_deg
    assert found.calibration.frame_out == "b"


def test_a_turn_that_nothing_shows_stays_unknown() -> None:
    """An attitude that errs by 3°: the vehicle's heading is stated with what is unknown."""
    fit, samples = fly(0)
    rng = np.random.default_rng(0)
    rolls = samples.with_columns(
        roll_deg=samples.roll_deg + rng.normal(0.0, 3.0, 20).repeat(100),
        pitch_deg=samples.pitch_deg + rng.normal(0.0, 3.0, 20).repeat(100),
    )
    told = undo_turn(fit, rolls, None, "")
    assert told.accuracy is not None
    assert told.accuracy.vehicle_deg is not None
    assert told.accuracy.vehicle_deg > 3 * told.accuracy.own_deg
    assert "of the vehicle" in told.accuracy.sentence
    assert "of the sensor's own axes" in fit.status
