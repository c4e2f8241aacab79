"""Sensors that left the others: by where they are, and by how they moved."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from agonic.history.departure import add_departures, departures
from agonic.history.fit import drift
from agonic.population import History, Row

DAY = datetime(2026, 1, 1, tzinfo=UTC)


def row(sensor: str, k: int, bias: np.ndarray) -> Row:
    return Row(
        sensor=sensor,
        source=f"{sensor}-{k}.csv",
        sha256=f"{sensor}{k}",
        verdict="good",
        status="",
        start=DAY + timedelta(days=30 * k),
        rows=300,
        unit_in="nT",
        unit_out="nT",
        model="full",
        gauge="symmetric",
        bias_x=bias[0],
        bias_y=bias[1],
        bias_z=bias[2],
        bias_x_sd=4.0,
        bias_y_sd=4.0,
        bias_z_sd=4.0,
        magnitude=50_000.0,
        matrix_xx=1.0,
        matrix_yy=1.0,
        matrix_zz=1.0,
        matrix_xy=0.0,
        matrix_xz=0.0,
        matrix_yz=0.0,
    )


@pytest.fixture
def history(tmp_path: Path):
    """Eighty sensors whose biases spread by 300 nT and move by 20 nT from one to the next."""
    rng = np.random.default_rng(5)
    with History.open(tmp_path / "boards.sqlite") as kept:
        kept.add(
            row(f"s{number:02d}", k, bias + rng.normal(0, 20.0, 3))
            for number, bias in enumerate(rng.normal(0, 300.0, (80, 3)))
            for k in range(3)
        )
        yield kept


def test_regular_sensors_stay(history: History) -> None:
    assert departures(history) == ()


def test_sensor_far_from_the_others_is_named_for_its_level(history: History) -> None:
    history.add(row("far", k, np.array([9000.0, 0.0, 0.0])) for k in range(3))
    [one] = departures(history)
    assert (one.sensor, one.kind) == ("far", "level")
    assert one.distance > 10


def test_sensor_that_moved_is_named_for_its_move(history: History) -> None:
    """400 nT are nothing among the levels, and much among the moves."""
    moved = history.of("s11").bias[-1] + [400.0, 0.0, 0.0]
    history.add([row("s11", 3, moved)])
    [one] = departures(history)
    assert (one.sensor, one.kind) == ("s11", "move")
    assert "bias x moved by +4" in one.sentence
    found = add_departures(drift(history.of("s11")), [one])
    assert found.verdict == "check"
    assert "left its population" in [finding.name for finding in found.findings]
    assert add_departures(drift(history.of("s12")), [one]).ok


def test_move_between_units_is_none(history: History) -> None:
    in_counts = replace(row("s11", 3, np.zeros(3)), unit_in="raw")
    history.add([in_counts])
    assert departures(history) == ()


def test_few_sensors_do_not_tell(tmp_path: Path) -> None:
    with History.open(tmp_path / "few.sqlite") as kept:
        assert departures(kept) == ()
        kept.add(row(f"s{k}", 0, np.array([1e4 * (k == 3), 0.0, 0.0])) for k in range(5))
        assert departures(kept) == ()
