"""`verify`: named checks against known truths."""

import numpy as np
import pytest

import agonic as ag
from agonic.samples import Logged
from agonic.simulation import simulate, with_outliers

EXACT = ag.Affine(bias=[0, 0, 0], matrix=np.eye(3))
FIELD = 50_000.0
MADE = simulate("tumble", n=2000, noise=250.0)


def checks(verification: ag.Verification) -> dict[str, tuple[float, bool | None]]:
    return {check.name: (check.value, check.passed) for check in verification.checks}


def test_the_truth_passes() -> None:
    found = ag.verify(MADE.truth, MADE.samples, ag.Reference.constant(FIELD))
    assert found.passed
    assert found.spread_before > 0.3  # a bias longer than the field
    assert found.spread_after == pytest.approx(250.0 / FIELD, rel=0.1)
    assert found.residual_rms == pytest.approx(250.0, rel=0.1)
    assert np.median(found.magnitude_after) == pytest.approx(FIELD, rel=0.002)
    assert found.magnitude_before == pytest.approx(np.linalg.norm(MADE.samples.field, axis=1))


def test_no_calibration_fails_by_its_spread() -> None:
    found = ag.verify(EXACT, MADE.samples)
    value, passed = checks(found)["spread of the magnitude"]
    assert passed is False
    assert value == pytest.approx(100 * found.spread_after)
    assert not found.passed


def test_one_that_makes_readings_worse_fails_by_that() -> None:
    corrected = ag.apply(MADE.truth, MADE.samples)
    found = checks(ag.verify(MADE.truth, corrected))
    assert found["spread after over before"][1] is False
    assert found["spread after over before"][0] > 10


@pytest.mark.parametrize(("stated", "passed"), [(FIELD, True), (1.1 * FIELD, False)])
def test_magnitude_is_held_against_the_reference(stated: float, passed: bool) -> None:
    found = checks(ag.verify(MADE.truth, MADE.samples, ag.Reference.constant(stated)))
    error, verdict = found["magnitude against the reference"]
    assert verdict is passed
    assert error == pytest.approx(100 * (FIELD / stated - 1), abs=0.2)


def test_a_magnitude_per_sample_is_followed() -> None:
    wanted = FIELD * np.linspace(0.5, 1.5, 2000)
    samples = ag.Samples(field=MADE.field_b * (wanted / FIELD)[:, None])
    found = ag.verify(EXACT, samples, ag.Reference.magnitude(wanted))
    assert found.spread_after < 1e-9
    assert found.passed


@pytest.mark.parametrize(("claimed", "passed"), [(250.0, True), (100.0, False)])
def test_residuals_are_held_against_the_noise_claimed(claimed: float, passed: bool) -> None:
    found = checks(ag.verify(MADE.truth, MADE.samples, noise=claimed))
    ratio, verdict = found["held-out residual over noise"]
    assert verdict is passed
    assert ratio == pytest.approx(250.0 / claimed, rel=0.1)


def test_only_the_rows_held_out_are_judged() -> None:
    rows = np.zeros(2000, dtype=bool)
    rows[:500] = True
    corrected = MADE.truth.correct(MADE.samples.field)
    corrected[500:] *= np.linspace(1, 3, 1500)[:, None]
    judged = ag.verify(MADE.truth, MADE.samples, corrected=corrected, held_out=rows)
    assert judged.passed
    assert not ag.verify(MADE.truth, MADE.samples, corrected=corrected).passed


def test_a_few_gross_readings_do_not_decide_the_spread() -> None:
    samples = with_outliers(0.02)(MADE.samples)
    clean, spoilt = (ag.verify(MADE.truth, s).spread_after for s in (MADE.samples, samples))
    assert spoilt == pytest.approx(clean, rel=0.05)


def test_the_turn_against_the_logged_calibration_informs_only() -> None:
    turned = np.array([[np.cos(0.1), -np.sin(0.1), 0], [np.sin(0.1), np.cos(0.1), 0], [0, 0, 1]])
    logged = Logged(bias=MADE.truth.bias, matrix=turned @ MADE.truth.matrix, source="PARM")
    found = ag.verify(MADE.truth, MADE.samples.with_columns(logged=logged))
    angle, verdict = checks(found)["turn against the logged calibration"]
    assert verdict is None
    # a turn by α about z moves directions at colatitude θ by α sin θ; rms over the sphere √(2/3) α
    assert angle == pytest.approx(np.degrees(0.1) * np.sqrt(2 / 3), rel=0.05)


def test_a_calibration_that_is_worse_than_the_logged_one_is_told() -> None:
    bent = ag.Affine(bias=MADE.truth.bias + np.array([1500.0, 0.0, 0.0]), matrix=MADE.truth.matrix)
    logged = Logged(bias=MADE.truth.bias, matrix=MADE.truth.matrix, source="PARM")
    samples = MADE.samples.with_columns(logged=logged)
    name = "spread after over the logged calibration's"
    (same, kept), (worse, replaced) = (
        checks(ag.verify(one, samples))[name] for one in (MADE.truth, bent)
    )
    assert kept
    assert same == pytest.approx(1.0)
    assert not replaced
    assert worse > 2.0


def test_units_must_meet() -> None:
    with pytest.raises(ag.UnitError):
        ag.verify(EXACT, ag.Samples(field=np.eye(3), unit="raw"))


def test_readings_that_are_mostly_zero_have_no_spread_to_compare() -> None:
    field = np.zeros((30, 3))
    field[:3] = 1000.0 * np.eye(3)
    found = ag.verify(ag.Affine(bias=np.ones(3), matrix=np.eye(3)), ag.Samples(field=field))
    assert found.spread_before == float("inf")
    assert checks(found)["spread after over before"] == (0.0, True)
