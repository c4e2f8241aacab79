"""`choose_walk`: how fast a bias walks, by how well each reading is predicted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.base import select_columns
from agonic.calibration.thermal import Thermal
from agonic.calibration.tracking import TrackerParams
from agonic.errors import AgonicError
from agonic.inflight.tracking.filter import start, update
from agonic.maths.estimation.noise.residuals import MAD_TO_SD
from agonic.reference import Reference
from agonic.samples import Samples

FEWEST = 100
"""Readings that a choice needs at least."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WalkChoice:
    """The walk that predicts best, and how well all candidates did.

    `walk` in the unit of the readings per √s; `candidates` (k,), and the prediction error of each,
    `residual_rms` (k,), nT: readings from the second quarter on that all could foretell, each
    before it was used.
    """

    walk: float
    candidates: Array
    residual_rms: Array


def choose_walk(
    samples: Samples,
    reference: Reference,
    candidates: Sequence[float] | None = None,
    *,
    calibration: Affine | Thermal | None = None,
    params: TrackerParams | None = None,
) -> WalkChoice:
    """The random walk of the bias with which each reading is predicted best before it is used.

    Parameters
    ----------
    samples, reference : readings with times, and what the magnitude should have been.
    candidates : walks to try, in the unit of the readings per √s; `None`: none, and half decades
        from a ten-thousandth of the noise a reading up to all of it.
    calibration, params : as `start` takes them; the walk of `params` is not looked at.

    Returns a `WalkChoice`. Raises `AgonicError` without times or with fewer than `FEWEST` readings.

    Source: minimum prediction error (L. Ljung, 1999, System Identification, 2nd edition, chapter
    7); outliers are clipped at six times the scale of the best candidate.

    Examples
    --------
    >>> from agonic.simulation import simulate
    >>> made = simulate("tumble", n=2000, noise=50.0)
    >>> known = Reference.constant(50_000)
    >>> choose_walk(made.samples, known, [0.0, 30.0], params=TrackerParams(noise=50.0)).walk
    0.0
    """
    if samples.time is None or len(samples) < FEWEST:
        raise AgonicError(
            f"a walk is chosen from readings with times, {FEWEST} at least; there are "
            f"{len(samples)}{' without times' if samples.time is None else ''}"
        )
    settings = params or TrackerParams()
    magnitude = reference.magnitudes(len(samples))
    begun = start(calibration, settings, epoch=samples.epoch)
    first = begun.ground or begun.aboard
    columns = {} if first is None else select_columns(first, samples)
    raw = begun.at_middle(samples.field, **columns)
    tried = np.asarray(candidates, dtype=np.float64)
    if candidates is None:  # from none to the noise in every reading
        gain = float(np.cbrt(abs(np.linalg.det(begun.base.matrix))))
        noise = begun.noise if begun.noise_known else 1e-2 * float(np.mean(magnitude)) / gain
        shares = np.concatenate([[0.0], 10.0 ** np.arange(-4.0, 0.1, 0.5)])
        tried = noise * shares / np.sqrt(np.median(np.diff(samples.time)))
    # what a start does not know yet is no walk
    later = slice(len(samples) // 4, None)
    residuals, known = [], []
    external = reference.sd if settings.external_sd is None else settings.external_sd
    for walk in tried:
        settings_now = replace(settings, walk=float(walk), history_s=0.0, external_sd=external)
        _, seen = update(begun, settings_now, samples.time, raw, magnitude)
        residuals.append(np.abs(seen.residual[later]))
        known.append(seen.foretold[later])
    rows = np.logical_and.reduce(known)
    compared = [r[rows] if rows.sum() >= FEWEST // 2 else r for r in residuals]
    limit = 6.0 * MAD_TO_SD * min(float(np.median(r)) for r in compared)
    rms = np.array([np.sqrt(np.mean(np.minimum(r, limit) ** 2)) for r in compared])
    return WalkChoice(walk=float(tried[np.argmin(rms)]), candidates=tried, residual_rms=rms)
