"""The main job: the best calibration of each magnetometer that a log allows, verified."""

from __future__ import annotations

from dataclasses import dataclass

from agonic.fit import Fit
from agonic.samples import Samples
from agonic.verify import Verification


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibrated:
    """One magnetometer of a log: its readings, the fit, and its verification.

    `method` is the word of the fit ("ellipsoid"); `reason` says in a sentence why it was chosen;
    `verdict` is "good", "check" or "refused" and `status` the sentence that goes with it.
    """

    samples: Samples
    fit: Fit
    verification: Verification
    method: str
    reason: str
    verdict: str
    status: str
