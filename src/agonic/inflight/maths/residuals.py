"""A calibration that changes slowly: residuals by magnitude and direction of a known field.

    field = M(τ) (u − c(τ)),   c(τ) = c₀ + Σ_k c_k τ_k,   M(τ) = M₀ + Σ_k M_k τ_k

with terms τ that are known of each reading: splines in time, powers of temperature, currents. The
bias has terms of its own and the matrix others. Parameters in order: c₀ (3), the entries of M₀ (6
symmetric, or 9 in the gauge free), c_k axis by axis, and xx yy zz xy xz yz of M_k, entry by entry.

Three kinds of residual, each a distance in the space of the readings: "magnitude"; "azimuth", along
the horizontal direction across the field; and "dip", along the third. The last two are linear in
the field, so nothing happens to them at the magnetic poles.

Fields are over their mean magnitude and terms are scaled to about one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.maths.equation import affine
from agonic.maths.estimation import leastsq

KINDS = ("magnitude", "azimuth", "dip")
_ROWS = 4096  # a block whose temporaries stay in the cache
_SIX = affine.model_basis("full", affine.SYMMETRIC)[3:, 3:]


class Rows(NamedTuple):
    """Readings and what is known of each.

    `points` (n, 3); `wanted` (n,) magnitudes; `aim` and `side` (n, 3) unit vectors in the axes of
    the corrected field: the direction of the field and the horizontal one across it, or None;
    `bias_terms` (n, k) and `matrix_terms` (n, l); `time` (n,) s; `direction_e` (n, 3)
    of the field in Earth-fixed axes, in which errors of the model are correlated, or None.
    """

    points: Array
    wanted: Array
    aim: Array | None
    side: Array | None
    bias_terms: Array
    matrix_terms: Array
    time: Array
    direction_e: Array | None

    def select(self, rows: Mask | slice) -> Rows:
        """Some of them."""
        return Rows(*(None if part is None else part[rows] for part in self))  # type: ignore[arg-type]


class Block(NamedTuple):
    """Rows whose temporaries stay in the cache: `moving` (k,) terms of the bias that change among
    them, their values `terms` (n, l), and what makes few columns the Jacobian, `onto` (c, m): terms
    that stay the same, as those of a spline far away, are so much of the bias."""

    rows: Rows
    moving: Mask
    terms: Array
    onto: Array


Source = Callable[[], Iterable[Block]]
"""Gives all readings, block by block, each time it is called."""
Watch = Callable[[Rows, Array, Array, Array], None]
"""Is shown a block of readings with their residuals, few columns, and what makes these the
Jacobian, as the solver takes them."""


class Layout(NamedTuple):
    """How parameters are laid out: the gauge of M₀, and how many terms bias and matrix have."""

    gauge: str
    bias_terms: int
    matrix_terms: int

    @property
    def constants(self) -> int:
        """Parameters of c₀ and M₀."""
        return 12 if self.gauge == affine.FREE else 9

    @property
    def parameters(self) -> int:
        """All of them."""
        return self.constants + 3 * self.bias_terms + 6 * self.matrix_terms

    @property
    def start(self) -> Array:
        """No bias and the identity."""
        params = np.zeros(self.parameters)
        params[3:6] = 1.0
        return params

    def biases(self, params: Array) -> Array:
        """c_k as columns, (3, k)."""
        end = self.constants + 3 * self.bias_terms
        return params[self.constants : end].reshape(3, self.bias_terms)

    def bias_columns(self, terms: slice) -> Index:
        """Where the coefficients of some terms of the bias are among the parameters, (3, k)."""
        numbers = self.biases(np.arange(self.parameters, dtype=np.float64))
        return numbers[:, terms].astype(np.intp)

    def matrices(self, params: Array) -> Array:
        """M_k, (l, 3, 3)."""
        six = params[self.constants + 3 * self.bias_terms :].reshape(6, self.matrix_terms)
        return np.asarray((_SIX @ six).T.reshape(-1, 3, 3))


def correct(rows: Rows, params: Array, layout: Layout) -> Array:
    """The field (n, 3) of readings."""
    bias, matrix = affine.split(
        affine.model_basis("full", layout.gauge) @ params[: layout.constants]
    )
    d = rows.points - rows.bias_terms @ layout.biases(params).T - bias
    if not layout.matrix_terms:
        return np.asarray(d @ matrix.T)
    each = matrix + np.tensordot(rows.matrix_terms, layout.matrices(params), axes=1)
    return np.asarray(np.einsum("nij,nj->ni", each, d))


def cut(rows: Rows, layout: Layout) -> Iterator[Block]:
    """The rows in blocks; those in memory are cut once for all passes."""
    for start in range(0, len(rows.points), _ROWS):
        yield _make_block(rows.select(slice(start, start + _ROWS)), layout)


def _make_block(rows: Rows, layout: Layout) -> Block:
    terms = np.ascontiguousarray(rows.bias_terms.T)  # along rows NumPy is slow
    moving = np.ptp(terms, axis=1) > 0
    c = layout.constants
    onto = np.eye(layout.parameters)
    onto[:3, c : c + 3 * layout.bias_terms] = np.kron(np.eye(3), np.where(moving, 0.0, terms[:, 0]))
    kept = np.ones(layout.parameters, dtype=bool)
    kept[c : c + 3 * layout.bias_terms] = np.tile(moving, 3)
    return Block(rows, moving, np.ascontiguousarray(terms[moving].T), onto[kept])


def residual_pieces(
    source: Source, kind: str, layout: Layout, sd: float = 0.0, watch: Watch | None = None
) -> leastsq.Pieces:
    """The residuals of one kind, block by block, for the solver; `watch` sees each block."""

    def blocks(params: Array) -> Iterator[tuple[Array, Array, Array]]:
        for block in source():
            r, few = _linearise(block, kind, params, layout, sd)
            if watch is not None:
                watch(block.rows, r, few, block.onto)
            yield r, few, block.onto

    return blocks


def find_residuals(rows: Rows, kind: str, params: Array, layout: Layout, sd: float = 0.0) -> Array:
    """The residuals (n,) of one kind; `sd` is the noise of the readings (see `magnitude_residual`),
    across the field κ, errors of the attitude, rad, over it: the noise in their own Jacobian makes
    no bias then."""
    parts = residual_pieces(lambda: cut(rows, layout), kind, layout, sd)(params)
    return np.concatenate([part[0] for part in parts])


def _linearise(
    block: Block, kind: str, params: Array, layout: Layout, sd: float
) -> tuple[Array, Array]:
    """Residuals (n,) and few columns (n, c) of a block."""
    rows, moving = block.rows, block.moving
    basis = affine.model_basis("full", layout.gauge)
    bias, matrix = affine.split(basis @ params[: layout.constants])
    raw = rows.points
    if layout.bias_terms:
        biases = layout.biases(params)
        bias = bias + biases[:, ~moving] @ rows.bias_terms[0, ~moving]
        raw = raw - block.terms @ biases[:, moving].T
    if layout.matrix_terms:
        matrix = matrix + np.tensordot(rows.matrix_terms, layout.matrices(params), axes=1)
    if kind != "magnitude":
        spread = np.square(sd * rows.wanted)
        r, by_local = _across_residual(raw - bias, matrix, _across(rows, kind), spread)
    else:
        r, by_local = affine.magnitude_residual(raw, bias, matrix, rows.wanted, sd)
    columns = [
        by_local @ basis,
        affine.expand_covariates(by_local[:, :3], block.terms),
        affine.expand_covariates(by_local[:, 3:] @ _SIX, rows.matrix_terms),
    ]
    return r, np.concatenate(columns, axis=1)


def turn_directions(rows: Rows, kind: str) -> Array:
    """The axes (n, 3) about which a small turn of the attitude moves a residual across the field.

    ∂(u·e)/∂ω = u × e,   u along the aim
    """
    assert rows.aim is not None
    return np.cross(rows.aim, _across(rows, kind))


def _across(rows: Rows, kind: str) -> Array:
    assert rows.aim is not None
    assert rows.side is not None
    return rows.side if kind == "azimuth" else np.cross(rows.aim, rows.side)


def _across_residual(d: Array, matrix: Array, e: Array, spread: Array) -> tuple[Array, Array]:
    """u·e/g with g² = |Wᵀe|² + spread, W (3, 3) or (n, 3, 3), and its Jacobian (n, 12).

    With s = Wᵀe:   ∂r/∂bias = −s/g,   ∂r/∂W = e dᵀ/g − (r/g²) e sᵀ
    """
    s = np.squeeze(np.swapaxes(matrix, -1, -2) @ e[:, :, None], axis=2)
    g = np.sqrt(np.einsum("ni,ni->n", s, s) + spread)
    r = np.einsum("ni,ni->n", s, d) / g
    jacobian = np.empty((len(d), 12))
    jacobian[:, :3] = -s / g[:, None]
    toward = d / g[:, None] - s * (r / g**2)[:, None]
    jacobian[:, 3:] = (e[:, :, None] * toward[:, None, :]).reshape(len(d), 9)
    return r, jacobian
