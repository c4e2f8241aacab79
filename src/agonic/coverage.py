"""`Coverage`: which directions the field was seen from, and what that leaves open."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.maths.equation import coverage as kernel
from agonic.readable import Readable

OPEN_DEG = 90.0
"""Beyond a quarter of the circle the standard error of a heading says nothing."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Coverage(Readable):
    """Directions visited and standard errors over the sphere.

    `cells` (80,) readings per cell of the icosphere; `filled` its share of cells that were
    visited; `field_sd` (80,) standard error of the calibrated field at the centre of each cell,
    and `field_sd_max` its largest; `heading_sd_deg` the standard error of a level heading, rms
    over all headings, at the dip `inclination_deg`, `down` (3,) being where the sensor's axes have
    down then; `turns` says in words what to add;
    `of` what it is the coverage of, for two axes the circle.
    """

    cells: NDArray[np.int64]
    filled: float
    field_sd: Array
    field_sd_max: float
    heading_sd_deg: float
    inclination_deg: float
    turns: str = ""
    of: str = "sphere"
    down: Array = field(default_factory=kernel.DOWN.copy)

    @property
    def heading_known(self) -> bool:
        """Whether the standard error of the heading is one: beyond `OPEN_DEG` it says nothing."""
        return self.heading_sd_deg < OPEN_DEG


def compute_coverage(
    calibration: Affine,
    cells: NDArray[np.int64],
    inclination_deg: float = 60.0,
    down: Array = kernel.DOWN,
) -> Coverage:
    """The coverage of a calibration whose readings fell into `cells`, (80,) counts.

    Parameters: a calibration with magnitude and covariance; `inclination_deg` the dip at which the
    heading's standard error is stated, and `down` (3,) the sensor's attitude there.
    """
    magnitude, covariance = calibration.magnitude, calibration.covariance
    assert magnitude is not None
    assert covariance is not None
    bias, matrix, gauge = calibration.bias, calibration.matrix, calibration.gauge
    centres = kernel.icosphere()[0]
    spread = kernel.field_covariance(centres, magnitude, bias, matrix, covariance, gauge)
    field_sd = np.sqrt(np.linalg.eigvalsh(spread)[:, -1])
    return Coverage(
        cells=cells,
        filled=float((cells > 0).mean()),
        field_sd=field_sd,
        field_sd_max=float(field_sd.max()),
        heading_sd_deg=float(
            kernel.heading_sd_deg(inclination_deg, magnitude, matrix, covariance, gauge, down=down)
        ),
        inclination_deg=inclination_deg,
        turns=describe_missing_orientations(kernel.find_missing_axes(cells)),
        down=down,
    )


def describe_missing_orientations(missing: list[str]) -> str:
    """The turns that would bring the field along the axes it was never seen near."""
    if not missing:
        return ""
    axes = missing[0] if len(missing) == 1 else ", ".join(missing[:-1]) + f" and {missing[-1]}"
    them = "it" if len(missing) == 1 else "them"
    return f"turn the sensor until the field points along {axes} (field never within 40° of {them})"
