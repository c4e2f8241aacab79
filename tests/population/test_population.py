"""The table of a population: what goes in comes out, in one order, byte for byte."""

from __future__ import annotations

from dataclasses import fields, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from agonic.errors import AgonicError, LogError
from agonic.population import Population, Row, read_population, write_population


def row(name: str, **more: object) -> Row:
    return replace(
        Row(
            sensor=name,
            source=f"{name}.csv",
            verdict="good",
            status="fine",
            rows=300,
            findings=("gap", "stuck"),
            start=datetime(2026, 5, 1, 12, 0, 0, 250, tzinfo=UTC),
            bias_x=1.5,
            bias_y=-2.0,
            bias_z=3.0,
            bias_x_sd=0.1,
            matrix_xx=1.0,
            matrix_yy=1.1,
            matrix_zz=0.9,
            matrix_xy=0.01,
            device_id=197388,
        ),
        **more,
    )


def failed(name: str) -> Row:
    return Row(sensor=name, source=f"{name}.csv", verdict="refused", status="the file is empty")


def test_rows_come_back_as_they_went_in(tmp_path: Path) -> None:
    rows = [row("a"), failed("b"), row("c", device_id=None)]
    back = list(read_population(write_population(Population.of(rows), tmp_path / "t.parquet")))
    assert back == rows
    assert [type(getattr(back[0], f.name)) for f in fields(Row)] == [
        type(getattr(rows[0], f.name)) for f in fields(Row)
    ]


def test_the_same_rows_in_any_order_give_the_same_bytes(tmp_path: Path) -> None:
    rows = [row(f"s{k:02d}") for k in range(20)] + [failed("z")]
    shuffled = [rows[k] for k in np.random.default_rng(0).permutation(len(rows))]
    first = write_population(Population.of(rows), tmp_path / "a.parquet").read_bytes()
    assert write_population(Population.of(shuffled), tmp_path / "b.parquet").read_bytes() == first


def test_vectors_have_nan_where_there_is_no_calibration() -> None:
    population = Population.of([row("a"), failed("b")])
    assert population.fitted.tolist() == [True, False]
    np.testing.assert_array_equal(population.bias[0], [1.5, -2.0, 3.0])
    assert np.isnan(population.bias[1]).all()
    assert population.matrix[0, 0, 1] == 0.01
    assert population.matrix[0, 1, 1] == 1.1
    assert population.select(population.fitted)["sensor"].tolist() == ["a"]


def test_an_empty_table_is_a_table(tmp_path: Path) -> None:
    path = write_population(Population.of([]), tmp_path / "t.parquet")
    assert len(read_population(path)) == 0


def test_other_parquet_files_are_refused(tmp_path: Path) -> None:
    pa = pytest.importorskip("pyarrow")
    pa.parquet.write_table(pa.table({"x": [1]}), tmp_path / "x.parquet")
    with pytest.raises(LogError, match="not a table of calibrations"):
        read_population(tmp_path / "x.parquet")
    (tmp_path / "y.parquet").write_text("no table at all")
    with pytest.raises(LogError, match="not a Parquet table"):
        read_population(tmp_path / "y.parquet")
    with pytest.raises(AgonicError, match="not the columns"):
        Population({"sensor": np.array(["a"])})
