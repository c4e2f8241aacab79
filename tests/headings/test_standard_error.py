"""The standard error of a heading is honest: error over sd has mean 0 and sd 1 over many flights.

What lasts (calibration, tilt, declination, deviation) is common to a flight, so each flight gives
one number. Fixed seeds; limits are three standard errors of so many draws.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.chain import Chain
from agonic.calibration.deviation import Deviation
from agonic.calibration.interference import Interference, turn_calibration
from agonic.ellipsoid import fit_ellipsoid
from agonic.files.calibration import load, save
from agonic.headings.propagation import apply_steps, list_steps, propagate
from agonic.reference import Reference
from agonic.simulation import simulate
from tests.headings.flights import FIELD, each_row, flight, off_deg, plain, setup_for, truth_of

DRAWS = 120
SD_WITHIN = 3 / np.sqrt(2 * DRAWS)
MEAN_WITHIN = 3 / np.sqrt(DRAWS)


def scores(draw) -> np.ndarray:
    return np.array([draw(seed, np.random.default_rng(seed + 10_000)) for seed in range(DRAWS)])


def assert_standard_normal(z: np.ndarray) -> None:
    assert z.std() == pytest.approx(1.0, abs=SD_WITHIN)
    assert abs(z.mean()) < MEAN_WITHIN
    assert np.mean(np.abs(z) < 1.96) == pytest.approx(0.95, abs=0.05)


@cache
def fitted(seed: int, noise: float = 200.0):
    """A sensor, and what an ellipsoid fit to 400 of its readings finds."""
    made = simulate("tumble", n=400, noise=noise, magnitude=FIELD, seed=seed)
    known = Reference.constant(FIELD)
    fit = fit_ellipsoid(made.samples, known, model="full", soft_iron_sd=None, robust=False)
    return made.truth, fit.calibration


@pytest.mark.slow
def test_on_flights_with_a_fitted_calibration() -> None:
    tilt_sd, declination_sd = 0.4, 0.3

    def draw(seed, rng) -> float:
        truth, calibration = fitted(seed)
        s = flight(seed + 500, n=60, calibration=truth, noise=200.0).samples
        roll, pitch = tilt_sd * rng.standard_normal(2)
        seen = s.with_columns(roll_deg=s.roll_deg + roll, pitch_deg=s.pitch_deg + pitch)
        setup = setup_for(
            calibration,
            tilt_sd_deg=tilt_sd,
            declination_sd_deg=declination_sd,
            declination_deg=2.0 + declination_sd * rng.standard_normal(),
        )
        found = each_row(seen, setup)
        row = rng.integers(len(s))
        return float(off_deg(found.true_deg, truth_of(s))[row] / found.sd_deg[row])

    assert_standard_normal(scores(draw))


@pytest.mark.slow
def test_the_part_that_lasts_is_honest_by_itself() -> None:
    def draw(seed, rng) -> float:
        truth, calibration = fitted(seed)
        s = flight(seed + 500, n=60, calibration=truth).samples
        found = each_row(s, setup_for(replace(calibration, noise=0.0), tilt_sd_deg=0.0))
        row = rng.integers(len(s))
        assert found.random_sd_deg[row] == 0.0
        return float(off_deg(found.true_deg, truth_of(s))[row] / found.sd_deg[row])

    assert_standard_normal(scores(draw))


@pytest.mark.slow
def test_the_covariance_of_a_bias_counts_in_every_row(tmp_path) -> None:
    """Also of a calibration that was saved, and is used in other axes than it was made in."""
    root = np.array([[200.0, 0, 0], [50, 300, 0], [-80, 40, 250]])
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])

    def draw(seed, rng) -> float:
        made = flight(seed + 500, n=60)
        off = made.truth.bias + root @ rng.standard_normal(3)
        covariance = np.zeros((9, 9))
        covariance[:3, :3] = root @ root.T
        off = replace(made.truth, bias=off, covariance=covariance)
        saved = load(save(turn_calibration(off, turn), tmp_path / "mag.json"))
        s = made.samples.with_columns(field=made.samples.field @ turn)
        found = each_row(s, setup_for(saved, tilt_sd_deg=0.0))
        again = each_row(made.samples, setup_for(off, tilt_sd_deg=0.0))
        np.testing.assert_allclose(found.sd_deg, again.sd_deg, rtol=1e-6)
        row = rng.integers(len(s))
        return float(off_deg(again.true_deg, truth_of(s))[row] / found.sd_deg[row])

    assert_standard_normal(scores(draw))


def test_the_part_of_the_noise_is_honest_in_every_row() -> None:
    made = flight(3, n=5000, noise=150.0)
    exact = replace(made.truth, covariance=np.zeros((9, 9)))
    found = each_row(made.samples, setup_for(exact, tilt_sd_deg=0.0))
    z = off_deg(found.true_deg, truth_of(made.samples)) / found.sd_deg
    assert found.sd_deg == pytest.approx(found.random_sd_deg)
    assert z.std() == pytest.approx(1.0, abs=3 / np.sqrt(2 * 5000))
    assert found.sd_deg.max() > 1.15 * found.sd_deg.min()  # or one number would have done


def test_interpolated_readings_are_quieter_by_as_much_as_stated() -> None:
    made = flight(4, n=4000, noise=150.0, rate_Hz=200.0)
    exact = replace(made.truth, covariance=np.zeros((9, 9)))
    late = 0.0025  # half-way between readings: the mean of two
    found = each_row(made.samples, setup_for(exact, latency_s=late, tilt_sd_deg=0.0))
    clean = each_row(made.samples, setup_for(exact, tilt_sd_deg=0.0))
    rows = ~found.flags["no reading"]
    ratio = found.sd_deg[rows] / clean.sd_deg[rows]
    assert np.median(ratio) == pytest.approx(np.sqrt(0.5), rel=0.02)
    unbroken = np.unwrap(truth_of(made.samples), period=360)
    truth = np.interp(made.samples.time + late, made.samples.time, unbroken)
    z = off_deg(found.true_deg, truth)[rows] / found.sd_deg[rows]
    assert z.std() == pytest.approx(1.0, abs=0.15)


@pytest.mark.slow
def test_deviation_adds_its_own_error_and_stretches_the_rest() -> None:
    rng = np.random.default_rng(8)
    root = np.zeros((9, 5))
    root[:5] = 0.2 * rng.standard_normal((5, 5))
    true = Deviation(coefficients=[1.0, 15.0, -12.0, 6.0, 3.0])
    made = flight(5, n=400, noise=300.0)
    exact = replace(made.truth, covariance=np.zeros((9, 9)))
    z = []
    for seed in range(DRAWS):
        draw = np.random.default_rng(seed)
        noisy = made.samples.with_columns(
            field=made.samples.field + 300.0 * draw.standard_normal((400, 3))
        )
        found = true.coefficients + root[:5] @ draw.standard_normal(5)
        card = Deviation(coefficients=found, covariance=root @ root.T)
        right = each_row(made.samples, setup_for(exact, deviation=true, tilt_sd_deg=0.0))
        mistaken = setup_for(replace(exact, noise=300.0), deviation=card, tilt_sd_deg=0.0)
        seen = each_row(noisy, mistaken)
        row = draw.integers(400)
        z.append(off_deg(seen.true_deg[row], right.true_deg[row]) / seen.sd_deg[row])
    assert_standard_normal(np.array(z))


def test_what_is_carried_back_is_the_covariance_of_the_field() -> None:
    rng = np.random.default_rng(1)

    def covariance(m: int) -> np.ndarray:
        size = np.r_[30.0 * np.ones(3), 1e-3 * np.ones(m - 3)]
        root = size[:, None] * rng.standard_normal((m, m))
        return root @ root.T

    raw, current = 30_000 * rng.standard_normal((7, 3)), rng.uniform(0, 20, 7)
    gradient = rng.standard_normal((3, 7))
    common = {"bias": [100.0, -50, 30], "matrix": np.eye(3) + 0.1 * rng.standard_normal((3, 3))}
    motors = Interference(
        **common,
        gauge="free",
        sources=("current_A",),
        coefficients=np.ones((3, 1)),
        covariance=covariance(15),
    )
    for step in (
        Affine(**common, covariance=covariance(9)),
        Affine(**common, gauge="triangular", covariance=covariance(9)),
        Affine(**common, gauge="free", covariance=covariance(12)),
        motors,
    ):
        columns = {"current_A": current}
        steps = list_steps(step)
        lasting, *_ = propagate(steps, apply_steps(steps, raw, columns), columns, gradient)
        full = step.uncertainty(raw, **columns)
        assert lasting == pytest.approx(np.einsum("in,nij,jn->n", gradient, full, gradient))


def test_steps_of_a_chain_add_up() -> None:
    rng = np.random.default_rng(2)
    turn = Rotation.from_euler("ZYX", [30.0, -50.0, 70.0], degrees=True)
    made = simulate("tumble", n=5, noise=100.0, seed=2)
    mounting = Alignment(rotation=turn, covariance=np.diag([1e-4, 4e-4, 9e-4]))
    first = replace(made.truth, covariance=np.diag([900.0] * 3 + [1e-6] * 6), noise=100.0)
    steps = list_steps(Chain(steps=(first, mounting)))
    raw, gradient = made.samples.field, rng.standard_normal((3, 5))
    lasting, noise, _ = propagate(steps, apply_steps(steps, raw, {}), {}, gradient)
    draws = []
    for _ in range(4000):
        bent = Rotation.from_rotvec([0.01, 0.02, 0.03] * rng.standard_normal(3)) * turn
        error = np.sqrt(np.diag(first.covariance)) * rng.standard_normal(9)
        matrix = first.matrix + np.array(
            [
                [error[3], error[6], error[7]],
                [error[6], error[4], error[8]],
                [error[7], error[8], error[5]],
            ]
        )
        field = bent.apply((raw - first.bias - error[:3]) @ matrix.T)
        draws.append(np.einsum("in,ni->n", gradient, field))
    assert lasting == pytest.approx(np.var(draws, axis=0), rel=0.1)  # 4000 draws: 2.2 % each
    through = first.matrix.T @ turn.as_matrix().T @ gradient
    assert noise == pytest.approx(100.0**2 * (through**2).sum(axis=0))


def test_what_is_not_known_is_said() -> None:
    made = flight(n=10)
    bare = Affine(bias=made.truth.bias, matrix=made.truth.matrix)
    card = Deviation(coefficients=[1.0, 0, 0, 0, 0])
    said = " ".join(each_row(made.samples, setup_for(bare, deviation=card)).notes)
    assert "has no covariance" in said
    assert "noise of mag is not known" in said
    assert "deviation card of mag has no covariance" in said


def test_a_hopeless_heading_is_no_worse_than_unknown() -> None:
    s = flight(n=3).samples.with_columns(field=np.tile([0.1, 0.0, 50_000.0], (3, 1)))
    found = each_row(
        s.with_columns(roll_deg=np.zeros(3), pitch_deg=np.zeros(3)), setup_for(plain())
    )
    assert found.sd_deg == pytest.approx(360 / np.sqrt(12))
    assert found.flags["vertical field"].all()
