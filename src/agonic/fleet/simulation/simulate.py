"""`simulate_fleet`: boards of one design, turned in a laboratory, with faults that are known."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from agonic.arrays import Array, Index
from agonic.errors import AgonicError
from agonic.fleet.simulation.faults import BROKEN, DAMAGED, SWAPPED, apply_faults, spoil
from agonic.simulation.draws import draw_directions, make_knots
from agonic.units import STANDARD_GRAVITY_M_S2

CHUNK_LOGS = 200
"""So many logs are drawn at once, from a seed of their own."""
_STEP_NT = 10.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Boards:
    """What is true of many boards, a row a board: readings = matrix⁻¹ field + bias + noise. `bias`
    (n, 3) nT at 25 °C, `matrix` (n, 3, 3), `noise` (n,) nT, `slope` (n, 3) nT/°C, `force_bias` (n,
    3) m/s², `fault` (n,) the name of what is wrong with each, or ""."""

    bias: Array
    matrix: Array
    noise: Array
    slope: Array
    force_bias: Array
    fault: NDArray[Any]


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedLogs:
    """Logs as their loggers had them: `first` the number of the first of k logs of m rows. `time`
    (m,) s, `field` (k, m, 3) nT, `acceleration` (k, m, 3) m/s², `temperature` (k, m) °C."""

    first: int
    time: Array
    field: Array
    acceleration: Array
    temperature: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedFleet:
    """The logs of many boards and the truth behind them.

    `truth` has a row a log: `source` its name, `sensor` the board, `fault` by name or "", `group`
    of the fault ("broken", "swapped", "duplicated", "damaged" or ""), `original` the log that a
    duplicate repeats, `start`, `temperature_C`, and what a calibration should find: `bias` (k, 3)
    nT, `matrix` (k, 3, 3) symmetric and `noise` (k,) nT. `readings()` makes the logs, `facts` made
    them.
    """

    truth: Mapping[str, NDArray[Any]]
    facts: Mapping[str, Any]
    boards: Boards
    board: Index
    """Which board each log is of, (k,)."""
    draw: Index
    """Which drawn readings each log holds, (k,): a duplicate holds those of its original."""

    def __len__(self) -> int:
        return len(self.board)

    def readings(self) -> Iterator[RecordedLogs]:
        """All logs that were drawn, some hundred at a time, without duplicates and damage."""
        drawn = int(self.draw.max()) + 1
        for first in range(0, drawn, CHUNK_LOGS):
            yield self._chunk(first, min(first + CHUNK_LOGS, drawn))

    def _chunk(self, first: int, stop: int) -> RecordedLogs:
        """The logs of one seed."""
        rng = np.random.default_rng([self.facts["seed"], 1, first])
        rows, rate_Hz = self.facts["rows"], self.facts["rate_Hz"]
        time = np.arange(rows) / rate_Hz
        of = self.board[first:stop]
        north_b, down_b = make_turnings(rng, time, len(of))
        dip = np.radians(self.facts["inclination_deg"])
        size = self.facts["magnitude"] + 15.0 * rng.standard_normal((len(of), 1, 1))  # by the day
        field_b = size * (np.cos(dip) * north_b + np.sin(dip) * down_b)
        boards, mean_C = self.boards, self.truth["temperature_C"][first:stop]
        temperature = mean_C[:, None] + 0.5 * time / max(time[-1], 1.0)
        raw = field_b @ np.linalg.inv(boards.matrix[of]).transpose(0, 2, 1)
        raw += (boards.bias[of] + boards.slope[of] * (mean_C - 25.0)[:, None])[:, None]
        noise = boards.noise[of][:, None, None] * rng.standard_normal(raw.shape)
        force = -STANDARD_GRAVITY_M_S2 * down_b + boards.force_bias[of][:, None]
        force += make_pushes(rng, time, len(of))
        force += 0.04 * rng.standard_normal(force.shape)
        for k, fault in enumerate(boards.fault[of]):
            if fault:
                raw[k], noise[k] = spoil(fault, raw[k], noise[k], int(of[k]))
        field = np.round((raw + noise) / _STEP_NT) * _STEP_NT
        return RecordedLogs(
            first=first, time=time, field=field, acceleration=force, temperature=temperature
        )


def simulate_fleet(
    n: int,
    *,
    logs: int = 1,
    rows: int = 300,
    rate_Hz: float = 10.0,
    magnitude: float = 48_000.0,
    inclination_deg: float = 65.0,
    bias: tuple[float, float, float] = (9_000.0, -5_000.0, 3_000.0),
    bias_sd: float = 700.0,
    noise: float = 120.0,
    broken: float = 0.03,
    swapped: float = 0.02,
    duplicated: float = 0.01,
    damaged: float = 0.01,
    seed: int = 0,
) -> SimulatedFleet:
    """Logs of boards of one design, each turned slowly by hand over all attitudes in one place. The
    boards share the bias and the soft iron of their design and scatter about it; each has its
    noise, its temperature coefficient and its accelerometer."""
    facts = {name: value for name, value in locals().items() if not name.startswith("bias")}
    shares = {"broken": broken, "swapped": swapped, "duplicated": duplicated, "damaged": damaged}
    _check(n, logs, rows, shares)
    rng = np.random.default_rng([seed, 0])
    boards = _draw_boards(rng, n, np.asarray(bias), bias_sd, noise)
    places = rng.permutation(n)
    ill = _deal(BROKEN, round(broken * n))
    odd = _deal(SWAPPED, round(swapped * n))
    boards.fault[places[: len(ill)]] = ill
    boards.fault[places[len(ill) : len(ill) + len(odd)]] = odd
    board = np.tile(np.arange(n), logs)
    again = np.sort(rng.choice(len(board), round(duplicated * len(board)), replace=False))
    hurt = rng.permutation(np.setdiff1d(np.arange(len(board)), again))
    hurt = hurt[np.argsort(boards.fault[board[hurt]] != "", kind="stable")]  # good boards first
    files = dict(
        zip(hurt.tolist(), _deal(DAMAGED, round(damaged * len(board))).tolist(), strict=False)
    )
    truth = _make_truth(rng, boards, board, again, files)
    return SimulatedFleet(
        truth=MappingProxyType(truth),
        facts=MappingProxyType(facts),
        boards=boards,
        board=np.concatenate([board, board[again]]),
        draw=np.concatenate([np.arange(len(board)), again]),
    )


def _check(n: int, logs: int, rows: int, shares: Mapping[str, float]) -> None:
    """Raise where there would be no fleet."""
    for name, value, least in (("n", n, 1), ("logs", logs, 1), ("rows", rows, 20)):
        if value < least:
            raise AgonicError(f"{name} is {value}; a fleet needs {least} at least")
    for name, share in shares.items():
        if not 0 <= share <= 1:
            raise AgonicError(f"{name} is {share}; give a share from 0 to 1")
    for one, other in (("broken", "swapped"), ("duplicated", "damaged")):
        if shares[one] + shares[other] > 1:
            raise AgonicError(f"{one} and {other} are more than all together: lower one")


def _deal(faults: tuple[str, ...], count: int) -> NDArray[Any]:
    """The faults in turn, as often as it takes."""
    return np.array([faults[k % len(faults)] for k in range(count)], dtype=object)


def _draw_boards(
    rng: np.random.Generator, n: int, bias: Array, bias_sd: float, noise: float
) -> Boards:
    """Boards about the pattern of their design."""
    iron = np.array([[0.04, 0.015, -0.01], [0.015, -0.03, 0.02], [-0.01, 0.02, 0.01]])
    spread = 0.004 * rng.standard_normal((n, 3, 3))
    gains = np.eye(3) * (1 + 0.015 * rng.standard_normal((n, 1, 3)))
    matrix = gains + iron + (spread + spread.transpose(0, 2, 1)) / 2
    return Boards(
        bias=bias + bias_sd * rng.standard_normal((n, 3)),
        matrix=matrix,
        noise=noise * np.exp(0.1 * rng.standard_normal(n)),
        slope=np.array([8.0, -5.0, 12.0]) + 3.0 * rng.standard_normal((n, 3)),
        force_bias=0.15 * rng.standard_normal((n, 3)),
        fault=np.full(n, "", dtype=object),
    )


def _make_truth(
    rng: np.random.Generator,
    boards: Boards,
    board: Index,
    again: Index,
    files: Mapping[int, str],
) -> dict[str, NDArray[Any]]:
    """The table of the truth: all logs, then those that are there twice."""
    n, count = len(boards.bias), len(board)
    wide = len(str(n - 1))
    names = np.array([f"board-{k:0{wide}d}" for k in range(n)], dtype=object)
    number, first = np.arange(count), dt.datetime(2025, 3, 3, 8, tzinfo=dt.UTC)
    mean_C = 25.0 + 4.0 * rng.standard_normal(count)
    start_s = 120.0 * (number % n) + 30 * 86_400.0 * (number // n)  # a board anew each month
    damage = np.array([files.get(k, "") for k in range(count)], dtype=object)
    fault = np.where(damage != "", damage, boards.fault[board])
    round_ = number // n + 1
    source = np.array(
        [f"{name}-{turn}" for name, turn in zip(names[board], round_, strict=True)], dtype=object
    )
    bias = boards.bias[board] + boards.slope[board] * (mean_C - 25.0)[:, None]
    bias, matrix = apply_faults(boards.fault[board], board, bias, boards.matrix[board])
    table: dict[str, NDArray[Any]] = {
        "source": source,
        "sensor": names[board],
        "fault": fault,
        "group": np.array([_GROUPS[name] for name in fault], dtype=object),
        "original": np.full(count, "", dtype=object),
        "start": np.array([first + dt.timedelta(seconds=s) for s in start_s], dtype=object),
        "temperature_C": mean_C,
        "bias": bias,
        "matrix": matrix,
        "noise": boards.noise[board],
    }
    copies = {name: column[again] for name, column in table.items()}
    copies["original"] = source[again]
    copies["source"] = np.array([f"{name}-copy" for name in source[again]], dtype=object)
    copies["fault"] = copies["group"] = np.full(len(again), "duplicated", dtype=object)
    return {name: np.concatenate([table[name], copies[name]]) for name in table}


_GROUPS = {
    "": "",
    **dict.fromkeys(BROKEN, "broken"),
    **dict.fromkeys(SWAPPED, "swapped"),
    **dict.fromkeys(DAMAGED, "damaged"),
}


def make_turnings(rng: np.random.Generator, time: Array, count: int) -> tuple[Array, Array]:
    """Level north and down in sensor axes (count, m, 3), for `count` smooth random turnings. As
    `motions.tumble`: uniform random quaternions every 1.5 s joined by a spline, here by one matrix
    for all."""
    knots = make_knots(time[-1], 1.5)
    quats = draw_directions(rng, count * len(knots), 4).reshape(count, len(knots), 4)
    turns = np.einsum("kij,kij->ki", quats[:, 1:], quats[:, :-1])
    quats[:, 1:] *= np.cumprod(np.where(turns < 0, -1.0, 1.0), axis=1)[..., None]
    path = CubicSpline(knots, np.eye(len(knots)))(time) @ quats
    path /= np.linalg.norm(path, axis=-1, keepdims=True)
    x, y, z, w = np.moveaxis(path, -1, 0)
    north = [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)]
    down = [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]
    return np.stack(north, axis=-1), np.stack(down, axis=-1)


def make_pushes(rng: np.random.Generator, time: Array, count: int) -> Array:
    """Accelerations (count, m, 3) of hands, smooth over a second or so."""
    knots = make_knots(time[-1], 0.7)
    path = CubicSpline(knots, np.eye(len(knots)))(time)
    return np.asarray(path @ (0.1 * rng.standard_normal((count, len(knots), 3))))
