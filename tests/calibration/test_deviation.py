"""The deviation card as a calibration."""

import numpy as np
import pytest
from scipy.stats import t as student

from agonic.calibration.deviation import Deviation, format_east_west, name_heading
from agonic.errors import AgonicError

CARD = Deviation(
    coefficients=[1.0, 12.0, 8.0, 5.0, 1.5],
    heel=[-0.07, 0.01, 0.02, 0.0],
    covariance=np.diag([0.01, 0.02, 0.02, 0.02, 0.02, 1e-4, 1e-4, 1e-4, 1e-4]),
    freedom=3.0,
)
COMPASS = np.arange(0.0, 360.0, 5.0)


def test_the_deviation_is_the_published_series() -> None:
    psi = np.radians(COMPASS)
    expected = 1 + 12 * np.sin(psi) + 8 * np.cos(psi) + 5 * np.sin(2 * psi) + 1.5 * np.cos(2 * psi)
    assert CARD.at(COMPASS) == pytest.approx(expected)
    heeled = 15 * (-0.07 * np.cos(psi) + 0.01 * np.sin(psi)) - 4 * 0.02 * np.cos(psi)
    assert CARD.at(COMPASS, 15.0, -4.0) == pytest.approx(expected + heeled)


def test_east_is_added() -> None:
    assert Deviation(coefficients=[3.0, 0, 0, 0, 0]).magnetic(359.0) == pytest.approx(2.0)


def test_steering_undoes_the_card_level_and_heeled() -> None:
    for tilt in ((), (15.0, -4.0)):
        assert CARD.steer(CARD.magnetic(COMPASS, *tilt), *tilt) == pytest.approx(COMPASS, abs=1e-9)


def test_the_standard_error_is_that_of_the_covariance() -> None:
    draws = np.random.default_rng(0).multivariate_normal(np.zeros(9), CARD.covariance, 20_000)
    rows = np.array([CARD._rows(50.0, 10.0, 3.0)])
    # widened so that 1.96 of them are the 95 % of Student's t
    widened = student(3).ppf(0.975) / 1.95996
    wanted = widened * np.std(draws @ rows.T)
    assert CARD.sd_at(50.0, 10.0, 3.0) == pytest.approx(wanted, rel=0.02)
    assert CARD.band_at(COMPASS) == pytest.approx(1.95996 * CARD.sd_at(COMPASS), rel=1e-4)
    narrower = student(3).ppf(0.84) / widened * CARD.sd_at(COMPASS)
    assert CARD.band_at(COMPASS, 0.68) == pytest.approx(narrower, rel=1e-4)


def test_a_known_noise_gives_a_gaussian_band() -> None:
    card = Deviation(coefficients=[0.0] * 5, covariance=np.eye(9) * 0.01)
    assert card.band_at(0.0) == pytest.approx(1.95996 * float(card.sd_at(0.0)), rel=1e-4)


def test_a_card_without_covariance_says_so() -> None:
    with pytest.raises(AgonicError, match="no covariance"):
        Deviation(coefficients=[0.0] * 5).sd_at(0.0)


def test_a_compass_that_turns_back_is_known_by_its_least_turn() -> None:
    assert CARD.least_turn > 0
    assert Deviation(coefficients=[0.0, 60.0, 0, 0, 0]).least_turn == pytest.approx(
        1 - np.radians(60.0)
    )


@pytest.mark.parametrize("wrong", [[1.0], [1.0, 2, 3, 4, np.nan]])
def test_coefficients_are_five_finite_numbers(wrong) -> None:
    with pytest.raises(AgonicError, match="coefficients must be finite"):
        Deviation(coefficients=wrong)


def test_words() -> None:
    assert [name_heading(h) for h in (0.0, 22.5, 100.0, 315.0)] == [
        "000° N",
        "022.5° NNE",
        "100°",
        "315° NW",
    ]
    assert [format_east_west(d) for d in (0.04, 0.06, -12.34)] == ["0.0°", "0.1° E", "12.3° W"]
    assert "+8.000 cos(compass)" in CARD.equation
