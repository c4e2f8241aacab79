"""A log in which a magnet was put on or taken off: the longest stretch without is calibrated."""

import numpy as np
import pytest

from agonic import Reference, Samples, calibrate
from agonic.recording.calibrated import Calibrated
from agonic.simulation import simulate

EARTH = Reference.constant(50_000)
MAGNET = np.array([9_000.0, -6_000.0, 4_000.0])  # nT


def log_with_magnet(on_s: float, off_s: float) -> tuple[Samples, np.ndarray]:
    """40 s of readings turned all over, with a magnet for a while; the bias without it."""
    simulated = simulate("tumble", n=800, rate_Hz=20.0, seed=3)
    whole = simulated.samples
    on = (whole.time >= on_s) & (whole.time < off_s)
    field = whole.field + on[:, None] * MAGNET
    return Samples(time=whole.time, field=field, unit="nT"), simulated.truth.bias


def errors_over_sd(result: Calibrated, bias: np.ndarray) -> np.ndarray:
    return (result.calibration.bias - bias) / result.fit.sd[:3]


def test_what_came_and_went_leaves_all_the_rest_to_calibrate() -> None:
    samples, bias = log_with_magnet(10.0, 20.0)
    result = calibrate(samples, EARTH)
    assert result.verdict == "check"
    assert (np.abs(errors_over_sd(result, bias)) < 3.5).all()
    first = result.fit.findings[0]
    assert first.name == "field changed"
    np.testing.assert_allclose(first.moments, [10.0, 20.0], atol=0.5)
    assert len(result.samples) == pytest.approx(600, abs=30)
    assert (
        "this calibration and its standard error hold only for the stretches from t = 0.0 s to "
        in first.what
    )
    np.testing.assert_allclose(np.ravel(result.stretches), [0.0, 10.0, 20.0, 39.95], atol=0.5)


@pytest.mark.parametrize("share", [-0.5, -0.1, 0.1])
def test_where_the_bias_did_not_come_back_one_stretch_is_calibrated(share: float) -> None:
    samples, bias = log_with_magnet(10.0, 20.0)
    after = samples.time >= 20.0
    samples = samples.with_columns(field=samples.field + share * after[:, None] * MAGNET)
    result = calibrate(samples, EARTH)
    assert result.verdict == "check"
    assert result.samples.time[0] == pytest.approx(20.0, abs=1.0)
    assert (np.abs(errors_over_sd(result, bias + share * MAGNET)) < 3.5).all()
    assert (
        "this calibration and its standard error hold only for the stretch from t = "
        in result.fit.findings[0].what
    )


def test_what_was_put_on_to_stay_is_part_of_the_bias() -> None:
    samples, bias = log_with_magnet(15.0, 99.0)
    result = calibrate(samples, EARTH)
    assert result.verdict == "check"
    assert (np.abs(errors_over_sd(result, bias + MAGNET)) < 3.5).all()


def test_where_no_stretch_turns_enough_the_log_stays_refused() -> None:
    samples, _ = log_with_magnet(15.0, 25.0)
    few = np.r_[285:315, 485:515]  # half a turn or so, without and with the magnet
    result = calibrate(samples.select(few), EARTH)
    assert result.verdict == "refused"
    assert len(result.samples) == len(few)


def test_without_times_rows_tell_the_stretch() -> None:
    samples, bias = log_with_magnet(10.0, 20.0)
    result = calibrate(Samples(field=samples.field, unit="nT"), EARTH)
    assert result.verdict == "check"
    assert (np.abs(errors_over_sd(result, bias)) < 3.5).all()
    assert "from row 0 to 20" in result.fit.findings[0].what


def test_a_current_is_found_in_the_stretch_that_is_calibrated() -> None:
    """Beside the magnet, the whole log may show nothing of it."""
    samples, bias = log_with_magnet(10.0, 20.0)
    current = 5.0 + np.cumsum(np.random.default_rng(1).normal(size=len(samples))) / 5.0
    field = samples.field + current[:, None] * [60.0, -35.0, 90.0]
    result = calibrate(samples.with_columns(field=field, current_A=current), EARTH)
    assert result.stretches
    assert result.calibration.needs == ("current_A",)
    assert (np.abs(errors_over_sd(result, bias)) < 3.5).all()


def test_a_calibration_of_the_whole_log_is_of_no_stretch() -> None:
    assert calibrate(simulate("tumble", seed=3).samples, EARTH).stretches == ()
