"""`verify`: named checks of a calibration on data that the fit has not seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class Check:
    """One named question with its answer: `value` against `limit`, in `unit`.

    `passed` is None where the check informs but does not judge; `meaning` says in a sentence what
    the value tells and, when it failed, what to do.
    """

    name: str
    value: float
    limit: float | None
    unit: str
    passed: bool | None
    meaning: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Verification:
    """The checks, and the magnitudes they were made of.

    `spread_before` and `spread_after` are the standard deviation of the field's magnitude over its
    mean (a fraction) on the held-out rows; `held_out` (n,) marks those rows, or is None when the
    calibration was checked on other samples altogether; `magnitude_before` and `magnitude_after`
    (n,) are the magnitudes of all rows in the unit of the corrected field.
    """

    checks: tuple[Check, ...]
    spread_before: float
    spread_after: float
    residual_rms: float
    held_out: NDArray[np.bool_] | None
    magnitude_before: NDArray[np.float64]
    magnitude_after: NDArray[np.float64]

    @property
    def passed(self) -> bool:
        """No check failed."""
        return all(check.passed is not False for check in self.checks)
