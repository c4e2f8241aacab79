"""What was said of a run of `torture_wings`, and how far it was off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]
WRONG = 3.0


@dataclass(frozen=True)
class Outcome:
    """What was said of a run, its error over the stated one, and the findings."""

    verdict: str
    over_stated: float
    causes: tuple[str, ...]

    @property
    def wrong(self) -> bool:
        """Confidently wrong."""
        return self.verdict == "good" and self.over_stated > WRONG


def judge(result: Any, z: Array) -> Outcome:
    """The outcome of a result whose numbers are off by z standard errors, (n,)."""
    causes = tuple(finding.name for finding in result.findings)
    return Outcome(result.verdict, float(np.sqrt(np.mean(z**2))), causes)


def correlated(rng: np.random.Generator, shape: tuple[int, ...], kept: float, sd: float) -> Array:
    """AR(1) noise of a standard deviation, settled from the first row on."""
    warm = int(10 / (1 - kept))
    white = sd * np.sqrt(1 - kept**2) * rng.standard_normal((shape[0] + warm, *shape[1:]))
    return np.asarray(lfilter([1.0], [1.0, -kept], white, axis=0)[warm:])
