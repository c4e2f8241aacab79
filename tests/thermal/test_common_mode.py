"""What series have in common and what is each one's own, against series made of known parts."""

import numpy as np
import pytest

from agonic.thermal.common_mode import estimate_common_mode


def made(
    seed: int, own: list[float], common: float, n: int = 2000
) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    shared = common * rng.normal(size=(n, 2))
    return shared, shared + np.array(own)[:, None, None] * rng.normal(size=(len(own), n, 2))


@pytest.mark.parametrize("own", [[3.0, 5.0], [1.0, 1.0, 4.0], [2.0, 3.0, 5.0, 5.0, 5.0]])
def test_the_parts_are_found_whatever_the_number_of_series(own) -> None:
    shared, series = made(1, own, 6.0)
    found = estimate_common_mode(series)
    assert found.common_sd == pytest.approx(6.0, rel=0.05)
    assert found.own_sd == pytest.approx(own, rel=0.15, abs=0.2)
    best = 1 / np.sqrt(np.sum(1 / np.square(own)))  # the error of the weighted mean
    error = np.sqrt(np.mean((found.common - shared) ** 2))
    assert error < 1.1 * best + 0.05


def test_nothing_in_common_is_found_to_be_nothing() -> None:
    found = [estimate_common_mode(made(seed, [2.0, 3.0, 4.0], 0.0)[1]) for seed in range(20)]
    assert np.mean([one.common_sd**2 for one in found]) < 0.05


def test_the_variances_are_right_on_average() -> None:
    found = [estimate_common_mode(made(seed, [2.0, 3.0, 4.0], 5.0, n=60)[1]) for seed in range(200)]
    assert np.mean([one.common_sd**2 for one in found]) == pytest.approx(25.0, rel=0.05)
    assert np.mean([one.own_sd**2 for one in found], axis=0) == pytest.approx([4, 9, 16], rel=0.1)


def test_series_without_anything_of_their_own_agree() -> None:
    shared = np.random.default_rng(0).normal(size=(50, 3))
    found = estimate_common_mode(np.array([shared, shared, shared]))
    assert found.common == pytest.approx(shared)
    assert found.own_sd == pytest.approx([0, 0, 0], abs=1e-7)
