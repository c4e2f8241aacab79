"""What goes wrong in a fleet: boards that are broken, axes that are misnamed, files that are hurt.

Each fault is a name; what it does to a board is drawn from the number of the board.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Index
from agonic.simulation.draws import draw_directions


def _make_generator(board: int) -> np.random.Generator:
    """What is drawn for the fault of a board."""
    return np.random.default_rng([board, 7])


def draw_change(fault: str, board: int) -> Array:
    """The matrix from the readings of a board to those that its log names, (3, 3)."""
    rng, change = _make_generator(board), np.eye(3)
    if fault in ("gain", "axis gain"):
        wrong = (0.7, 1.3)[rng.integers(2)]
        change[slice(None) if fault == "gain" else rng.integers(3)] *= wrong
        return change
    axis = int(rng.integers(3))
    if fault == "exchanged axes":
        change[[axis, (axis + 1) % 3]] = change[[(axis + 1) % 3, axis]]
    elif fault == "reversed axis":
        change[axis, axis] = -1.0
    elif fault == "turned axes":
        change = np.roll(change, 1 + axis % 2, axis=0)
    return change


def apply_faults(
    faults: NDArray[Any], board: Index, bias: Array, matrix: Array
) -> tuple[Array, Array]:
    """Bias (k, 3) and symmetric matrix (k, 3, 3) of readings with wrong gains and axes. Named
    readings are r' = C r: field = W (r − b) = W C⁻¹ (r' − C b), and of that matrix the magnitude
    sees the symmetric part of its polar decomposition."""
    bias, matrix = bias.copy(), matrix.copy()
    for k in np.flatnonzero(faults != ""):
        change = draw_change(faults[k], int(board[k]))
        bias[k] = change @ bias[k]
        wrong = matrix[k] @ np.linalg.inv(change)
        values, vectors = np.linalg.eigh(wrong.T @ wrong)
        matrix[k] = vectors * np.sqrt(values) @ vectors.T
    return bias, matrix


def spoil(fault: str, raw: Array, noise: Array, board: int) -> tuple[Array, Array]:
    """What a fault makes of the readings (m, 3) of a board and of their noise."""
    change = draw_change(fault, board)
    raw, noise = raw @ change.T, noise @ change.T
    hurt = _READINGS.get(fault)
    return (raw, noise) if hurt is None else hurt(raw, noise, _make_generator(board))


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


def _add_spikes(raw: Array, noise: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Gross errors in single readings."""
    hit = rng.uniform(size=len(raw)) < rng.uniform(0.03, 0.2)
    length = rng.uniform(10_000, 60_000, (len(raw), 1))
    return raw + hit[:, None] * length * draw_directions(rng, len(raw)), noise


def _move_magnet(raw: Array, noise: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """A magnet, or iron, that has another place from some moment on."""
    since = np.arange(len(raw)) >= len(raw) * rng.uniform(0.25, 0.75)
    return raw + since[:, None] * draw_directions(rng, 1) * rng.uniform(1_500, 12_000), noise


_READINGS: Mapping[str, Callable[[Array, Array, np.random.Generator], tuple[Array, Array]]] = {
    "frozen axis": _freeze_axis,
    "dead axis": _kill_axis,
    "clipping": _clip,
    "noise": lambda raw, noise, rng: (raw, 10.0 * noise),
    "spikes": _add_spikes,
    "moved magnet": _move_magnet,
}
BROKEN = (*_READINGS, "axis gain", "gain")
SWAPPED = ("exchanged axes", "reversed axis", "turned axes")


def _truncate(rng: np.random.Generator, text: bytes) -> bytes:
    """Cut in the middle of a row."""
    return text[: text.rindex(b"\n", 0, int(len(text) * rng.uniform(0.3, 0.9))) + 4]


def _rename_columns(rng: np.random.Generator, text: bytes) -> bytes:
    """Columns without meaning."""
    header, end, rows = text.partition(b"\n")
    return b",".join(b"v%d" % k for k in range(header.count(b",") + 1)) + end + rows


def _remove_values(rng: np.random.Generator, text: bytes) -> bytes:
    """Rows of which about half have lost their second value."""
    header, *lines = (line.split(b",") for line in text.splitlines())
    for line, lost in zip(lines, rng.uniform(size=len(lines)) < 0.5, strict=True):
        if lost:
            line[1] = b"nan"
    return b"".join(b",".join(line) + b"\n" for line in (header, *lines))


_FILES: Mapping[str, Callable[[np.random.Generator, bytes], bytes]] = {
    "truncated": _truncate,
    "binary": lambda rng, text: rng.bytes(len(text)),
    "empty": lambda rng, text: b"",
    "wrong columns": _rename_columns,
    "missing values": _remove_values,
    "wrong encoding": lambda rng, text: text.decode().encode("utf-16-be"),
}
DAMAGED = tuple(_FILES)


def damage(fault: str, content: bytes, seed: int) -> bytes:
    """A file of text that something has happened to."""
    return _FILES[fault](np.random.default_rng([seed, 11]), content)
