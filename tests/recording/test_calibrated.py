"""`calibrate`: fit, hold out, judge."""

import numpy as np
import pytest

import agonic as ag
from agonic.recording.comparison import judge
from agonic.simulation import magnet_attached, mixed, quantised, simulate, with_outliers

FIELD = ag.Reference.constant(50_000.0)


def check(calibrated: ag.Calibrated, name: str):
    return next(check for check in calibrated.verification.checks if check.name == name)


def test_a_good_log_gets_a_good_verdict_and_the_truth() -> None:
    made = simulate("hand", n=3000)
    found = ag.calibrate(made.samples, FIELD)
    assert found.verdict == "good"
    error = (found.fit.calibration.bias - made.truth.bias) / found.fit.sd[:3]
    assert np.abs(error).max() < 4
    assert found.verification.spread_after == pytest.approx(200.0 / 50_000.0, rel=0.15)
    assert check(found, "two halves of the log agree").value < 0.5
    assert found.status == found.fit.status


def test_every_row_is_judged_by_a_fit_that_had_not_seen_it() -> None:
    """With sixteen readings a fit follows its own noise; the held-out rows tell."""
    made = simulate("sphere", n=32, noise=1000.0)
    found = ag.calibrate(made.samples, FIELD, model="full", soft_iron_sd=None, robust=False)
    seen = ag.verify(found.fit.calibration, made.samples, FIELD)
    assert found.verification.residual_rms > 1.3 * seen.residual_rms


def test_rows_that_the_fit_left_out_are_not_judged() -> None:
    samples = simulate("tumble", n=3000, defects=[with_outliers(0.05)]).samples
    found = ag.calibrate(samples, FIELD)
    assert found.verdict == "good"
    assert found.verification.held_out is not None
    assert 0.94 < found.verification.held_out.mean() < 0.97


def test_what_the_fit_refuses_stays_refused() -> None:
    other = simulate("tumble", n=1500, seed=7).samples
    samples = simulate("tumble", n=1500, defects=[mixed(other)]).samples
    found = ag.calibrate(samples, FIELD)
    assert found.verdict == "refused"
    assert "two sensors are mixed" in found.status


def test_a_failed_check_asks_the_user_to_look() -> None:
    made = simulate("tumble", n=2000, noise=1700.0)
    found = ag.calibrate(made.samples, ag.Reference.constant(50_000.0))
    assert found.verdict == "check"
    assert "Held-out parts fail a check: spread of the magnitude, " in found.status
    assert "(limit 3 %)" in found.status


def test_half_a_log_that_is_too_short_is_told() -> None:
    found = ag.calibrate(simulate("sphere", n=9, noise=50.0).samples, FIELD, model="full")
    agreement = check(found, "two halves of the log agree")
    assert agreement.passed is False
    assert np.isnan(agreement.value)
    assert "record longer" in agreement.meaning


def test_a_magnitude_per_sample_is_split_with_its_rows() -> None:
    made = simulate("tumble", n=2000, noise=50.0)
    wanted = np.linspace(0.8, 1.2, 2000) * 50_000.0
    raw = made.field_b * (wanted / 50_000.0)[:, None] @ np.linalg.inv(made.truth.matrix).T
    samples = made.samples.with_columns(field=raw + made.truth.bias)
    found = ag.calibrate(samples, ag.Reference.magnitude(wanted))
    assert found.verdict == "good"
    assert found.fit.calibration.matrix == pytest.approx(made.truth.matrix, abs=1e-3)


def test_raw_counts_need_no_reference() -> None:
    made = simulate("tumble", n=2000, counts_per_nT=0.02, defects=[quantised(1.0)])
    found = ag.calibrate(made.samples)
    assert found.verdict == "good"
    assert found.fit.calibration.unit_out == "raw"
    assert found.fit.calibration.bias == pytest.approx(made.truth.bias, abs=1.0)


def test_nothing_to_fit_raises() -> None:
    with pytest.raises(ag.CoverageError, match="3 readings cannot determine"):
        ag.calibrate(ag.Samples(field=np.eye(3)))


def test_an_earlier_calibration_is_judged_on_later_readings() -> None:
    earlier, later = (simulate("tumble", n=2000, seed=s) for s in (1, 2))
    later = simulate("hand", n=2000, seed=2, calibration=earlier.truth)
    fit = ag.fit_ellipsoid(earlier.samples, FIELD)
    assert judge(fit.calibration, later.samples, FIELD).verdict == "good"
    magnet = magnet_attached(0.0, [4000.0, 0, 0])
    moved = judge(fit.calibration, magnet(later.samples), FIELD)
    assert moved.verdict != "good"


def test_only_an_affine_with_a_covariance_can_be_judged() -> None:
    samples = simulate("tumble", n=500).samples
    with pytest.raises(ag.AgonicError, match="carries no covariance; fit it again"):
        judge(ag.Affine(bias=[0, 0, 0], matrix=np.eye(3)), samples)


def _held_still(rows: np.ndarray, noise: float = 150.0) -> ag.Samples:
    """Readings of a sensor with iron at the orientations numbered by rows (n,)."""
    rng = np.random.default_rng(4)
    u = np.cumsum(rng.normal(size=(rows.max() + 1, 3)), axis=0) * 0.2 + rng.normal(size=3)
    u = np.sin(u * [1.0, 1.3, 1.7])
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    field = 50_000 * u[rows] @ (np.eye(3) + 0.05 * np.ones((3, 3))) + [9e3, -5e3, 3e3]
    field += noise * rng.normal(size=field.shape)
    return ag.Samples(time=np.arange(len(rows)) / 10.0, field=field)


@pytest.mark.parametrize(("still", "turned"), [(5_000, 300), (29_700, 300)])
def test_a_sensor_that_lay_still_and_was_then_turned(still: int, turned: int) -> None:
    rows = np.concatenate([np.zeros(still, dtype=int), np.arange(turned)])
    found = ag.calibrate(_held_still(rows), FIELD)
    assert found.verdict == "good", found.status
    error = found.fit.calibration.bias - [9e3, -5e3, 3e3]
    assert np.abs(error / found.fit.sd[:3]).max() < 4


def _in_poses(count: int) -> ag.Samples:
    """Each of so many random orientations read two hundred times."""
    rng = np.random.default_rng(8)
    u = rng.normal(size=(count, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    field = np.repeat(50_000 * u, 200, axis=0) + np.array([9e3, -5e3, 3e3])
    return ag.Samples(field=field + 50.0 * rng.normal(size=field.shape))


def test_orientations_count_and_not_readings() -> None:
    verdicts = {count: ag.calibrate(_in_poses(count), FIELD) for count in (6, 10, 16)}
    assert [found.verdict for found in verdicts.values()] == ["refused", "check", "good"]
    assert "few orientations" in [finding.name for finding in verdicts[6].fit.findings]
    assert check(verdicts[16], "two halves of the log agree").passed
