"""A sensor that sits turned in its vehicle, calibrated by the magnitude beside roll and pitch."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.attitude.vertical_turn import find_vertical_turn, tell_turn
from agonic.ellipsoid import fit_ellipsoid
from agonic.fit import Fit
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
    for seed in range(12):
        fit, samples = fly(seed, lasting_s=(5.0, 20.0, 60.0)[seed % 3])
        found = find_vertical_turn(fit, samples)
        z.append(found.level_deg / np.sqrt(found.rms_deg**2 - found.level_deg**2))
        assert found.p_value > 1e-3
        told = tell_turn(fit, samples, None, "").findings
        assert "turned sensor" not in [finding.name for finding in told]
    assert np.sqrt(np.mean(np.square(z))) < 1.5


@pytest.mark.parametrize("lasting_s", [5.0, 60.0])
def test_a_turn_is_found_with_its_sign_and_told(lasting_s: float) -> None:
    fit, samples = fly(2, turn_deg=5.0, lasting_s=lasting_s)
    found = find_vertical_turn(fit, samples)
    assert np.degrees(found.turn[:2]) == pytest.approx([-5.0, 0.0], abs=3 * found.level_sd_deg)
    told = tell_turn(fit, samples, None, "give the place")
    finding = next(finding for finding in told.findings if finding.name == "turned sensor")
    assert told.verdict == "check"
    assert finding.move == "give the place"
    wrong_deg = 5.0 * np.tan(np.radians(fit.coverage.inclination_deg)) / np.sqrt(2)
    assert told.coverage.heading_sd_deg == pytest.approx(wrong_deg, rel=0.2)


def test_a_turn_that_nothing_shows_stays_unknown() -> None:
    """An attitude that errs by 3°: the vehicle's heading is stated with what is unknown."""
    fit, samples = fly(0)
    rng = np.random.default_rng(0)
    rolls = samples.with_columns(
        roll_deg=samples.roll_deg + rng.normal(0.0, 3.0, 20).repeat(100),
        pitch_deg=samples.pitch_deg + rng.normal(0.0, 3.0, 20).repeat(100),
    )
    told = tell_turn(fit, rolls, None, "")
    assert told.accuracy is not None
    assert told.accuracy.vehicle_deg is not None
    assert told.accuracy.vehicle_deg > 3 * told.accuracy.own_deg
    assert "of the vehicle" in told.accuracy.sentence
    assert "of the sensor's own axes" in fit.status
