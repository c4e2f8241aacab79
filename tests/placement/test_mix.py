"""Where a second magnetometer should sit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from agonic.errors import LogError
from agonic.placement.mix import judge_recording, list_mixes, rank_places, read_places
from agonic.samples import Samples
from tests.command_line import answer

K1 = np.array([[120.0, -60.0, 40.0], [300.0, 200.0, -500.0]])


def strapped(second: np.ndarray, seed: int = 0, n: int = 3000) -> tuple[Samples, np.ndarray]:
    """Two sensors in a field that stands still beside two loads, and the loads (n, 2)."""
    rng = np.random.default_rng(seed)
    on = np.repeat(rng.integers(0, 4, (n // 30, 2)), 30, axis=0).astype(np.float64)
    raw = [
        np.array([18e3, 2e3, 45e3]) + on @ added + 100.0 * rng.standard_normal((n, 3))
        for added in (K1, second)
    ]
    samples = Samples(field=raw[0], second=raw[1], unit="nT", time=np.arange(n) / 10, name="mag1")
    return samples, on


def test_no_other_mix_leaves_less() -> None:
    rng = np.random.default_rng(1)
    d1, d2 = rng.normal(size=(2, 3, 3)) * 1000
    both = np.concatenate([d1, d2], axis=1)
    best = list_mixes("ab", both.T @ both, np.array([100.0, 150.0]), 2e4)[0, 1]

    def cost(g: np.ndarray) -> float:
        left = d1 - (d2 - d1) @ g.T
        spread = 100.0**2 * np.square(np.eye(3) + g).sum() + 150.0**2 * np.square(g).sum()
        return float(np.square(left).sum() + spread)

    least = cost(best.matrix)
    assert 3 * best.total**2 == pytest.approx(least, rel=1e-9)
    for _ in range(50):
        assert cost(best.matrix + 0.01 * rng.normal(size=(3, 3))) > least


def test_what_a_recording_says_holds_on_readings_not_seen() -> None:
    samples, _ = strapped(-0.8 * K1, n=6000)
    seen, unseen = (samples.select(np.arange(k, k + 3000)) for k in (0, 3000))
    mix = judge_recording(seen)
    assert unseen.second is not None
    mixed = unseen.field - (unseen.second - unseen.field) @ mix.matrix.T
    spread = float(np.sqrt(np.mean(mixed.var(axis=0))))
    assert spread == pytest.approx(mix.total, rel=0.05)
    assert mix.before > 5 * mix.left
    assert mix.share == pytest.approx(-0.8, abs=0.05)
    assert mix.noise_factor == pytest.approx(0.72, abs=0.04)


def test_what_both_see_alike_is_not_cancelled() -> None:
    samples, _ = strapped(K1)
    mix = judge_recording(samples)
    assert mix.left > 0.9 * mix.before


def test_a_vehicle_that_moves_is_refused() -> None:
    samples, _ = strapped(-K1)
    tilted = samples.with_columns(
        roll_deg=np.linspace(0, 20, len(samples)), pitch_deg=np.zeros(len(samples))
    )
    with pytest.raises(LogError, match="strap the vehicle down"):
        judge_recording(tilted)


def test_places_are_ranked_and_mistakes_named(tmp_path: Path, capsys) -> None:
    table = tmp_path / "places.csv"
    rows = ["place,source,add_x_nT,add_y_nT,add_z_nT"]
    rows += ["bow,motor,900,0,0", "mast,motor,-900,0,0", "stern,motor,880,0,0"]
    table.write_text("\n".join(rows))
    ranked = rank_places(read_places(table), 100.0)
    assert {ranked[0].first, ranked[0].second} == {"bow", "mast"}
    assert ranked[0].noise_factor == pytest.approx(0.71, abs=0.02)
    alike = next(mix for mix in ranked if {mix.first, mix.second} == {"bow", "stern"})
    assert alike.left > 0.8 * alike.before
    status, said = answer(capsys, "plan", "placement", str(table))
    assert (status, len(said["places"])) == (0, 6)
    table.write_text("\n".join([*rows, "keel,heater,1,2,3"]))
    with pytest.raises(LogError, match="has no row for"):
        read_places(table)
