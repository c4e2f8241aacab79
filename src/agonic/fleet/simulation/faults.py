"""What goes wrong in a fleet: boards that are broken, axes that are misnamed, files that are hurt.

Each fault is a name; what it does to a board is drawn from the number of the board.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Index
from agonic.simulation.draws import draw_directions

BROKEN = (
    "frozen axis",
    "dead axis",
    "clipping",
    "noise",
    "spikes",
    "moved magnet",
    "axis gain",
    "gain",
)
"""An axis that stands still; one that reads noise alone; too small a range; ten times the noise;
gross errors in 3 to 20 % of the readings; a magnet that moved; one gain, or all, 30 % off."""
SWAPPED = ("exchanged axes", "reversed axis", "turned axes")
"""Two axes exchanged; one reversed; all three in turn."""
DAMAGED = (
    "truncated",
    "binary",
    "empty",
    "wrong columns",
    "missing values",
    "wrong encoding",
)
"""Cut in the middle of a row; garbage; nothing; columns without meaning; half the values NaN;
UTF-16 without its mark."""

NOISIER = 10.0
WRONG_GAIN = (0.7, 1.3)


def _make_generator(board: int) -> np.random.Generator:
    """What is drawn for the fault of a board."""
    return np.random.default_rng([board, 7])


def draw_gain(fault: str, board: int) -> Array:
    """By what the three axes of a board are multiplied, (3,)."""
    rng = _make_generator(board)
    wrong, axis = WRONG_GAIN[rng.integers(2)], rng.integers(3)
    gains = np.ones(3)
    if fault == "gain":
        gains[:] = wrong
    elif fault == "axis gain":
        gains[axis] = wrong
    return gains


def draw_naming(fault: str, board: int) -> Array:
    """The matrix from the axes of a board to those of its log, (3, 3)."""
    axis = int(_make_generator(board).integers(3))
    naming = np.eye(3)
    if fault == "exchanged axes":
        naming[[axis, (axis + 1) % 3]] = naming[[(axis + 1) % 3, axis]]
    elif fault == "reversed axis":
        naming[axis, axis] = -1.0
    elif fault == "turned axes":
        naming = np.roll(naming, 1 + axis % 2, axis=0)
    return naming


def apply_faults(
    faults: NDArray[Any], board: Index, bias: Array, matrix: Array
) -> tuple[Array, Array]:
    """Bias (k, 3) and symmetric matrix (k, 3, 3) of readings with wrong gains and axes.

    Named readings are r' = N G r: field = W (r − b) = W (N G)⁻¹ (r' − N G b), and of that matrix
    the magnitude sees the symmetric part of its polar decomposition.
    """
    bias, matrix = bias.copy(), matrix.copy()
    for k in np.flatnonzero(faults != ""):
        change = _draw_change(faults[k], int(board[k]))
        bias[k] = change @ bias[k]
        wrong = matrix[k] @ np.linalg.inv(change)
        values, vectors = np.linalg.eigh(wrong.T @ wrong)
        matrix[k] = vectors * np.sqrt(values) @ vectors.T
    return bias, matrix


def _draw_change(fault: str, board: int) -> Array:
    """The matrix N G from the readings of a board to those that its log names, (3, 3)."""
    return np.asarray(draw_naming(fault, board) @ np.diag(draw_gain(fault, board)))


@dataclass(frozen=True)
class Fault:
    """What a fault makes of the readings (m, 3) of a board and of their noise."""

    fault: str

    def __call__(self, raw: Array, noise: Array, board: int) -> tuple[Array, Array]:
        change = _draw_change(self.fault, board)
        raw, noise = raw @ change.T, noise @ change.T
        hurt = _READINGS.get(self.fault)
        return (raw, noise) if hurt is None else hurt(raw, noise, _make_generator(board))


Hurt = Callable[[Array, Array, np.random.Generator], tuple[Array, Array]]


def _freeze_axis(raw: Array, noise: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """One axis stands still, from the start or from some moment of the first half on."""
    axis, since = rng.integers(3), int(len(raw) * max(rng.uniform(-0.5, 0.5), 0.0))
    raw, noise = raw.copy(), noise.copy()
    raw[since:, axis] = raw[since, axis] + noise[since, axis]
    noise[since:, axis] = 0.0
    return raw, noise


def _kill_axis(raw: Array, noise: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """One axis reads its noise about some value."""
    raw = raw.copy()
    raw[:, rng.integers(3)] = rng.uniform(-20_000, 20_000)
    return raw, noise


def _clip(raw: Array, noise: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """A range that a good part of the readings leave."""
    total = raw + noise
    limit = np.quantile(np.abs(total).max(axis=1), rng.uniform(0.6, 0.95))
    return np.clip(total, -limit, limit), np.zeros_like(noise)


def _add_noise(raw: Array, noise: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    return raw, NOISIER * noise


def _add_spikes(raw: Array, noise: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Gross errors in single readings."""
    hit = rng.uniform(size=len(raw)) < rng.uniform(0.03, 0.2)
    length = rng.uniform(10_000, 60_000, (len(raw), 1))
    return raw + hit[:, None] * length * draw_directions(rng, len(raw)), noise


def _move_magnet(raw: Array, noise: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """A magnet, or iron, that has another place from some moment on."""
    since = np.arange(len(raw)) >= len(raw) * rng.uniform(0.25, 0.75)
    return raw + since[:, None] * draw_directions(rng, 1) * rng.uniform(1_500, 12_000), noise


_READINGS: Mapping[str, Hurt] = {
    "frozen axis": _freeze_axis,
    "dead axis": _kill_axis,
    "clipping": _clip,
    "noise": _add_noise,
    "spikes": _add_spikes,
    "moved magnet": _move_magnet,
}


def damage(fault: str, content: bytes, seed: int) -> bytes:
    """A file of text that something has happened to."""
    rng = np.random.default_rng([seed, 11])
    if fault == "truncated":
        middle = content.rindex(b"\n", 0, int(len(content) * rng.uniform(0.3, 0.9)))
        return content[: middle + 4]
    if fault == "binary":
        return rng.bytes(len(content))
    if fault == "empty":
        return b""
    header, _, rows = content.partition(b"\n")
    if fault == "wrong columns":
        return b",".join(b"v%d" % k for k in range(header.count(b",") + 1)) + b"\n" + rows
    if fault == "missing values":
        return header + b"\n" + _remove_values(rng, rows)
    return content.decode().encode("utf-16-be")


def _remove_values(rng: np.random.Generator, rows: bytes) -> bytes:
    """Rows of which about half have lost their second value."""
    lines = [line.split(b",") for line in rows.splitlines()]
    for line, lost in zip(lines, rng.uniform(size=len(lines)) < 0.5, strict=True):
        if lost:
            line[1] = b"nan"
    return b"\n".join(b",".join(line) for line in lines) + b"\n"
