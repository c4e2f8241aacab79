"""The solver: against QR, augmented rows, derivatives of its losses, and Monte Carlo."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from agonic.maths.estimation import leastsq
from agonic.maths.estimation.loss import Loss, cauchy, squares, tukey
from agonic.maths.estimation.noise.residuals import correlation_length, noise_scale, robust_scale

LOSSES = {
    "squares": squares(),
    "cauchy": cauchy(),
    "tukey": tukey(),
}
TRUTH = np.array([2.0, -1.0, 0.5])
UNITS = np.array([1.0, 1e6, 1e-6])  # parameters in wildly different units


def line(n: int, seed: int, noise: float = 0.1):
    """A linear problem A x = y whose columns differ by twelve orders of magnitude."""
    rng = np.random.default_rng(seed)
    design = rng.normal([1.0, 0.0, 0.0], 1.0, (n, 3))
    return design / UNITS, design @ TRUTH + noise * rng.normal(size=n)


def in_pieces(design: np.ndarray, wanted: np.ndarray, edges: list[int]) -> leastsq.Pieces:
    """The residuals A x − y, cut at the edges."""
    cuts = [0, *edges, len(design)]

    def pieces(params: np.ndarray):
        return [(design[i:j] @ params - wanted[i:j], design[i:j]) for i, j in pairwise(cuts)]

    return pieces


@given(st.lists(st.integers(0, 200), max_size=5).map(sorted), st.integers(0, 99))
def test_pieces_one_piece_and_qr_agree(edges: list[int], seed: int) -> None:
    design, wanted = line(200, seed)
    found = leastsq.solve(in_pieces(design, wanted, edges), np.zeros(3), scale=0.1)
    expected = np.linalg.lstsq(design * UNITS, wanted, rcond=None)[0]
    assert found.converged
    assert found.params / UNITS == pytest.approx(expected, abs=1e-5)  # standard errors are 7e-3
    assert found.residuals == pytest.approx(design @ found.params - wanted)


def test_a_prior_is_more_rows() -> None:
    design, wanted = line(40, 1)
    held, towards = np.diag([3.0, 0.0, 20.0]) / UNITS, np.array([5.0, 0.0, 1.0])
    found = leastsq.solve(
        in_pieces(design, wanted, []),
        np.zeros(3),
        scale=0.1,
        tolerance=1e-9,
        prior=lambda x: (held @ x - towards, held),
    )
    rows = np.vstack([design / 0.1, held]) * UNITS
    right = np.concatenate([wanted / 0.1, towards])
    assert found.params / UNITS == pytest.approx(np.linalg.lstsq(rows, right, rcond=None)[0])


def test_correlation_counts_readings_for_less() -> None:
    design, wanted = line(200, 2)
    pieces = in_pieces(design, wanted, [])
    white = leastsq.solve(pieces, np.zeros(3), scale=0.1)
    coloured = leastsq.solve(pieces, np.zeros(3), scale=0.1, correlation=9.0)
    assert coloured.params / UNITS == pytest.approx(white.params / UNITS, abs=1e-4)
    assert np.diag(coloured.covariance) == pytest.approx(9 * np.diag(white.covariance))


@pytest.mark.parametrize("loss", LOSSES.values(), ids=LOSSES)
def test_weight_and_curvature_are_derivatives_of_the_loss(loss: Loss) -> None:
    z, h = np.linspace(0.05, 9.0, 200), 1e-4
    ahead, here, behind = (loss.value((z + k * h) ** 2) for k in (1, 0, -1))
    assert loss.weight(z**2) == pytest.approx((ahead - behind) / (2 * h * z), abs=1e-6)
    inside = np.abs(z - 6.0) > h  # the biweight's curvature jumps at its edge
    bend = (ahead - 2 * here + behind) / h**2
    assert loss.curvature(z**2)[inside] == pytest.approx(bend[inside], abs=1e-4)
    assert loss.weight(np.zeros(1)) == pytest.approx(1.0)
    assert loss.value(np.zeros(1)) == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("loss", "efficiency"),
    [(cauchy(), 0.95), (tukey(), 0.981)],
    ids=["cauchy", "tukey"],
)
def test_losses_have_the_efficiency_they_claim(loss: Loss, efficiency: float) -> None:
    z = np.linspace(-12, 12, 48_001)
    density = np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi) * (z[1] - z[0])
    scatter = (density * (loss.weight(z**2) * z) ** 2).sum()
    bend = (density * loss.curvature(z**2)).sum()
    assert bend**2 / scatter == pytest.approx(efficiency, abs=0.002)


@pytest.mark.parametrize("loss", LOSSES.values(), ids=LOSSES)
def test_covariance_is_that_of_many_draws(loss: Loss) -> None:
    errors, claimed = [], []
    for seed in range(400):
        design, wanted = line(60, seed)
        start = np.linalg.lstsq(design, wanted, rcond=None)[0]
        found = leastsq.solve(in_pieces(design, wanted, []), start, scale=0.1, loss=loss)
        errors.append(found.params / UNITS - TRUTH)
        claimed.append(np.sqrt(np.diag(found.covariance)) / UNITS)
    z = np.array(errors) / np.array(claimed)
    assert z.std(axis=0) == pytest.approx(np.ones(3), abs=0.12)  # 3.4 of its standard errors
    assert np.abs(z.mean(axis=0)).max() < 0.2


def test_tukey_is_deaf_to_gross_readings() -> None:
    design, wanted = line(300, 3)
    clean = np.linalg.lstsq(design * UNITS, wanted, rcond=None)[0]
    wanted[::10] += 50.0
    start = clean * UNITS * 1.01
    found = leastsq.solve(
        in_pieces(design, wanted, []), start, scale=0.1, loss=tukey(), tolerance=1e-6
    )
    assert found.params / UNITS == pytest.approx(clean, abs=0.01)


def test_a_curved_problem_converges_from_afar() -> None:
    t = np.linspace(0, 3, 50)
    truth = np.array([5.0, 1.3])

    def pieces(params: np.ndarray):
        size, rate = params
        decay = np.exp(-rate * t)
        jacobian = np.stack([decay, -size * t * decay], axis=1)
        return [(size * decay - truth[0] * np.exp(-truth[1] * t), jacobian)]

    found = leastsq.solve(pieces, np.array([1.0, 0.1]), scale=1e-3)
    assert found.converged
    assert found.params == pytest.approx(truth, abs=1e-5)


def test_what_the_readings_do_not_tell_stays_put_with_a_huge_variance() -> None:
    design, wanted = line(50, 4)
    design = np.hstack([design, np.zeros((50, 1))])
    found = leastsq.solve(in_pieces(design, wanted, []), np.full(4, 7.0), scale=0.1)
    assert found.params[3] == 7.0
    assert found.params[:3] / UNITS == pytest.approx(TRUTH, abs=0.06)
    variance = np.diag(found.covariance)
    assert np.isfinite(variance).all()
    assert variance[3] > 1e12 * variance[0]


def test_no_reading_within_reach_of_the_loss_is_no_crash() -> None:
    design, wanted = line(50, 5)
    found = leastsq.solve(in_pieces(design, wanted + 1e3, []), np.zeros(3), scale=0.1, loss=tukey())
    assert np.isfinite(found.covariance).all()
    assert (np.diag(found.covariance) > 1e6).all()
    assert found.condition > 1e12


def test_variances_stay_positive_where_the_information_is_singular() -> None:
    rng = np.random.default_rng(6)
    two = rng.normal(size=(100, 2))
    design = np.stack([two[:, 0], two[:, 1], two.sum(axis=1)], axis=1)
    wanted = two[:, 0] + rng.normal(size=100)
    found = leastsq.solve(in_pieces(design, wanted, []), np.zeros(3), scale=1.0)
    assert (np.diag(found.covariance) > 1e6).all()
    combined = np.array([[1.0, 0, 1], [0, 1, 1]])  # what the readings do tell
    assert (np.diag(combined @ found.covariance @ combined.T) < 1.0).all()


def test_inverse_and_condition_do_not_depend_on_units() -> None:
    rng = np.random.default_rng(7)
    design = rng.normal(size=(30, 3))
    information = design.T @ design
    other = information / np.outer(UNITS, UNITS)
    assert leastsq.inverse(information) == pytest.approx(np.linalg.inv(information))
    assert leastsq.inverse(other) == pytest.approx(
        np.linalg.inv(information) * np.outer(UNITS, UNITS)
    )
    assert leastsq.condition(other) == pytest.approx(leastsq.condition(information))
    assert leastsq.condition(np.diag([4.0, 9.0])) == pytest.approx(1.0)


@pytest.mark.parametrize("loss", LOSSES.values(), ids=LOSSES)
def test_scales_are_the_standard_deviation_of_gaussian_noise(loss: Loss) -> None:
    noise = 3.0 * np.random.default_rng(8).normal(size=200_000)
    assert robust_scale(noise) == pytest.approx(3.0, rel=0.01)
    assert noise_scale(noise, loss, 3.3, 0) == pytest.approx(3.0, rel=0.01)


def test_scales_make_up_for_the_freedom_that_the_fit_took() -> None:
    residuals = np.random.default_rng(8).normal(size=100)
    for scale in (
        robust_scale,
        lambda r, m: noise_scale(r, LOSSES["squares"], 1.0, m),
    ):
        assert scale(residuals, 50) == pytest.approx(np.sqrt(2) * scale(residuals, 0))


def test_tukeys_scale_is_deaf_to_gross_readings() -> None:
    noise = np.random.default_rng(9).normal(size=10_000)
    noise[:500] += 100.0
    assert noise_scale(noise, tukey(), 1.0, 0) == pytest.approx(1.0, rel=0.03)


@pytest.mark.parametrize("rho", [0.3, 0.8, 0.95])
def test_correlation_length_of_a_markov_series(rho: float) -> None:
    white = np.random.default_rng(10).normal(size=200_000)
    series = lfilter([1.0], [1.0, -rho], white)
    expected = (1 + rho) / (1 - rho)
    found = correlation_length(series, np.ones(len(series)))
    assert found == pytest.approx(expected, rel=0.06)


def test_white_residuals_count_one_each() -> None:
    draws = np.random.default_rng(11).normal(size=(200, 1000))
    lengths = np.array([correlation_length(z, np.ones(1000)) for z in draws])
    assert (lengths == 1.0).mean() > 0.95
    assert lengths.max() < 1.3


def test_correlation_is_not_told_from_few_readings() -> None:
    assert correlation_length(np.ones(19), np.ones(19)) == 1.0
    assert correlation_length(np.zeros(100), np.ones(100)) == 1.0


def test_channels_weigh_by_their_own_noise_and_correlation() -> None:
    """Two instruments of one unknown: the weighted mean, and its standard error."""
    rng = np.random.default_rng(5)
    sharp, blunt = 3.0 + 0.1 * rng.normal(size=400), 3.0 + 1.0 * rng.normal(size=400)

    def of(values: np.ndarray) -> leastsq.Pieces:
        return lambda params: [(params[0] - values, np.ones((len(values), 1)))]

    found = leastsq.solve_together(
        [
            leastsq.Channel(of(sharp), 0.1, squares(), 4.0),
            leastsq.Channel(of(blunt), 1.0, squares()),
        ],
        np.zeros(1),
    )
    weights = np.array([400 / 0.1**2 / 4.0, 400 / 1.0**2])
    mean = (weights @ [sharp.mean(), blunt.mean()]) / weights.sum()
    assert found.params == pytest.approx([mean], abs=1e-4)
    assert found.covariance[0, 0] == pytest.approx(1 / weights.sum(), rel=0.1)
    assert len(found.residuals) == 800


def test_the_noise_of_one_channel_is_not_taken_for_that_of_another() -> None:
    """A channel whose scale is stated too small keeps its own sandwich."""
    rng = np.random.default_rng(6)
    values = rng.normal(size=(2, 500))

    def of(values: np.ndarray, column: int) -> leastsq.Pieces:
        row = np.eye(2)[column]
        return lambda params: [(params[column] - values, np.tile(row, (len(values), 1)))]

    found = leastsq.solve_together(
        [
            leastsq.Channel(of(values[0], 0), 1.0, squares()),
            leastsq.Channel(of(values[1], 1), 0.1, squares()),
        ],
        np.zeros(2),
    )
    assert np.diag(found.covariance) == pytest.approx([1 / 500, 1 / 500], rel=0.15)


def test_steps_that_shrink_slowly_end_soon() -> None:
    """A second population within reach of the loss: its cost curves half as much as its weights."""
    rng = np.random.default_rng(0)
    values = np.concatenate([rng.normal(size=400), rng.normal(4.0, size=200)])
    design = np.ones((len(values), 1))
    found = leastsq.solve(
        in_pieces(design, values, []), np.array([2.0]), scale=1.0, loss=tukey(), tolerance=1e-6
    )
    z = found.params - values
    assert found.converged
    assert found.iterations <= 5  # 22 by plain steps
    assert np.sum(tukey().weight(z * z) * z) == pytest.approx(0.0, abs=1e-3)
