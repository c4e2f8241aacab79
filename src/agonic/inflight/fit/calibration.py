"""The calibration to save: the ground's and what flight changed, in one or as a chain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import PARAMETERS, Affine
from agonic.calibration.base import Calibration, Validity
from agonic.calibration.chain import Chain
from agonic.calibration.interference import Interference, signals
from agonic.calibration.thermal import Thermal
from agonic.inflight.fit.problem import Task
from agonic.inflight.fit.solve import Estimate, turn_of
from agonic.inflight.maths.residuals import Layout
from agonic.maths.equation.affine import join, model_basis
from agonic.samples import Samples


def at_end(estimate: Estimate) -> Array:
    """From all parameters to bias and matrix at the end of the record and the middle temperature,
    (9 or 12, m)."""
    layout = estimate.layout
    c, k = layout.constants, layout.bias_terms
    onto = np.zeros((c, layout.parameters))
    onto[:, :c] = np.eye(c)
    onto[:3, c : c + 3 * k] = np.kron(np.eye(3), estimate.terms.last)
    return onto


def sizes(layout: Layout, magnitude: float) -> Array:
    """What bias and matrix are to be multiplied by, (9,) or (12,)."""
    return np.concatenate([np.full(3, magnitude), np.ones(layout.constants - 3)])


@dataclass(frozen=True, kw_only=True, eq=False)
class Parts:
    """What makes up the calibration: the ground's, the change, and its terms in nT."""

    ground: Calibration | None
    change: Affine
    estimate: Estimate
    magnitude: float
    sources: Array
    sources_sd: Array
    second_sensor: str | None

    @classmethod
    def of(cls, task: Task, estimate: Estimate, change: Affine) -> Parts:
        """The parts of an estimate."""
        layout, terms = estimate.layout, estimate.terms
        first = terms.splines + terms.degree
        size = task.magnitude / terms.spread
        sd = np.sqrt(np.maximum(np.diag(estimate.solution.covariance), 0.0))
        return cls(
            ground=task.ground,
            change=change,
            estimate=estimate,
            magnitude=task.magnitude,
            sources=layout.biases(estimate.solution.params)[:, first:] * size,
            sources_sd=layout.biases(sd)[:, first:] * size,
            second_sensor=task.samples.second_sensor if "second" in terms.sources else None,
        )

    def calibration(self, samples: Samples) -> Affine | Thermal | Chain:
        """Multiplied out where ground and change are affine, else a chain."""
        steps: list[Any] = []
        terms = self.estimate.terms
        last: Affine | Thermal = self.change
        if terms.sources:
            last = self._interference(self.change)
        if terms.degree:
            steps = [self._interference(None)] if terms.sources else []
            last = self._thermal(samples)
        if self.ground is None and not steps:
            return last
        if type(self.ground) is Affine and type(last) is Affine:
            return together(self.ground, last, samples)
        if isinstance(self.ground, Chain):
            steps = [*self.ground.steps, *steps]
        elif self.ground is not None:
            steps = [self.ground, *steps]
        return Chain(steps=(*steps, last), provenance=self.change.provenance)

    def after(self, samples: Samples) -> Affine:
        """Ground and change at the middle temperature, in one."""
        before = self.before()
        return self.change if before is None else together(before, self.change, samples)

    def before(self) -> Affine | None:
        """The ground calibration at the middle temperature of the record."""
        held: Any = self.ground
        if isinstance(held, (Thermal, Chain)):
            held = held.at(self.estimate.terms.centre_C)
        return held.composed if isinstance(held, Chain) else held

    def _interference(self, change: Affine | None) -> Interference:
        """The change with what the sources add; without, the sources alone."""
        of = self.change
        common = {
            name: getattr(of, name)
            for name in (
                "unit_in",
                "sensor",
                "device_id",
                "frame_in",
                "frame_out",
                "noise",
                "magnitude",
                "provenance",
            )
        } | {"second_sensor": self.second_sensor}
        names = self.estimate.terms.sources
        if change is None:
            return Interference(
                **common,
                bias=np.zeros(3),
                matrix=np.eye(3),
                unit_out=of.unit_in,
                sources=names,
                coefficients=self.sources,
            )
        return Interference(
            **common,
            bias=of.bias,
            matrix=of.matrix,
            unit_out=of.unit_out,
            sources=names,
            coefficients=self.sources,
            covariance=self._with_sources(),
            validity=of.validity,
        )

    def _with_sources(self) -> Array:
        """Covariance of `Interference.parameters`: nine, then what the sources add, row by row."""
        k = len(signals(self.estimate.terms.sources))
        first = self.estimate.terms.bias_count - k
        c, kb = self.estimate.layout.constants, self.estimate.layout.bias_terms
        onto = np.zeros((9 + 3 * k, self.estimate.layout.parameters))
        onto[:9] = self._nine()
        for axis in range(3):
            for j in range(k):
                onto[9 + axis * k + j, c + axis * kb + first + j] = (
                    self.magnitude / self.estimate.terms.spread[j]
                )
        return np.asarray(onto @ self.estimate.solution.covariance @ onto.T)

    def _nine(self) -> Array:
        """From all parameters to the nine of the change, nT, (9, m); the turn is small."""
        onto = at_end(self.estimate) * sizes(self.estimate.layout, self.magnitude)[:, None]
        if len(onto) == 9:
            return onto
        six = np.eye(9, 12)
        for k in range(3):
            six[6 + k, [6 + k, 9 + k]] = 0.5
        return np.asarray(six @ onto)

    def _thermal(self, samples: Samples) -> Thermal:
        """The change as polynomials in temperature."""
        terms, layout, of = self.estimate.terms, self.estimate.layout, self.change
        params, p = self.estimate.solution.params, self.estimate.terms.degree + 1
        powers = layout.biases(params)[:, terms.splines : terms.splines + p - 1].T * self.magnitude
        matrix = np.zeros((p, 3, 3))
        matrix[0] = of.matrix
        turn = turn_of(self.estimate)
        if terms.matrix_degree:
            matrix[1:] = turn.T @ layout.matrices(params)[: p - 1]
            matrix = (matrix + np.swapaxes(matrix, 1, 2)) / 2
        onto = self._by_power(p)
        common = {
            name: getattr(of, name)
            for name in (
                "unit_in",
                "unit_out",
                "sensor",
                "device_id",
                "frame_in",
                "frame_out",
                "noise",
                "magnitude",
                "provenance",
                "validity",
            )
        }
        return Thermal(
            **common,
            bias=np.vstack([of.bias, powers]),
            matrix=matrix,
            centre_C=terms.centre_C,
            half_range_C=terms.half_range_C,
            covariance=onto @ self.estimate.solution.covariance @ onto.T,
        )

    def _by_power(self, p: int) -> Array:
        """From all parameters to those of a `Thermal`, (9 p, m)."""
        terms, layout = self.estimate.terms, self.estimate.layout
        c, kb, km = layout.constants, layout.bias_terms, layout.matrix_terms
        onto = np.zeros((len(PARAMETERS) * p, layout.parameters))
        onto[::p] = self._nine()
        for power in range(1, p):
            for axis in range(3):
                onto[axis * p + power, c + axis * kb + terms.splines + power - 1] = self.magnitude
            for entry in range(6 if terms.matrix_degree else 0):
                onto[(3 + entry) * p + power, c + 3 * kb + entry * km + power - 1] = 1.0
        return onto


def together(ground: Affine, change: Affine, samples: Samples) -> Affine:
    """Ground and change as one affine calibration."""
    return replace(
        change,
        bias=ground.bias + np.linalg.solve(ground.matrix, change.bias),
        matrix=change.matrix @ ground.matrix,
        gauge="free",
        covariance=_composed(ground, change),
        unit_in=ground.unit_in,
        frame_in=ground.frame_in,
        validity=validity(samples),
    )


def _composed(ground: Affine, change: Affine) -> Array:
    """Covariance (12, 12) of bias and matrix of the two in one.

        matrix = M W,   bias = b + W⁻¹ c

    The flight knows bias and gains of the present; the ground's own errors of them are inside the
    change already, so that only the change is uncertain.
    """
    w, inverse = ground.matrix, np.linalg.inv(ground.matrix)
    local = np.zeros((12, 12))
    local[:3, :3] = inverse
    for i in range(3):
        for j in range(3):
            step = np.zeros((3, 3))
            step[i, j] = 1.0
            local[:, 3 + 3 * i + j] = join(np.zeros(3), step @ w)
    assert change.covariance is not None
    onto = np.linalg.pinv(model_basis("full", "free")) @ local @ model_basis("full")
    return np.asarray(onto @ change.covariance @ onto.T)


def validity(samples: Samples) -> Validity:
    """What the record has seen."""
    warm = samples.temperature
    return Validity(
        largest_reading=float(np.abs(samples.field).max()),
        temperature_C=None if warm is None else (float(warm.min()), float(warm.max())),
    )
