"""Steps and strays: where they are, none where there is none, and how small ones can be found."""

import numpy as np
import pytest

from agonic.history.maths.change_points import MIN_VALUES, ChangePoint, find_change_points
from agonic.history.maths.drift_model import Series

CHANCE = 0.004
PARAMETERS = 9
MADE_OF = {"scatter": (0.1, 1.0, 0.0), "walk": (0.1, 0.0, 3.0), "formal": (1.0, 0.0, 0.0)}


def sensor(
    n: int, made: tuple[float, float, float], seed: int, moved: np.ndarray | None = None
) -> list[Series]:
    """Nine drifting parameters; `moved` (3, n) is added to the first three."""
    rng = np.random.default_rng(seed)
    formal, scatter, walk = made
    time = np.linspace(0.0, 1.0, n)
    steps = rng.normal(size=(PARAMETERS, n)) * np.sqrt(np.diff(time, prepend=0.0))
    value = 2.0 * time + walk * np.cumsum(steps, axis=1)
    value += np.hypot(formal, scatter) * rng.normal(size=(PARAMETERS, n))
    if moved is not None:
        value[:3] += moved
    line = np.stack([np.ones(n), time])
    return [Series(time, row, np.full(n, formal**2), line) for row in value]


def stepping(n: int, place: int, size: float) -> np.ndarray:
    return np.full((3, 1), size) * (np.arange(n) >= place)


@pytest.mark.slow
@pytest.mark.parametrize("made", MADE_OF.values(), ids=MADE_OF)
def test_of_many_sensors_without_a_step_hardly_any_has_one(made) -> None:
    named = sum(bool(find_change_points(sensor(10, made, seed), CHANCE)) for seed in range(25))
    assert named <= 1  # 0.1 expected; two or more have a chance of 0.5 %


@pytest.mark.slow
@pytest.mark.parametrize("made", MADE_OF.values(), ids=MADE_OF)
def test_a_step_of_five_sd_in_the_bias_is_found_where_it_is(made) -> None:
    n, place = 48, 26
    # of a walk, the sd of the way from one value to the next, and a step as clear as by scatter
    size = 7 * made[2] / np.sqrt(n - 1) if made[2] else 5 * np.hypot(made[0], made[1])
    moved = stepping(n, place, size)
    found = [find_change_points(sensor(n, made, seed, moved), CHANCE) for seed in range(4)]
    there = [any(not s.outlier and abs(s.place - place) <= 1 for s in each) for each in found]
    assert sum(there) >= 3


def test_a_step_a_stray_and_a_drift_are_told_apart() -> None:
    n = 24
    moved = stepping(n, 9, 30.0) + 25.0 * (np.arange(n) == 17)
    found = {
        (s.place, s.outlier): s
        for s in find_change_points(sensor(n, MADE_OF["scatter"], 1, moved), CHANCE)
    }
    assert set(found) == {(9, False), (17, True)}
    assert found[9, False].where == (0, 1, 2)
    steep = [one._replace(value=one.value + 200 * one.time) for one in sensor(n, (0.1, 1, 0), 2)]
    assert find_change_points(steep, CHANCE) == []


def test_the_last_value_is_given_as_one_that_is_off() -> None:
    n = 12
    moved = 40.0 * (np.arange(n) == n - 1) * np.ones((3, 1))
    [found] = find_change_points(sensor(n, MADE_OF["scatter"], 5, moved), CHANCE)
    assert (found.place, found.outlier) == (n - 1, True)
    assert found.p_value < CHANCE


@pytest.mark.slow
def test_a_long_series_is_looked_through_in_windows() -> None:
    n = 230
    moved = stepping(n, 60, 20.0) - stepping(n, 171, 20.0)
    found = find_change_points(sensor(n, MADE_OF["scatter"], 3, moved)[:3], CHANCE)
    assert {(s.place, s.outlier) for s in found} == {(60, False), (171, False)}


def test_too_few_values_have_no_shifts() -> None:
    n = MIN_VALUES - 1
    assert (
        find_change_points(sensor(n, MADE_OF["scatter"], 0, stepping(n, 3, 1000.0)), CHANCE) == []
    )
    assert find_change_points([], CHANCE) == []
    assert ChangePoint(2, False, 1.0, ()).column(4).tolist() == [0.0, 0.0, 1.0, 1.0]
