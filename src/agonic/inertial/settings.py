"""What a fit beside accelerometer and gyro has to choose."""

from __future__ import annotations

from dataclasses import dataclass, fields

from agonic.attitude.settings import Settings as AttitudeSettings
from agonic.calibration.setup import LATENCY_SD_S
from agonic.errors import AgonicError

INCLINATION_SD = 0.5
"""Prior of a dip that is not known, rad, about the one that was found first."""
ACCELERATION_DELAY_SD_S = 0.05
"""Prior of how late the accelerometer is beside the gyro: mostly both are of one chip, but a log
may hold one filtered, or of another clock."""


@dataclass(frozen=True, kw_only=True)
class Settings(AttitudeSettings):
    """The settings of a fit; see `fit_inertial`."""

    accelerometer_sd_m_s2: float = 0.1
    gyro_bias_sd_deg_s: float = 1.0
    gyro_scale_sd: float = 0.02
    speed_sd_m_s: float = 10.0
    stretch_s: float = 30.0
    heading_offset_sd_deg: float = 1.0
    accelerometer_scale_sd: float | None = None
    inclination_sd: float = 0.0
    delay_sd_s: float = LATENCY_SD_S
    acceleration_delay_sd_s: float = ACCELERATION_DELAY_SD_S

    def __post_init__(self) -> None:
        super().__post_init__()
        for one in fields(self)[len(fields(AttitudeSettings)) :]:
            value = getattr(self, one.name)
            if value is not None and not value > 0 and one.name != "inclination_sd":
                raise AgonicError(f"{one.name} is {value}; it has to be above zero")

    @property
    def inclination_free(self) -> bool:
        """Whether nothing tells the dip."""
        return self.inclination_sd >= INCLINATION_SD
