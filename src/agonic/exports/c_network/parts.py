"""A calibration with a network in it, in the parts that a C header holds."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.base import Calibration
from agonic.calibration.chain import Chain
from agonic.calibration.interference import Interference
from agonic.calibration.network import Network
from agonic.calibration.sources import measure_width, signals, stack_inputs
from agonic.calibration.steps import steps_of
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError, AgonicWarning
from agonic.exports.temperature import Polynomials, fit_polynomials, make_constant


@dataclass(frozen=True, kw_only=True, eq=False)
class Parts:
    """A network as the header holds it: what is before and after it, and the base's polynomials."""

    network: Network
    before: Affine | None
    after: Affine | None
    base: Polynomials | None

    @property
    def beside(self) -> tuple[str, ...]:
        """The numbers that are given beside a reading, in order."""
        return signals(self.network.needs) if self.network.needs else ()

    @property
    def warm(self) -> bool:
        """Whether the base changes with temperature."""
        return isinstance(self.network.base, Thermal)

    @property
    def constants(self) -> int:
        """How many float32 the header holds, its self-test left out."""
        network = self.network
        count = network.weights.size + 2 * network.shape.inputs + network.shape.outputs + 1
        count += network.centres.size + 1
        if self.base is not None:
            count += self.base.table.size + 1 + (4 if self.warm else 0)
        return count + 12 * sum(step is not None for step in (self.before, self.after))


def split_parts(calibration: Calibration) -> Parts:
    """The network with what is before and after it."""
    steps = steps_of(calibration)
    at = [k for k, step in enumerate(steps) if isinstance(step, Network)]
    if len(at) > 1:
        raise AgonicError("the header holds one network and this chain has more; export each alone")
    network = steps[at[0]]
    assert isinstance(network, Network)
    before, after = (_one(steps[part]) for part in (slice(0, at[0]), slice(at[0] + 1, None)))
    base = network.base
    found = (
        fit_polynomials(base)
        if isinstance(base, Thermal)
        else None
        if base is None
        else make_constant(base)
    )
    return Parts(network=network, before=before, after=after, base=found)


def _one(steps: tuple[object, ...]) -> Affine | None:
    """Steps as one bias and matrix; None without any."""
    if not steps:
        return None
    if any(isinstance(step, Thermal | Interference) for step in steps):
        raise AgonicError(
            "a step beside the network takes temperature or sources into account, which the header "
            "has no place for; make that step the base of the network: fit_network(base=...)"
        )
    return Chain(steps=steps).composed  # type: ignore[arg-type]


Float32 = NDArray[np.float32]

TRIED_ROWS = 500
"""Readings like those of the training, on which the error of float32 is told."""
TOLERANCE_FACTOR = 8.0
"""How much more the self-test allows: tanhf and the order of sums differ between processors."""
EPS = float(np.finfo(np.float32).eps)


class Known(NamedTuple):
    """Rows of raw (3), what is beside it, field (3), inside; the tolerance, nT; and the largest
    error of float32, nT, on so many readings."""

    rows: Array
    tolerance: float
    error: float
    tried: int


class _Readings(NamedTuple):
    raw: Array  # (n, 3)
    beside: Array  # (n, k)


def make_known_readings(parts: Parts) -> Known:
    """Readings with their field in double precision, and what float32 makes of them."""
    rng = np.random.default_rng(0)
    known = _readings(parts, _points(parts, rng), rng)
    field, inside = _exact(parts, known)
    rows = np.column_stack([known.raw, known.beside, field, inside])
    tried = _readings(parts, _like_training(parts, rng), rng)
    error = _error(parts, tried, _exact(parts, tried)[0])
    least = 2 * EPS * float(np.abs(field).max())
    tolerance = TOLERANCE_FACTOR * max(error, _error(parts, known, field), least)
    return Known(rows, float(f"{tolerance:.1g}"), error, TRIED_ROWS)


def _points(parts: Parts, rng: np.random.Generator) -> Array:
    """Inputs x (n, i): among the training, about half-way out of it, and far away."""
    network = parts.network
    centres = network.centres
    near = centres[rng.permutation(len(centres))[:6] % len(centres)]
    # outwards by the reading, where it goes in: a temperature cannot go far
    names = signals(network.inputs)
    moved = np.array([name.startswith("field") or "field_x" not in names for name in names])
    size = np.linalg.norm(centres * moved, axis=1)
    outer = centres[np.argsort(size)[-2:]]
    away = outer * moved
    away *= network.reach / np.linalg.norm(away, axis=1, keepdims=True)
    # not at half-way itself, where rounding decides which side it is on
    return np.concatenate([near, outer + 1.3 * away, outer + 4.0 * away])


def _like_training(parts: Parts, rng: np.random.Generator) -> Array:
    """Inputs x (n, i) within reach of the points that cover the training."""
    network = parts.network
    way = rng.normal(size=(TRIED_ROWS, network.shape.inputs))
    way *= network.reach * rng.uniform(0, 1, (TRIED_ROWS, 1)) / np.linalg.norm(way, axis=1)[:, None]
    return np.asarray(network.centres[rng.integers(len(network.centres), size=TRIED_ROWS)] + way)


def _readings(parts: Parts, x: Array, rng: np.random.Generator) -> _Readings:
    """Readings and what is beside them, as float32 holds them, that have the inputs x."""
    network, n = parts.network, len(x)
    values = dict(
        zip(signals(network.inputs), (network.input_middle + network.input_half * x).T, strict=True)
    )
    if "field" in network.inputs:
        raw = np.stack([values[f"field_{axis}"] for axis in "xyz"], axis=1)
    else:
        raw = (network.magnitude or 50_000.0) / np.sqrt(3) * rng.normal(size=(n, 3))
    usual = 0.0 if parts.base is None else (parts.base.low_C + parts.base.high_C) / 2
    beside = np.empty((n, len(parts.beside)))
    for column, name in zip(beside.T, parts.beside, strict=True):
        fallback = np.full(n, usual) if name == "temperature" else rng.uniform(-1, 1, n)
        column[:] = values.get(name, fallback)
        if name == "temperature" and parts.warm and parts.base is not None:
            np.clip(column, parts.base.low_C, parts.base.high_C, out=column)
    if parts.before is not None:
        raw = raw @ np.linalg.inv(parts.before.matrix).T + parts.before.bias
    return _Readings(*(v.astype(np.float32).astype(np.float64) for v in (raw, beside)))


def _exact(parts: Parts, known: _Readings) -> tuple[Array, Array]:
    """The field (n, 3) in double precision, and 1 or 0 (n,) as the C returns it."""
    columns = _list_columns(parts, known)
    raw = known.raw if parts.before is None else parts.before.correct(known.raw)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AgonicWarning)
        field, inside = parts.network.evaluated(raw, columns)
    after = field if parts.after is None else parts.after.correct(field)
    return after, (inside >= 0.5).astype(np.float64)


def _list_columns(parts: Parts, known: _Readings) -> dict[str, Array]:
    """What is beside the readings, by name."""
    columns, at = {}, 0
    for name in parts.network.needs:
        width = measure_width(name)
        columns[name] = known.beside[:, at] if width == 1 else known.beside[:, at : at + width]
        at += width
    return columns


def _error(parts: Parts, known: _Readings, field: Array) -> float:
    """The largest error of float32 on readings."""
    return float(np.abs(_single(parts, known) - field).max())


def _single(parts: Parts, known: _Readings) -> Array:
    """The field (n, 3) as float32 has it, operation by operation as in the C."""
    network, f = parts.network, np.float32
    reading = _affine32(parts.before, known.raw.astype(f))
    given: dict[str, Any] = {**_list_columns(parts, known), **network.held}
    inputs = stack_inputs(network.inputs, reading, given).astype(f)
    x = (inputs - network.input_middle.astype(f)) / network.input_half.astype(f)
    active = x
    for layer in network.layers[:-1]:
        active = np.tanh(active @ layer[:, :-1].T.astype(f) + layer[:, -1].astype(f))
    y = active @ network.output[:, :-1].T.astype(f) + network.output[:, -1].astype(f)
    added: Float32 = np.asarray(network.output_middle.astype(f) + f(network.output_half) * y, f)
    if parts.base is None:
        return _affine32(parts.after, added).astype(np.float64)
    out = _base32(parts, known, reading)
    size = np.sqrt((added**2).sum(axis=1, dtype=f))
    square = ((x[:, None] - network.centres.astype(f)) ** 2).sum(axis=2, dtype=f).min(axis=1)
    s = np.clip(np.sqrt(square) / f(network.reach) - f(1), f(0), f(1))
    assert network.bound is not None
    g = (f(1) - s * s * (f(3) - f(2) * s)) * np.minimum(
        f(1), f(network.bound) / np.maximum(size, f(1e-30))
    )
    if len(network.output) == 1:
        added = added * out / np.sqrt((out**2).sum(axis=1, dtype=f))[:, None]
    return _affine32(parts.after, out + g[:, None] * added).astype(np.float64)


def _affine32(step: Affine | None, values: Float32) -> Float32:
    if step is None:
        return values
    left = values - step.bias.astype(np.float32)
    return np.asarray(left @ step.matrix.T.astype(np.float32), dtype=np.float32)


def _base32(parts: Parts, known: _Readings, reading: Float32) -> Float32:
    assert parts.base is not None
    table, f = parts.base.table.astype(np.float32), np.float32
    value = np.broadcast_to(table[-1], (len(reading), table.shape[1]))
    if parts.warm:
        kept = np.clip(known.beside[:, parts.beside.index("temperature")], *parts.base.clamp_C)
        t = ((kept.astype(f) - f(parts.base.centre_C)) / f(parts.base.half_range_C))[:, None]
        for row in table[-2::-1]:
            value = value * t + row
    d = reading - value[:, :3]
    for k, name in enumerate(parts.base.signals):
        s = len(parts.base.signals)
        d = d - value[:, 12 + k :: s][:, :3] * known.beside[:, [parts.beside.index(name)]].astype(f)
    return np.asarray(np.einsum("nij,nj->ni", value[:, 3:12].reshape(-1, 3, 3), d), dtype=f)
