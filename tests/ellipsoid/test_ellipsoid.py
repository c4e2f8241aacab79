"""`fit_ellipsoid` recovers the truth and says what it did."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.simulation import (
    clipped,
    quantised,
    simulate,
    with_correlated_noise,
    with_outliers,
)
from tests.ellipsoid.sensors import FIELD, FREE, KNOWN, MODELS, assert_close, made


@pytest.mark.parametrize(
    ("method", "model"),
    [*product(["likelihood", "adjusted", "linear"], MODELS), ("li-griffiths", "full")],
)
def test_each_method_finds_each_model(method: str, model: str) -> None:
    sensor = made(model)
    fit = ag.fit_ellipsoid(sensor.samples, KNOWN, model=model, method=method, soft_iron_sd=None)
    assert_close(fit.calibration, sensor.truth, bias=20.0, matrix=5e-4)
    assert fit.noise == pytest.approx(100.0, rel=0.1)
    assert fit.calibration.model == model
    assert fit.ok
    assert fit.converged
    free = fit.sd > 0
    if model == "full":
        assert free.all()
    assert len(np.unique(fit.sd[free].round(12))) <= FREE[model]
    error = fit.calibration.bias - sensor.truth.bias
    assert np.abs(error / fit.sd[:3]).max() < 4


@pytest.mark.parametrize("kind", ["hand", "belt", "circle"])
def test_limited_coverage_is_enough_with_an_honest_error(kind: str) -> None:
    sensor = simulate(kind, n=3000, noise=100.0, **({"tilt_deg": 20} if kind != "hand" else {}))
    fit = ag.fit_ellipsoid(sensor.samples, KNOWN)
    error = fit.calibration.bias - sensor.truth.bias
    assert np.abs(error / fit.sd[:3]).max() < 4
    assert fit.ok


def test_noiseless_readings_give_the_truth_exactly() -> None:
    sensor = made(noise=0.0)
    for method in ("likelihood", "adjusted", "li-griffiths", "linear"):
        fit = ag.fit_ellipsoid(
            sensor.samples, KNOWN, model="full", method=method, soft_iron_sd=None
        )
        assert_close(fit.calibration, sensor.truth, bias=0.1, matrix=2e-6)


def test_a_triangular_gauge_keeps_the_z_axis_and_the_magnitudes() -> None:
    sensor = made()
    plain = ag.fit_ellipsoid(sensor.samples, KNOWN, model="full")
    turned = ag.fit_ellipsoid(sensor.samples, KNOWN, model="full", gauge="triangular")
    upper = turned.calibration.matrix
    assert not np.tril(upper, -1).any()
    raw = sensor.samples.field
    assert turned.calibration.bias == pytest.approx(plain.calibration.bias)
    assert np.linalg.norm(turned.calibration.correct(raw), axis=1) == pytest.approx(
        np.linalg.norm(plain.calibration.correct(raw), axis=1)
    )
    moved = raw + np.array([500.0, -300.0, 0.0])  # what x and y read does not reach z
    assert turned.calibration.correct(moved)[:, 2] == pytest.approx(
        turned.calibration.correct(raw)[:, 2]
    )
    rigid = Rotation.align_vectors(turned.calibration.correct(raw), plain.calibration.correct(raw))
    assert rigid[1] / np.sqrt(len(raw)) < 0.1  # nT
    spread = [np.trace(f.calibration.uncertainty(raw[:1])[0]) for f in (plain, turned)]
    assert spread[1] < 9 * spread[0]


def test_without_a_reference_the_mean_gain_is_one_and_it_is_said() -> None:
    sensor = made(n=4000)
    fit = ag.fit_ellipsoid(sensor.samples)
    gain = np.trace(sensor.truth.matrix) / 3
    assert np.trace(fit.calibration.matrix) / 3 == pytest.approx(1.0)
    assert fit.calibration.matrix == pytest.approx(sensor.truth.matrix / gain, abs=5e-4)
    assert fit.calibration.bias == pytest.approx(sensor.truth.bias, abs=20.0)
    assert fit.calibration.magnitude == pytest.approx(FIELD / gain, rel=1e-3)
    assert fit.calibration.unit_out == "nT"
    assert "no reference magnitude was given, so the mean gain is set to 1" in fit.status.lower()


def test_raw_counts_come_out_in_nanotesla_with_a_reference_and_raw_without() -> None:
    sensor = made(counts_per_nT=0.02, defects=[quantised(1.0)])
    known, unknown = (ag.fit_ellipsoid(sensor.samples, r) for r in (KNOWN, None))
    assert (known.calibration.unit_in, known.calibration.unit_out) == ("raw", "nT")
    assert known.calibration.matrix == pytest.approx(sensor.truth.matrix, rel=2e-3, abs=0.03)
    assert known.calibration.bias == pytest.approx(sensor.truth.bias, abs=0.5)
    assert known.noise == pytest.approx(np.sqrt(2.0**2 + 1 / 12), rel=0.1)
    assert (unknown.calibration.unit_in, unknown.calibration.unit_out) == ("raw", "raw")
    assert np.trace(unknown.calibration.matrix) == pytest.approx(3.0)
    assert known.ok
    assert unknown.ok


def test_a_magnitude_per_sample_is_followed() -> None:
    sensor = made()
    ratio = np.linspace(0.6, 1.4, 2000)
    raw = sensor.field_b * ratio[:, None] @ np.linalg.inv(sensor.truth.matrix).T + sensor.truth.bias
    samples = sensor.samples.with_columns(field=raw)
    fit = ag.fit_ellipsoid(samples, ag.Reference.magnitude(FIELD * ratio), model="full")
    assert_close(fit.calibration, sensor.truth, bias=1.0, matrix=1e-4)
    assert fit.ok
    vectors = ag.Reference.vector(sensor.field_b * ratio[:, None], frame="m")
    assert ag.fit_ellipsoid(samples, vectors, model="full").calibration.bias == pytest.approx(
        fit.calibration.bias
    )


def test_an_uncertain_reference_makes_gains_uncertain_and_bias_not() -> None:
    sensor = made()
    exact, doubtful = (
        ag.fit_ellipsoid(sensor.samples, ag.Reference.constant(FIELD, sd=sd)) for sd in (0.0, 500.0)
    )
    assert doubtful.sd[:3] == pytest.approx(exact.sd[:3])
    assert doubtful.sd[3:6] == pytest.approx(0.01 * np.diag(sensor.truth.matrix), rel=0.02)


@pytest.mark.parametrize(
    ("model", "sentence"),
    [
        ("sphere", "no sign of soft iron (p ="),
        ("diagonal", "unequal gains are present (p < 1e-6)"),
        ("full", "soft iron or non-orthogonal axes are present (p < 1e-6)"),
    ],
)
def test_auto_says_what_of_soft_iron_is_there(model: str, sentence: str) -> None:
    """The full model, whose soft iron is as small as the evidence has it: no worse than the model
    that made the readings."""
    made_by = [made(model, seed=seed) for seed in range(5)]
    fits = [ag.fit_ellipsoid(sensor.samples, KNOWN) for sensor in made_by]
    for fit, sensor in zip(fits, made_by, strict=True):
        assert fit.calibration.model == "full"
        assert sentence in fit.tests[0].sentence
        assert [test.smaller for test in fit.tests] == ["sphere", "diagonal"]
        assert sentence[1:] in fit.status
        told = ag.fit_ellipsoid(sensor.samples, KNOWN, model=model)
        assert np.abs(fit.calibration.bias - told.calibration.bias).max() < 25.0
        assert np.abs(fit.calibration.matrix - told.calibration.matrix).max() < 2e-3
    crossed = fits[0].tests[1].sentence
    assert crossed.startswith("cross-axis" if model == "full" else "no sign of cross-axis")


@pytest.mark.slow
def test_absence_is_not_concluded_where_nothing_could_be_seen() -> None:
    """Too few directions to see soft iron of 10 %: its error holds what it may be."""
    seen = []
    for seed in range(10):
        sensor = simulate("circle", tilt_deg=20, n=300, noise=500.0, seed=seed)
        fit = ag.fit_ellipsoid(sensor.samples, KNOWN)
        seen.append(np.abs((fit.calibration.bias - sensor.truth.bias) / fit.sd[:3]).max())
    assert max(seen) < 4


def test_outliers_do_not_reach_a_robust_fit() -> None:
    clean, spoilt = (made(defects=defects) for defects in ([], [with_outliers(0.05)]))
    known = ag.fit_ellipsoid(clean.samples, KNOWN)
    robust = ag.fit_ellipsoid(spoilt.samples, KNOWN)
    assert np.abs((robust.calibration.bias - known.calibration.bias) / known.sd[:3]).max() < 1.5
    plain = ag.fit_ellipsoid(spoilt.samples, KNOWN, robust=False)
    assert np.abs((plain.calibration.bias - known.calibration.bias) / known.sd[:3]).max() > 5
    assert robust.weights is not None
    moved = np.abs(spoilt.samples.field - clean.samples.field).any(axis=1)
    assert (robust.weights[moved] == 0).mean() > 0.7  # those along the surface look like readings
    assert (robust.weights[~moved] > 0).all()


def test_clipped_rows_are_left_out_of_the_fit_but_not_of_its_residuals() -> None:
    whole = simulate("tumble", n=3000, seed=4)
    limit = 0.8 * np.abs(whole.samples.field).max()
    samples = clipped(limit)(whole.samples)
    fit = ag.fit_ellipsoid(samples, KNOWN)
    rows = (np.abs(samples.field) >= limit).any(axis=1)
    assert fit.n == 3000 - rows.sum()
    assert len(fit.residuals) == 3000
    assert np.array_equal(fit.weights == 0, rows)
    assert np.abs((fit.calibration.bias - whole.truth.bias) / fit.sd[:3]).max() < 4
    assert np.abs(fit.residuals[rows]).max() > 10 * fit.noise


def test_correlated_noise_counts_for_less() -> None:
    white = simulate("tumble", n=6000, noise=200.0, seed=1)
    still = simulate("tumble", n=6000, noise=1.0, seed=1)
    coloured = with_correlated_noise(200.0, 0.5)(still.samples)
    first, second = (ag.fit_ellipsoid(s, KNOWN) for s in (white.samples, coloured))
    assert first.correlation < 1.2
    assert second.correlation > 5
    assert second.sd[0] / first.sd[0] > 0.8 * np.sqrt(second.correlation)


def test_the_prior_decides_only_what_the_readings_do_not() -> None:
    whole, cap = made(seed=3), simulate("circle", tilt_deg=8, n=500, noise=500.0, seed=3)
    for samples, agree in ((whole.samples, True), (cap.samples, False)):
        held = ag.fit_ellipsoid(samples, KNOWN, model="full")
        loose = ag.fit_ellipsoid(samples, KNOWN, model="full", soft_iron_sd=None)
        step = (held.calibration.bias - loose.calibration.bias) / loose.sd[:3]
        assert bool(np.abs(step).max() < 0.02) == agree
        assert bool(held.sd[2] > 0.99 * loose.sd[2]) == agree


@pytest.mark.slow
@settings(max_examples=10)
@given(st.integers(0, 2**32 - 1))
def test_turned_axes_turn_the_result(seed: int) -> None:
    sensor = made(n=500)
    turn = Rotation.random(random_state=seed).as_matrix()
    turned = sensor.samples.with_columns(field=sensor.samples.field @ turn.T)
    plain, other = (
        ag.fit_ellipsoid(s, KNOWN, model="full", robust=False) for s in (sensor.samples, turned)
    )
    step = 0.5 * plain.sd[:3].max()  # terms of the sensor go along its axes
    assert other.calibration.bias == pytest.approx(turn @ plain.calibration.bias, abs=step)
    back = turn.T @ other.calibration.matrix @ turn
    assert back == pytest.approx(plain.calibration.matrix, abs=0.5 * plain.sd[3:].max())


@pytest.mark.parametrize("method", ["likelihood", "adjusted"])
def test_units_and_order_do_not_matter(method: str) -> None:
    sensor = made(n=500)
    plain = ag.fit_ellipsoid(sensor.samples, KNOWN, model="full", method=method)
    scaled = ag.Samples(field=sensor.samples.field * 1e-3, unit="uT")
    backwards = ag.Samples(field=sensor.samples.field[::-1])
    for samples in (scaled, backwards):
        other = ag.fit_ellipsoid(samples, KNOWN, model="full", method=method)
        step = 0.5 * plain.sd[:3].max()  # terms of the sensor go along its axes
        assert other.calibration.bias == pytest.approx(plain.calibration.bias, abs=step)
    counts = ag.Samples(field=sensor.samples.field * 0.02, unit="raw")
    raw = ag.fit_ellipsoid(counts, KNOWN, model="full", method=method)
    assert raw.calibration.bias / 0.02 == pytest.approx(plain.calibration.bias, abs=step)
    assert raw.sd[:3] / 0.02 == pytest.approx(plain.sd[:3], rel=0.01)
    assert raw.sd[3:] * 0.02 == pytest.approx(plain.sd[3:], rel=0.01)


def test_the_same_readings_give_the_same_result() -> None:
    samples = made(defects=[with_outliers(0.05)]).samples
    one, two = (ag.fit_ellipsoid(samples, KNOWN).calibration for _ in range(2))
    assert np.array_equal(one.bias, two.bias)
    assert np.array_equal(one.covariance, two.covariance)


def test_a_result_tells_where_it_came_from() -> None:
    samples = made().samples.with_columns(temperature=np.linspace(10, 30, 2000), name="MAG2")
    affine = ag.fit_ellipsoid(samples, KNOWN, soft_iron_sd=0.05, gauge="triangular").calibration
    chosen = affine.provenance.settings
    assert chosen["soft_iron_sd"] == 0.05
    assert chosen["gauge"] == affine.gauge == "triangular"
    assert chosen["model"] == "auto"
    assert chosen["method"] == "likelihood"
    assert chosen["reference"] == "50000 nT (given)"
    assert chosen["robust"] is True
    assert "huber-1981" in affine.provenance.method
    assert affine.provenance.inputs[0].count == 2000
    assert affine.sensor == "MAG2"
    assert affine.validity.temperature_C == (10.0, 30.0)
    assert affine.validity.largest_reading == np.abs(samples.field).max()
    assert affine.magnitude == FIELD


def test_a_scale_that_cannot_be_is_to_be_looked_at() -> None:
    fit = ag.fit_ellipsoid(made().samples, ag.Reference.constant(500_000.0))
    (finding,) = [finding for finding in fit.findings if finding.severity != "note"]
    assert (finding.name, finding.severity) == ("scale", "check")
    assert "check the unit of the log and the reference magnitude" in finding.sentence
