"""Whether fits without one block of time each scatter by more than they state.

With θ_b the fit without block b and C_b its covariance, and θ and C those of all rows, θ_b − θ has
the covariance C_b − C where what is stated is right. Of a level heading, over all blocks,

    ratio = Σ |θ_b − θ|² / Σ (C_b − C)

is one then. It is larger where errors last as long as a block: of roll and pitch, of a field that
differs from place to place, of what disturbs on board.

Source: the jackknife by blocks (Künsch 1989).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.calibration.affine import Affine
from agonic.calibration.base import Calibration, select_columns
from agonic.calibration.inputs import stack_inputs
from agonic.calibration.interference import Interference
from agonic.coverage import Coverage
from agonic.fit import Fit
from agonic.health import Finding, figure
from agonic.health.evidence import HEADING_DOUBTFUL_DEG, HEADING_REFUSED_DEG
from agonic.maths.equation.coverage import heading_sd_deg, level_directions, make_level_axes
from agonic.maths.rotations.angles import wrap_deg
from agonic.maths.rotations.tilt import two_axis_deg
from agonic.recording.held_out import Folds
from agonic.samples import Samples

BY_CHANCE = 2.0
"""A ratio that chance reaches in one of twenty fits whose errors are as stated."""


def widen_by_parts(fit: Fit, folds: Folds | None, samples: Samples, *, turned: bool) -> Fit:
    """The fit with the standard errors that its parts show, where these are larger.

    Parameters: `turned` where a turn of all headings by one angle is an error of the fit.
    """
    whole = None if folds is None else _at_mean(folds.whole, samples)
    if fit.verdict == "refused" or folds is None or whole is None:
        return fit
    stated = _state_deg(whole, fit.coverage, turned)
    square = expected = 0.0
    for part in (_at_mean(part, samples) for part in folds.parts):
        if part is None:
            return fit
        square += _compare_deg(part, whole, fit.coverage, turned) ** 2
        expected += max(_state_deg(part, fit.coverage, turned) ** 2 - stated**2, 0.0)
    if not expected > 0 or square < BY_CHANCE * expected:
        return fit
    shown = stated * float(np.sqrt(square / expected))
    before = fit.coverage.heading_sd_deg
    return fit if shown <= before else _grow(fit, shown / before)


def _grow(fit: Fit, factor: float) -> Fit:
    """The fit with its standard errors times a factor, and the finding."""
    coverage, known, calibration = fit.coverage, fit.accuracy, fit.calibration
    assert calibration.covariance is not None
    before, after = coverage.heading_sd_deg, factor * coverage.heading_sd_deg
    wider = replace(calibration, covariance=factor**2 * calibration.covariance)
    if known is not None:
        known = replace(
            known,
            bias_sd=factor * known.bias_sd,
            own_deg=factor * known.own_deg,
            vehicle_deg=None if known.vehicle_deg is None else factor * known.vehicle_deg,
        )
    grown = replace(
        coverage,
        field_sd=factor * coverage.field_sd,
        field_sd_max=factor * coverage.field_sd_max,
        heading_sd_deg=after,
    )
    doubtful, refused = after >= HEADING_DOUBTFUL_DEG, after >= HEADING_REFUSED_DEG
    return replace(fit, calibration=wider, coverage=grown, accuracy=known).with_findings(
        Finding(
            "parts differ",
            "refuse" if refused else "check" if doubtful else "note",
            "calibrations without an eighth of the log each differ by more than they state, which "
            f"is {figure(before)}° of heading, as if it were {figure(after)}°: errors last as long "
            "as such a part (of the attitude, of the field from place to place, of currents)",
            "turn through all headings several times, away from iron, and record longer"
            if doubtful
            else "",
        )
    )


def _at_mean(part: Calibration | None, samples: Samples) -> Affine | None:
    """The affine calibration with sources on board at their mean; None of any other kind."""
    if isinstance(part, Interference):
        inputs = stack_inputs(part.sources, None, select_columns(part, samples))
        part = part.at(inputs.mean(axis=0))
    stated = isinstance(part, Affine) and part.covariance is not None and part.magnitude
    return part if stated and isinstance(part, Affine) and not part.needs else None


def _state_deg(part: Affine, coverage: Coverage, turned: bool) -> float:
    """The standard error of a level heading that a fit states."""
    assert part.magnitude is not None
    assert part.covariance is not None
    at = (coverage.inclination_deg, part.magnitude, part.matrix, part.covariance, part.gauge)
    return float(heading_sd_deg(*at, down=coverage.down, but_constant=not turned))


def _compare_deg(part: Affine, whole: Affine, coverage: Coverage, turned: bool) -> float:
    """By how much the level headings of two fits differ, rms."""
    assert whole.magnitude is not None
    axes = make_level_axes(coverage.down).T
    directions, _ = level_directions(coverage.inclination_deg, down=coverage.down)
    raw = whole.magnitude * directions @ np.linalg.inv(whole.matrix).T + whole.bias
    off = wrap_deg(
        two_axis_deg(*(part.correct(raw) @ axes).T[:2]) - two_axis_deg(*(directions @ axes).T[:2])
    )
    if not turned:
        off = wrap_deg(off - np.degrees(np.angle(np.exp(1j * np.radians(off)).mean())))
    return float(np.sqrt(np.mean(off**2)))
