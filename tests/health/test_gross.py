"""Readings of a size that no sensor gives, and readings of another unit."""

import numpy as np
import pytest

from agonic import Reference, Samples, calibrate
from agonic.simulation import simulate

EARTH = Reference.constant(50_000)
TURNED = simulate("tumble", n=600, seed=4)


@pytest.mark.parametrize(("share", "verdict"), [(0.005, "good"), (0.05, "check")])
def test_garbage_is_left_out_and_counted(share: float, verdict: str) -> None:
    rng = np.random.default_rng(0)
    field = TURNED.samples.field.copy()
    rows = rng.random(len(field)) < share
    field[rows] = 1e12
    result = calibrate(Samples(time=TURNED.samples.time, field=field, unit="nT"), EARTH)
    assert result.verdict == verdict
    (told,) = [f for f in result.fit.findings if f.name == "outliers"]
    assert told.what.startswith(f"{rows.sum()} readings")
    off = np.abs(result.calibration.bias - TURNED.truth.bias)
    assert (off < 3.5 * result.fit.sd[:3]).all()


@pytest.mark.parametrize("reference", [EARTH, None])
def test_readings_of_a_unit_too_small_are_told_so(reference: Reference | None) -> None:
    field = TURNED.samples.field / 1000
    result = calibrate(Samples(time=TURNED.samples.time, field=field, unit="nT"), reference)
    assert result.verdict == "check"
    (told,) = [f for f in result.fit.findings if f.severity == "check"]
    assert told.name == "scale"
    assert "check the unit of the log" in told.move


def test_a_sensor_at_rest_whose_bias_opposes_the_field_is_at_rest() -> None:
    drift = np.linspace(0, 20, 600)[:, None]
    rest = np.random.default_rng(1).normal(size=(600, 3)) * 50 + drift + [9_000.0, 2_000, -8_000]
    result = calibrate(Samples(time=TURNED.samples.time, field=rest, unit="nT"), EARTH)
    assert (result.verdict, result.fit.findings[0].name) == ("refused", "static")
