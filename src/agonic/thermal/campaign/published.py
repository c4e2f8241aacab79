"""What the published campaign reached, to be shown beside one's own."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

IMPROVEMENT: Mapping[str, tuple[float, float, float, float]] = MappingProxyType(
    {
        "MMC5883MA-1": (5.44, 24.58, 1.11, 12.42),
        "MMC5883MA-2": (11.71, 2.43, 1.47, 5.98),
        "MPU-9255-1": (2.58, 1.40, 3.85, 1.18),
        "MPU-9255-2": (2.96, 4.89, 4.92, 2.81),
        "MPU-9255-3": (1.84, 1.19, 1.13, 1.63),
    }
)
"""By sensor: the largest of the twelve standard deviations of a station's readings before the
correction over the largest after, of x, y, z and |B|. Nikolaev et al. 2023, table."""
