"""What disturbs on board, joined to a fit where it moves the readings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.attitude.disturbers.choice import SourceChoice, choose_sources, describe_gain
from agonic.attitude.disturbers.shape import find_timing_sd
from agonic.attitude.problem import find_terms
from agonic.attitude.settings import Settings
from agonic.calibration.interference import Interference
from agonic.fit import Fit
from agonic.maths.estimation.inference.wald import wald
from agonic.reference import Reference
from agonic.samples import Samples

MATTERS = 0.003
"""A current joins the fit when its usual changes move the readings by this share of the field."""
SIGNIFICANT = 1e-4


def fit_with_sources(
    run: Callable[..., Fit],
    samples: Samples,
    reference: Reference,
    settings: Mapping[str, Any],
) -> tuple[Fit, SourceChoice]:
    """The fit, with what disturbs on board where anything recorded does; and what was compared.

    What is better on unseen parts of the log is taken, or a current that moves the readings.
    """
    found = choose_sources(samples, reference, keep_common(settings))

    def fit_with(*sources: str) -> Fit:
        return run(samples, reference, **settings, **({"sources": sources} if sources else {}))

    if found.sources:
        fit = fit_with(*found.sources)
        if _measure_sources(fit, samples) > MATTERS:
            return add_choice(fit, found), found
    if varies(samples.current_A):
        fit = fit_with("current_A")
        surely = _test_sources(fit) < SIGNIFICANT
        if surely and _measure_sources(fit, samples) > MATTERS:
            return fit, found
    return fit_with(), found


def add_choice(fit: Fit, found: SourceChoice) -> Fit:
    """The fit with what its sources are good for, and how well their timing is known."""
    calibration = fit.calibration
    assert isinstance(calibration, Interference)
    timed = replace(calibration, timing_sd_s=find_timing_sd(found.shapes))
    return replace(fit, calibration=timed).with_findings(describe_gain(found))


def list_sources(fit: Fit) -> tuple[str, ...]:
    return getattr(fit.calibration, "sources", ())


def varies(current: Array | None) -> bool:
    """Whether a current was recorded and changes."""
    return current is not None and float(np.ptp(current)) > 0.0


def _test_sources(joined: Fit) -> float:
    """How likely chance would make what sources add."""
    assert isinstance(joined.calibration, Interference)
    slopes = joined.calibration.coefficients
    known = joined.covariance[-slopes.size :, -slopes.size :]
    return wald(slopes.ravel(), known, joined.n / joined.correlation).p_value


def _measure_sources(joined: Fit, samples: Samples) -> float:
    """By how much of the field the usual changes of sources move it."""
    calibration = joined.calibration
    assert isinstance(calibration, Interference)
    assert calibration.magnitude is not None
    added = calibration.matrix @ calibration.coefficients
    moved = find_terms(samples, calibration.sources) @ added.T
    low, high = np.percentile(moved, (5, 95), axis=0)
    return float(np.linalg.norm(high - low)) / calibration.magnitude


def keep_common(settings: Mapping[str, Any]) -> Settings:
    """The settings of a fit that one with sources has too; the whole model."""
    common = ("robust", "soft_iron_sd", "seed", "turn_sd_deg")
    return Settings(**{name: settings[name] for name in common if name in settings})
