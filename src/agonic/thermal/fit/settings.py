"""What there is to choose for a temperature fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.errors import AgonicError
from agonic.thermal.maths.stations import list_standard_rotations

Stations = Literal["known", "unknown", "found"] | Mapping[int, Rotation]

LARGEST_DEGREE = 9
LARGEST_AUTO = 5


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The settings of a fit; see `fit_thermal`."""

    bin_width_C: float = 0.5
    degree: int | Literal["auto"] = 3
    stations: Stations = "unknown"
    fixture_sd_deg: float = 1.0
    fixture_known: bool = False
    rate: bool | Literal["auto"] = "auto"
    drift: bool | Literal["auto"] = "auto"
    soft_iron_sd: float = 0.1
    faults: bool = True
    unseen_change_sd: float = 0.0
    robust: bool = True

    def __post_init__(self) -> None:
        for name in ("bin_width_C", "fixture_sd_deg", "soft_iron_sd"):
            if not getattr(self, name) > 0:
                raise AgonicError(f"{name} is {getattr(self, name)}; it must be above zero")
        if not self.unseen_change_sd >= 0:
            raise AgonicError(
                f"unseen_change_sd is {self.unseen_change_sd}; it is a share of the field from 0"
            )
        whole = isinstance(self.degree, int) and 0 <= self.degree <= LARGEST_DEGREE
        if self.degree != "auto" and not whole:
            raise AgonicError(
                f"degree {self.degree!r} is not possible; give 0 to {LARGEST_DEGREE}, or 'auto'"
            )
        for name in ("rate", "drift"):
            given = getattr(self, name)
            if given not in (True, False, "auto"):
                raise AgonicError(f"{name} {given!r} is neither True, False nor 'auto'")
        if isinstance(self.stations, str) and self.stations not in ("known", "unknown", "found"):
            raise AgonicError(
                f"stations {self.stations!r} is not known; give 'known' for the standard twelve, "
                "'unknown', 'found', or a rotation for each number"
            )

    @property
    def orientations(self) -> dict[int, Array] | None:
        """The described rotation (3, 3), box to chamber, by number; `None` where unknown."""
        if isinstance(self.stations, str):
            if self.stations != "known":
                return None
            return dict(enumerate(list_standard_rotations(), start=1))
        return {int(number): turn.as_matrix() for number, turn in self.stations.items()}

    def recorded(self) -> Mapping[str, Any]:
        """The settings for the provenance."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        if not isinstance(self.stations, str):
            values["stations"] = {
                str(number): np.roll(turn.as_quat(), 1).round(9).tolist()
                for number, turn in self.stations.items()
            }
        return values
