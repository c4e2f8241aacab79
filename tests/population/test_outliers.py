"""Sensors that stand out: what is planted is named, and who is regular is not."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise

import numpy as np
import pytest

from agonic.maths.estimation.inference import find_discoveries
from agonic.maths.estimation.robust.robust_line import fit_robust_line
from agonic.maths.estimation.robust.robust_spread import estimate_robust_spread
from agonic.maths.estimation.robust.tails import fit_tail
from agonic.population import Outlier, Population, find_duplicates, find_outliers
from agonic.population.outlier import list_swaps, swap_axes
from agonic.population.peers import find_peers

from .drawn import LAWS, changed, drawn, joined, refused, turned, with_bias

KINDS = ("bias", "gain", "cross", "noise", "spread", "axes")


def planted(n: int, seed: int, law: str, share: float = 0.1) -> tuple[Population, dict[int, str]]:
    """A tenth of the sensors spoilt, each in one of six ways, by 20 spreads or so."""
    rng = np.random.default_rng(1000 + seed)
    population = drawn(n, seed=seed, law=law)
    bad = rng.permutation(n)[: int(share * n)]
    kinds = rng.integers(0, len(KINDS), len(bad))
    bias, gain, cross, noise, spread, axes = (bad[kinds == k] for k in range(len(KINDS)))
    towards = rng.normal(size=(len(bias), 3))
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    made = with_bias(population, bias, population.bias[bias] + 6000 * towards)
    made = changed(made, gain, matrix_yy=made["matrix_yy"][gain] * 0.8)
    skewed = made["matrix_xy"][cross] + 0.1
    made = changed(made, cross, matrix_xy=skewed, matrix_yx=skewed)
    made = changed(made, noise, noise=12 * made["noise"][noise])
    made = changed(made, spread, spread_after=50 * made["spread_after"][spread])
    made = turned(made, axes, list_swaps()[rng.integers(1, 48, len(axes))])
    return made, {int(row): KINDS[kind] for row, kind in zip(bad, kinds, strict=True)}


def named(found: tuple[Outlier, ...]) -> dict[int, set[str]]:
    by_row: dict[int, set[str]] = {}
    for one in found:
        by_row.setdefault(one.row, set()).add(one.quantity)
    return by_row


@pytest.mark.parametrize("law", ["normal", "skewed", "batches"])
def test_what_is_planted_is_named_for_what_it_is(law: str) -> None:
    hits = right = total = false = rows = 0
    for seed, n in enumerate((1000, 1000, 3000)):
        population, truth = planted(n, seed, law)
        found = named(find_outliers(population))
        total, rows = total + len(truth), rows + n
        hits += sum(row in found for row in truth)
        right += sum(kind in found.get(row, ()) for row, kind in truth.items())
        false += len(found.keys() - truth.keys())
    assert hits >= 0.99 * total
    assert right >= 0.99 * total
    assert false < 0.01 * rows


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_regular_populations_have_hardly_any(law: str) -> None:
    """However they are distributed: less than one in a hundred sensors is named."""
    for n, seeds in ((9, 20), (30, 12), (300, 3), (5000, 1)):
        false = sum(len(named(find_outliers(drawn(n, seed=s, law=law)))) for s in range(seeds))
        assert false < 0.01 * n * seeds


@pytest.mark.slow
@pytest.mark.parametrize("n", [20, 30])
def test_one_bad_board_among_few_is_named(n: int) -> None:
    """20 spreads off, to a side of its own."""
    hits, seeds = 0, 25
    for seed in range(seeds):
        towards = np.random.default_rng(seed).normal(size=3)
        population = drawn(n, seed=100 + seed)
        off = 6000 * towards / np.linalg.norm(towards)
        far = with_bias(population, np.array([4]), population.bias[[4]] + off)
        found = named(find_outliers(far))
        hits += 4 in found
        assert found.keys() <= {4}
    assert hits >= 0.95 * seeds


def test_error_without_bounds_excuses_a_sensor_too() -> None:
    far = changed(drawn(30), np.array([3, 4]), bias_x=9e4)
    loose = changed(far, np.array([3]), bias_x_sd=np.inf, matrix_xy_sd=np.inf)
    assert set(named(find_outliers(far))) == {3, 4}
    assert set(named(find_outliers(loose))) == {4}


def test_a_tenth_of_bad_ones_does_not_hide_them() -> None:
    """All of them to one side, all by the same quantity."""
    population = drawn(200, seed=3)
    rows = np.arange(20)
    spoilt = with_bias(population, rows, population.bias[rows] + [5000.0, 0.0, 0.0])
    assert set(named(find_outliers(spoilt))) == set(rows.tolist())


def test_the_sentence_says_what_was_planted() -> None:
    population = drawn(500, seed=5)
    moved = with_bias(population, np.array([7]), population.bias[[7]] + [9000.0, 0.0, 0.0])
    [bias] = find_outliers(moved)
    assert (bias.sensor, bias.quantity, bias.row) == ("s000007", "bias", 7)
    usual = np.linalg.norm(moved.bias[7] - np.median(moved.bias, axis=0))
    said = float(bias.sentence.split()[3])
    assert said == pytest.approx(usual, rel=0.01)
    [noise] = find_outliers(changed(population, np.array([9]), noise=400.0))
    assert "its noise is 10 times that of the others: 400 nT instead of 40" in noise.sentence
    [gain] = find_outliers(changed(population, np.array([11]), matrix_xx=0.5))
    assert "its gain on x is 0.500" in gain.sentence
    assert "others 0.9699 ± 0.0104" in gain.sentence


@pytest.mark.parametrize("turn", [1, 7, 20, 30, 47])
def test_swapped_axes_are_named_with_the_swap_itself(turn: int) -> None:
    """What its reader must do, by the words: the others' axes are these ones of its own."""
    swap = list_swaps()[turn]
    population = turned(drawn(100, seed=turn), np.array([4]), swap[None])
    [found] = find_outliers(population)
    assert (found.row, found.quantity) == (4, "axes")
    for own, axis in enumerate(swap):
        theirs = int(np.argmax(np.abs(axis)))
        sign = "−" if axis[theirs] < 0 else ""
        if own != theirs or sign:
            assert f"its {'xyz'[own]} is the others' {sign}{'xyz'[theirs]}" in found.sentence


def test_without_a_common_pattern_no_swap_is_claimed() -> None:
    population = drawn(300, seed=1, pattern=np.zeros(3))
    even = changed(
        population,
        np.arange(300),
        **{
            f"matrix_{e}": population[f"matrix_{e}"] - np.diag([0.97, 1.0, 1.06])[i, i] + 1.0
            for i, e in enumerate(("xx", "yy", "zz"))
        },
        **{
            f"matrix_{e}": population[f"matrix_{e}"] - value
            for e, value in (
                ("xy", 0.03),
                ("yx", 0.03),
                ("xz", -0.015),
                ("zx", -0.015),
                ("yz", 0.01),
                ("zy", 0.01),
            )
        },
    )
    swaps = list_swaps()[1 + np.arange(30)]
    assert not find_outliers(turned(even, np.arange(30), swaps))
    far = with_bias(even, np.array([5]), np.array([[0.0, 9000.0, 0.0]]))
    assert [one.quantity for one in find_outliers(far)] == ["bias"]


def test_an_error_of_its_own_excuses_a_sensor() -> None:
    population = drawn(100, seed=2)
    bias = population.bias[[3]] + [9000.0, 0.0, 0.0]
    sharp = with_bias(population, np.array([3]), bias)
    assert named(find_outliers(sharp)) == {3: {"bias"}}
    assert not find_outliers(changed(sharp, np.array([3]), bias_x_sd=4000.0))


def test_equal_sensors_have_no_outlier_by_what_does_not_matter() -> None:
    population = changed(
        drawn(50),
        np.arange(50),
        bias_x=100.0,
        bias_y=0.0,
        bias_z=0.0,
        bias_x_sd=0.0,
        bias_y_sd=0.0,
        bias_z_sd=0.0,
    )
    assert not find_outliers(changed(population, np.array([3]), bias_x=150.0))  # 0.1 % of the field
    assert named(find_outliers(changed(population, np.array([3]), bias_x=3000.0))) == {3: {"bias"}}


def test_few_sensors_cannot_tell() -> None:
    population = drawn(7)
    assert not find_outliers(with_bias(population, np.array([0]), np.array([[9e4, 0.0, 0.0]])))
    assert [group.enough for group in find_peers(population)] == [False]
    assert not find_outliers(Population.of([refused("a", "the file is empty")]))
    assert not find_outliers(Population.of([]))


def test_units_and_channels_make_groups_of_their_own() -> None:
    """Raw readings beside nT, and a second magnetometer beside strong iron."""
    n = 40
    raw = changed(drawn(n, seed=1), np.arange(n), unit_in="raw")
    raw = changed(
        raw,
        np.arange(n),
        **{f"bias_{i}": raw[f"bias_{i}"] / 8 for i in "xyz"},
        **{f"matrix_{e}": 8 * raw[f"matrix_{e}"] for e in ("xx", "yy", "zz")},
        noise=raw["noise"] / 8,
    )
    inner = drawn(n, seed=2, pattern=np.array([3e4, 0.0, 0.0]), channel=["mag1"] * n)
    rows = [
        replace(
            row,
            sensor=f"{name}{row.sensor}",
            source=f"{name}{row.source}",
            sha256=f"{name}{row.sha256}",
        )
        for name, part in (("a", drawn(n)), ("b", raw), ("c", inner))
        for row in part
    ]
    groups = find_peers(Population.of(rows))
    assert sorted((len(g), g.name) for g in groups) == [
        (n, "mag, readings in nT"),
        (n, "mag1, readings in nT"),
        (n, "readings in raw units"),
    ]
    assert not find_outliers(Population.of(rows))


def test_a_sensor_counts_once_by_its_latest_good_calibration() -> None:
    """One bad sensor with a hundred logs is still one of thirty."""
    population = drawn(30, seed=4)
    first, *others = list(population)
    at = datetime(2026, 1, 1, tzinfo=UTC)
    many = [
        replace(
            first,
            source=f"many{k:03d}.csv",
            sha256=f"many{k}",
            bias_x=4e4,
            start=at.replace(day=1 + k % 28, month=1 + k // 28),
        )
        for k in range(100)
    ]
    latest = replace(many[0], source="last.csv", verdict="check", start=at.replace(year=2027))
    found = find_outliers(Population.of([*many, latest, *others]))
    assert [(one.sensor, one.quantity) for one in found] == [(first.sensor, "bias")]
    assert found[0].source == max(many, key=lambda row: row.start).source
    [group] = find_peers(Population.of([*many, latest, *others]))
    assert len(group) == 30


def test_duplicates_are_found_and_counted_once() -> None:
    population = drawn(30, seed=4)
    copies = [
        replace(row, sensor=f"copy{row.sensor}", source=f"copy/{row.sensor}.csv")
        for row in list(population)[:3]
    ]
    whole = joined(population, copies)
    found = find_duplicates(whole)
    assert [len(one.rows) for one in found] == [2, 2, 2]
    assert all(one.contested for one in found)
    assert found[0].sources == ("copy/s000000.csv", "logs/s000000.csv")
    [group] = find_peers(whole)
    assert len(group) == 30
    assert not find_duplicates(population)
    two = [replace(row, source="one.parquet", sha256="same") for row in population]
    assert not find_duplicates(Population.of(two))  # many sensors of one file
    [twice] = find_duplicates(Population.of([*two, replace(two[3], sensor="other")]))
    assert twice.sentence == "other and s000003 of one.parquet have the same readings"
    again = [replace(row, source="again.csv") for row in population if row.sensor == "s000003"]
    [same] = find_duplicates(joined(population, again))
    assert not same.contested
    assert same.sentence == "again.csv and logs/s000003.csv are the same log"


def test_the_spread_is_that_of_the_sensors_alone() -> None:
    """Centre and spread come back without the errors of the fits, on average and with strays."""
    centres, spreads = [], []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        sd = rng.uniform(0.2, 3.0, (300, 1))
        values = 5.0 + 2.0 * rng.normal(size=(300, 1)) + sd * rng.normal(size=(300, 1))
        clean = estimate_robust_spread(values, sd)
        centres.append(clean.centre[0])
        spreads.append(clean.spread[0])
        values[:30] = 1e5
        assert estimate_robust_spread(values, sd).spread[0] == pytest.approx(2.0, rel=0.5)
    assert np.mean(spreads) == pytest.approx(2.0, abs=3 * np.std(spreads) / np.sqrt(60) + 0.02)
    assert np.mean(centres) == pytest.approx(5.0, abs=3 * np.std(centres) / np.sqrt(60))
    assert np.std(centres) < 1.1 * np.sqrt(4.0 + 3.2) / np.sqrt(300)  # the mean's, with mean sd²


def test_the_tail_is_that_of_the_members() -> None:
    """One in a thousand lies where the tail says: within a factor of two."""
    for seed, (dof, outside) in enumerate(((200.0, 0.0), (5.0, 0.0), (200.0, 0.08))):
        rng = np.random.default_rng(seed)
        regular = np.linalg.norm(rng.normal(size=(20_000, 3)), axis=1)
        regular *= np.sqrt(dof / rng.chisquare(dof, 20_000))
        strays = rng.uniform(10, 400, int(outside * 20_000))
        tail = fit_tail(np.r_[regular, strays], 3)
        share = float(np.mean(tail.beyond(regular) < 1e-3))
        assert 5e-4 < share < 2e-3
        assert tail.share == pytest.approx(outside, abs=0.03)


def test_discoveries_are_as_false_as_allowed() -> None:
    rng = np.random.default_rng(0)
    shares = []
    for _ in range(300):
        p_values = rng.uniform(size=1000)
        p_values[:100] = 1e-3 * rng.uniform(size=100)
        found = find_discoveries(p_values, 0.1)
        shares.append(found[100:].sum() / max(found.sum(), 1))
        few = np.sort(p_values)[:150]
        assert find_discoveries(few, 0.1, 1000).sum() == found.sum()
    assert np.mean(shares) == pytest.approx(0.09, abs=0.01)  # rate × share of true nulls


def test_swaps_are_those_of_the_matrix_itself() -> None:
    rng = np.random.default_rng(0)
    matrix = rng.normal(size=(3, 3))
    matrix, bias = matrix + matrix.T, rng.normal(size=3)
    i, j = [0, 0, 1], [1, 2, 2]
    for turn in list_swaps():
        seen = turn @ matrix @ turn.T
        expected = np.r_[turn @ bias, np.diag(seen), seen[i, j]]
        own = np.r_[bias, np.diag(matrix), matrix[i, j]]
        np.testing.assert_allclose(swap_axes(own, turn), expected, atol=1e-12)
    assert len({tuple(turn.ravel()) for turn in list_swaps()}) == 48


def test_a_line_is_as_sure_as_it_says() -> None:
    errors = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        x = rng.uniform(0, 40, 80)
        y = 2.0 * x + rng.normal(size=80) * rng.uniform(1, 9, 80)
        y[:6] += 500.0
        line = fit_robust_line(x, y)
        errors.append((line.slope - 2.0) / line.slope_sd)
    assert abs(np.mean(errors)) < 0.25
    assert 0.85 < np.std(errors) < 1.2


def test_they_come_in_the_order_of_their_rows() -> None:
    population, _ = planted(300, 9, "normal")
    found = find_outliers(population)
    assert all(a.row <= b.row for a, b in pairwise(found))
    assert found == find_outliers(population)


def test_a_gain_that_only_the_magnitude_shows() -> None:
    """Without a known field the mean gain is one, and the magnitude has what is left of it."""
    n = 100
    mean = np.mean([drawn(n)[f"matrix_{e}"] for e in ("xx", "yy", "zz")], axis=0)
    scaled = {f"matrix_{i}{j}": drawn(n)[f"matrix_{i}{j}"] / mean for i in "xyz" for j in "xyz"}
    magnitude = 50_000 / mean
    population = changed(drawn(n), np.arange(n), magnitude=magnitude, **scaled)
    assert not find_outliers(population)
    [found] = find_outliers(changed(population, np.array([5]), magnitude=0.7 * magnitude[5]))
    assert (found.row, found.quantity) == (5, "magnitude")
    assert "% too small, or it was elsewhere" in found.sentence
    travelled = changed(drawn(n), np.arange(n), magnitude=np.linspace(3e4, 6e4, n))
    assert not find_outliers(
        changed(travelled, np.array([5]), magnitude=1.2e5)
    )  # the field was known
