"""The inputs of a training without the noise of the readings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.calibration.affine import Affine
from agonic.calibration.inputs import measure_width
from agonic.calibration.network import Network
from agonic.calibration.thermal import Thermal
from agonic.maths.estimation.noise.residuals import robust_scale
from agonic.network.fit.problem import Problem


class Scale(NamedTuple):
    """Inputs and targets as −1…1: x = (input − middle)/half, y = (target − middle)/half."""

    input_middle: Array
    input_half: Array
    output_middle: Array
    output_half: float

    @classmethod
    def of(cls, network: Network) -> Scale:
        """Those of a network."""
        return cls(*(getattr(network, name) for name in cls._fields))


class Noiseless(NamedTuple):
    """The inputs as they would be without the noise of the readings.

    With noise in the inputs a network learns how the field was distributed rather than what the
    sensor does: where the field kept to a plane, say, it takes every reading back into it. The
    known field says what the noise was: with e = field − known and W the matrix of the base,

        x from raw − s W⁻¹ e,   s = 1 − sd²/noise²

    s being the share of e that is the sensor's, sd the standard deviation of the reference.
    """

    problem: Problem
    rows: Index
    base: Affine | Thermal | None
    field: Array
    scale: Scale

    @property
    def possible(self) -> bool:
        """Whether readings go in and a base says what noise of the field is in them."""
        return self.base is not None and "field" in self.problem.settings.inputs

    def x(self, error: Array) -> Array:
        """Scaled inputs (k, i) when the field is off by `error` (k, o), nT."""
        inputs = self.problem.inputs[self.rows].copy()
        if isinstance(self.base, Affine | Thermal) and "field" in self.problem.settings.inputs:
            if error.shape[1] == 1:
                error = error * self.field / np.linalg.norm(self.field, axis=1, keepdims=True)
            at = sum(measure_width(n) for n in self.problem.settings.inputs[: self._position])
            inputs[:, at : at + 3] -= self._share(error) * self._back(error)
        return np.asarray((inputs - self.scale.input_middle) / self.scale.input_half)

    @property
    def _position(self) -> int:
        return self.problem.settings.inputs.index("field")

    def _share(self, error: Array) -> float:
        noise = robust_scale(error.ravel())
        return 1.0 - min((self.problem.sd / max(noise, 1e-300)) ** 2, 1.0)

    def _back(self, error: Array) -> Array:
        """Errors of the field as errors of the readings, W⁻¹ e."""
        if isinstance(self.base, Thermal):
            matrix = self.base.matrix_at(self.problem.columns["temperature"][self.rows])
        else:
            assert self.base is not None
            matrix = self.base.matrix
        return np.asarray(np.linalg.solve(matrix, error[:, :, None])[:, :, 0])
