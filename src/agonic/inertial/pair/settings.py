"""What a fit of a pair of sensors has to choose."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from agonic.errors import AgonicError

EXPECTED_NOISE = np.array([2e-3, 3e-3, np.radians(0.15)])
"""Of a reading of the accelerometer, in g, and the magnetometer, in F, and of pointing, rad."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The settings of a fit; see `fit_pair`."""

    accelerometer_bias_sd: float = 0.05
    accelerometer_shape_sd: float = 0.02
    soft_iron_sd: float = 0.1
    turn_sd_deg: float = 5.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not value > 0:
                raise AgonicError(f"{field.name} is {value}; it has to be above zero")
