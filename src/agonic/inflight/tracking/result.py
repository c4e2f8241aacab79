"""`Coefficients`: what is known now, and what an update found."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.affine import Affine
from agonic.calibration.tracking import Jump, TrackerState
from agonic.errors import AgonicError


class Followed:
    """What is known now: read from a `state`."""

    state: TrackerState

    @property
    def bias(self) -> Array:
        """The bias now, (3,), in the unit of the readings."""
        return self.state.bias

    @property
    def bias_sd(self) -> Array:
        """Its standard error, (3,), errors that last included."""
        return self.state.bias_sd

    @property
    def calibration(self) -> Affine:
        """Bias and matrix now, with their covariance; where the calibration to start from was a
        `Thermal`, at its middle temperature (`state.thermal` is the whole of it).

        Raises `AgonicError` before any reading.
        """
        if self.state.n == 0:
            raise AgonicError("nothing has been followed yet; update the tracker first")
        return self.state.calibration


@dataclass(frozen=True, eq=False)
class Coefficients(Followed):
    """What an update found: bias and matrix now, and how well each reading had been predicted.

    `residual` (n,) = |W (raw − bias)| − F − g and `residual_sd` (n,), nT, are from before the
    reading was used; `used` (n,) whether it passed the gate; `jumps` those found in these
    readings; `moments` the states at the times that `TrackerParams.history_s` asks for. Beside a
    gyro residuals are those of raw, rms over its axes, in the unit of the readings, and `field`
    (n, 3), nT, is the field at each moment by all that was known then, turned with the sensor and
    not delayed; else `None`.
    """

    state: TrackerState
    residual: Array
    residual_sd: Array
    used: Mask
    jumps: tuple[Jump, ...]
    moments: tuple[TrackerState, ...] = ()
    field: Array | None = None

    @cached_property
    def history(self) -> Array:
        """Time, bias x y z and its standard error x y z at the `moments` that were kept, (k, 7)."""
        lines = [[one.time, *one.bias, *one.bias_sd] for one in self.moments]
        return np.array(lines).reshape(-1, 7)

    @property
    def foretold(self) -> Mask:
        """Of which readings something was known beforehand: not those of an opening, (n,)."""
        return np.asarray(self.residual_sd < 2 * np.min(self.residual_sd, initial=np.inf))
