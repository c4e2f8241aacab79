"""What a calibration states of the errors of readings that it has not seen."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.calibration.base import select_columns
from agonic.maths.one_pass import find_length, median
from agonic.recording.calibrated import Calibrated
from agonic.recording.evaluation.errors import (
    DIP,
    HEADING,
    MAGNITUDE,
    Known,
    find_known,
    measure_errors,
    measure_sensitivities,
)
from agonic.samples import Samples

ANY_DEG = 180.0 / np.sqrt(3.0)
"""The rms of an angle of which nothing is known."""


def state_errors(
    result: Calibrated, samples: Samples, field: Array, known: Known
) -> dict[str, float]:
    """The rms errors that a calibration states of the field (n, 3) of other samples.

        error² = tr(G C Gᵀ)/n + noise²

    G is how the parameters move each error and C their covariance. The noise is what the parts of
    its own log that were held out showed, beyond the uncertainty of the fits to the other parts;
    readings that count as outliers are in it, for as many will come again. On a horizontal axis a
    noise along the field turns the heading by noise/H, and an error of roll and pitch, which is
    what the dip scatters by beyond that noise, by its tangent.
    """
    calibration = result.fit.calibration
    sensitivity = calibration.sensitivity(samples.field, **select_columns(calibration, samples))
    size = np.linalg.norm(field, axis=1)
    noise = _find_noise(result)
    if known.down is not None:
        below = np.einsum("ni,ni->n", field, known.down)
        level = np.sqrt(np.maximum(1.0 - (below / size) ** 2, 1e-12))
        noise[HEADING] = _find_heading_noise(noise, median(level))
    stated = {}
    for kind, moves in measure_sensitivities(field, sensitivity, known).items():
        by_fit = float(np.einsum("ni,ij,nj->n", moves, result.fit.covariance, moves).mean())
        error = float(np.hypot(np.sqrt(max(by_fit, 0.0)), noise[kind]))
        stated[kind] = error if kind == MAGNITUDE else min(error, ANY_DEG)
    return stated


def _find_noise(result: Calibrated) -> dict[str, float]:
    """The rms errors of magnitude, per cent, and dip, degrees, of the log's own held-out parts,
    the magnitude's without what the uncertainty of the fits to the other parts adds to it."""
    known = find_known(result.samples.with_columns(heading_deg=None), result.reference)
    noise = _rms(measure_errors(result.corrected, known))
    if result.folds is not None:
        unseen = _rms(measure_errors(result.folds.unseen, known))
        size = median(find_length(result.corrected))
        own = (100.0 * result.folds.magnitude_sd / size) ** 2
        unseen[MAGNITUDE] = float(np.sqrt(max(unseen[MAGNITUDE] ** 2 - own, 0.0)))
        noise = {kind: max(error, unseen[kind]) for kind, error in noise.items()}
    noise.setdefault(DIP, float(np.degrees(noise[MAGNITUDE] / 100.0)))
    return noise


def _find_heading_noise(noise: dict[str, float], level: float) -> float:
    """Of a heading, degrees, where the cosine of the dip is `level`.

    >>> round(_find_heading_noise({MAGNITUDE: 1.0, DIP: 0.7}, 0.5), 3)
    1.341
    """
    own = float(np.degrees(noise[MAGNITUDE] / 100.0))
    tilt = np.sqrt(max(noise[DIP] ** 2 - own**2, 0.0))
    return float(np.hypot(own, np.sqrt(1.0 - level**2) * tilt) / level)


def _rms(errors: dict[str, Array]) -> dict[str, float]:
    return {kind: float(np.sqrt(np.mean(error**2))) for kind, error in errors.items()}
