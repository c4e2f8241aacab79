"""Populations drawn directly, without logs: boards of one design, and what is planted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from agonic.population import Population, Row
from agonic.population.population import COLUMNS, ENTRIES, get_dtype

PATTERN = np.array([2400.0, -900.0, 5200.0])  # nT, what boards of one design share
GAINS = np.array([0.97, 1.0, 1.06])
CROSS = np.array([0.03, -0.015, 0.01])

Draw = Callable[[np.random.Generator, tuple[int, ...]], np.ndarray]

LAWS: dict[str, Draw] = {
    "normal": lambda rng, size: rng.normal(size=size),
    "t4": lambda rng, size: rng.standard_t(4, size=size),
    "laplace": lambda rng, size: rng.laplace(size=size) / 1.2,
    "skewed": lambda rng, size: np.exp(0.5 * rng.normal(size=size)) * 2 - 2,
    "batches": lambda rng, size: rng.normal(size=size) + 3 * (rng.random(size[0]) < 0.3)[:, None],
}
"""Regular populations: what members differ by, in spreads."""


def drawn(
    n: int, *, seed: int = 0, law: str = "normal", pattern: np.ndarray = PATTERN, **columns: object
) -> Population:
    """Sensors of one design: a bias of ±300 nT, gains of ±1 %, cross-axis terms of ±0.5 %."""
    rng = np.random.default_rng(seed)
    draw = LAWS[law]
    bias_sd, gain_sd = rng.uniform(10, 60, (n, 1)), rng.uniform(2e-4, 2e-3, (n, 1))
    bias = pattern + 300 * draw(rng, (n, 3)) + bias_sd * rng.normal(size=(n, 3))
    gain = GAINS + 0.01 * draw(rng, (n, 3)) + gain_sd * rng.normal(size=(n, 3))
    cross = CROSS + 0.005 * draw(rng, (n, 3)) + gain_sd * rng.normal(size=(n, 3))
    matrix = np.empty((n, 3, 3))
    matrix[:, range(3), range(3)] = gain
    for (i, j), values in zip(((0, 1), (0, 2), (1, 2)), cross.T, strict=True):
        matrix[:, i, j] = matrix[:, j, i] = values
    made: dict[str, object] = {
        "sensor": [f"s{k:06d}" for k in range(n)],
        "channel": ["mag"] * n,
        "source": [f"logs/s{k:06d}.csv" for k in range(n)],
        "sha256": [f"{k:064x}" for k in range(n)],
        "verdict": ["good"] * n,
        "status": ["fine"] * n,
        "model": ["full"] * n,
        "gauge": ["symmetric"] * n,
        "unit_in": ["nT"] * n,
        "unit_out": ["nT"] * n,
        "findings": [()] * n,
        "rows": rng.integers(250, 350, n),
        "magnitude": np.full(n, 50_000.0),
        "noise": 40 * np.exp(0.15 * draw(rng, (n, 1))[:, 0]),
        "spread_after": 2e-3 * np.exp(0.2 * draw(rng, (n, 1))[:, 0]),
        "spread_before": rng.uniform(0.05, 0.2, n),
        "heading_sd_deg": rng.uniform(0.2, 0.9, n),
        **{f"bias_{i}": bias[:, k] for k, i in enumerate("xyz")},
        **{f"bias_{i}_sd": bias_sd[:, 0] for i in "xyz"},
        **{f"matrix_{e}": matrix.reshape(n, 9)[:, k] for k, e in enumerate(ENTRIES)},
        **{f"matrix_{e}_sd": gain_sd[:, 0] for e in ("xx", "yy", "zz", "xy", "xz", "yz")},
    }
    return Population({name: _column(name, (made | columns).get(name), n) for name in COLUMNS})


def changed(population: Population, rows: np.ndarray, **columns: object) -> Population:
    """The population with other values in some rows."""
    new = {name: np.array(column) for name, column in population.columns.items()}
    for name, values in columns.items():
        new[name][rows] = values
    return Population(new)


def with_bias(population: Population, rows: np.ndarray, bias: np.ndarray) -> Population:
    return changed(population, rows, **{f"bias_{i}": bias[:, k] for k, i in enumerate("xyz")})


def turned(population: Population, rows: np.ndarray, turns: np.ndarray) -> Population:
    """Sensors whose axes are swapped: rotations or mirrorings (len(rows), 3, 3)."""
    bias = np.einsum("nij,nj->ni", turns, population.bias[rows])
    matrix = np.einsum("nij,njk,nlk->nil", turns, population.matrix[rows], turns).reshape(-1, 9)
    named = {f"matrix_{e}": matrix[:, k] for k, e in enumerate(ENTRIES)}
    return with_bias(changed(population, rows, **named), rows, bias)


def refused(name: str, status: str, *findings: str) -> Row:
    return Row(
        sensor=name, source=f"{name}.csv", verdict="refused", status=status, findings=findings
    )


def joined(*parts: Population | list[Row]) -> Population:
    """Populations put together, each sensor as it stands."""
    return Population.of([replace(row) for part in parts for row in part])


def _column(name: str, values: object, n: int) -> np.ndarray:
    kind = get_dtype(name)
    if kind is not object:
        empty = 0 if kind is np.int64 else np.nan
        return np.array(np.full(n, empty) if values is None else values, dtype=kind)
    column = np.empty(n, dtype=object)
    column[:] = (
        ([""] * n if name in ("key", "settings", "version", "method") else [None] * n)
        if values is None
        else values
    )
    return column
