"""`TrackerParams`: how a calibration is followed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from agonic.errors import AgonicError, check_choice
from agonic.maths.estimation.filters.states import BY_MAGNITUDE, Model

Solve = Literal["bias", "gains", "full"]

_GYRO = ("gyro_bias_sd", "gyro_walk", "delay_sd_s", "field_walk")
_NOT_NEGATIVE = ("walk", "matrix_walk", "external_sd", "jump_level", "history_s", *_GYRO)
_POSITIVE = ("noise", "external_time_s", "gate", "jump_sd", "bias_sd", "matrix_sd", "gyro_noise")


@dataclass(frozen=True, kw_only=True)
class TrackerParams:
    """How a calibration is followed: what moves, how fast, and what is known before.

    Parameters
    ----------
    solve : "bias", "gains" (bias and the diagonal of the matrix) or "full"; the rest is fixed.
    noise : sd of one reading on one axis, in the unit of the readings; `None`: that of the
        starting calibration, or else estimated from the first readings.
    walk : random walk of each bias, in the unit of the readings per √s: after t seconds it has
        moved by walk·√t.
    matrix_walk : the same of each entry of the matrix.
    external_sd, external_time_s : what the reference magnitude leaves out (crust, ring current):
        sd, nT, and correlation time; `None`: what the reference states, and what noise with memory
        the first readings show, with its own time.
    bias_sd : how far the bias may have moved since the starting calibration, beside its own
        standard error; `None`: a twentieth of the field, or, without a calibration, all of it.
    matrix_sd : how far each entry of the matrix may be from the starting one; `None`: nothing
        beside its standard error, or, without a calibration, 0.1.
    gate : a reading further than this many standard deviations from its prediction is refused.
    jump_level : χ² of three degrees of freedom above which a jump is announced; 0: never.
    jump_sd : the size of jump to expect, in the unit of the readings.
    history_s : seconds between the moments at which bias and band are kept; 0: never.
    gyro : follow also by how the field turns; `None`: where there is a gyro and it turns so.
    gyro_noise, gyro_bias_sd, gyro_walk : its noise density, rad/√s, its bias, rad/s, and how far
        that walks, rad/s per √s.
    delay_sd_s : how late the magnetometer may be behind the gyro, s; 0: not at all.
    field_walk : how far the field itself changes where the sensor moves, nT per √s.

    Examples
    --------
    >>> TrackerParams(walk=0.5).solve
    'full'
    """

    solve: Solve = "full"
    noise: float | None = None
    walk: float = 0.0
    matrix_walk: float = 0.0
    external_sd: float | None = None
    external_time_s: float = 600.0
    bias_sd: float | None = None
    matrix_sd: float | None = None
    gate: float = 5.0
    jump_level: float = 50.0
    jump_sd: float = 2000.0
    history_s: float = 60.0
    gyro: bool | None = None
    gyro_noise: float = 1e-3
    gyro_bias_sd: float = 0.05
    gyro_walk: float = 1e-5
    delay_sd_s: float = 0.02
    field_walk: float = 50.0

    def __post_init__(self) -> None:
        check_choice("solve", self.solve, tuple(BY_MAGNITUDE.sizes))
        for name in (*_NOT_NEGATIVE, *_POSITIVE):
            value = getattr(self, name)
            low = value is not None and (value < 0 or (value == 0 and name in _POSITIVE))
            if low or (value is not None and not np.isfinite(value)):
                least = "zero or more" if name in _NOT_NEGATIVE else "above zero"
                raise AgonicError(f"{name} is {value}; it must be {least}")

    def model(self, noise: float) -> Model:
        """What the kernel takes; made once, not with every reading."""
        made = self._made.get(noise)
        if made is None:
            names = set(Model._fields) & set(self.__dataclass_fields__)
            known = {name: getattr(self, name) for name in names}
            external = {"noise": noise, "external_sd": self.external_sd or 0.0}
            made = self._made[noise] = Model(**known | external)
        return made

    def with_external(self, sd: float, time_s: float) -> TrackerParams:
        """The settings with errors with memory; made once, not with every reading."""
        made = self._settled.get((sd, time_s))
        if made is None:
            made = replace(self, external_sd=sd, external_time_s=time_s)
            self._settled[sd, time_s] = made
        return made

    @cached_property
    def _made(self) -> dict[float, Model]:
        return {}

    @cached_property
    def _settled(self) -> dict[tuple[float, float], TrackerParams]:
        return {}
