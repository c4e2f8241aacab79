"""What disturbs on board, joined to a fit where it moves the readings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from agonic.attitude.disturbers.choice import SourceChoice, choose_sources, describe_gain
from agonic.attitude.disturbers.shape import find_timing_sd
from agonic.attitude.problem import find_terms
from agonic.attitude.settings import Settings
from agonic.calibration.interference import Interference
from agonic.fit import Fit
from agonic.reference import Reference
from agonic.samples import Samples

MATTERS = 0.003
"""Sources join the fit where their usual changes move the readings by this share of the field."""


def fit_with_sources(
    run: Callable[..., Fit],
    samples: Samples,
    reference: Reference,
    settings: Mapping[str, Any],
) -> tuple[Fit, SourceChoice]:
    """The fit, with what disturbs on board where that moves the readings; and what was compared."""
    found = choose_sources(samples, reference, keep_common(settings))
    if found.sources:
        fit = run(samples, reference, **settings, sources=found.sources)
        if _measure_sources(fit, samples) > MATTERS:
            return add_choice(fit, found), found
    return run(samples, reference, **settings), found


def add_choice(fit: Fit, found: SourceChoice) -> Fit:
    """The fit with what its sources are good for, and how well their timing is known."""
    calibration = fit.calibration
    assert isinstance(calibration, Interference)
    timed = replace(calibration, timing_sd_s=find_timing_sd(found.shapes))
    return replace(fit, calibration=timed).with_findings(describe_gain(found))


def list_sources(fit: Fit) -> tuple[str, ...]:
    return getattr(fit.calibration, "sources", ())


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
