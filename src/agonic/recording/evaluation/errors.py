"""The error of a field by what is known of it: heading, dip, magnitude; and how parameters move it.

A heading is judged after one constant turn and a magnitude about its mean, for how a sensor sits in
its vehicle, the declination and the scale are no errors of a calibration that could not know them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.calibration.base import select_columns
from agonic.maths.one_pass import find_length, median
from agonic.maths.rotations.angles import wrap_deg
from agonic.maths.rotations.attitude import down_b
from agonic.maths.rotations.tilt import heading_by_vectors_deg
from agonic.recording.calibrated import Calibrated
from agonic.reference import Reference
from agonic.samples import Samples

HEADING, DIP, MAGNITUDE = "heading", "dip", "magnitude"
UNITS = {HEADING: "°", DIP: "°", MAGNITUDE: "%"}
"""The kinds of errors, the most telling first, and their units."""


class Known(NamedTuple):
    """What is known of the field at each row: `magnitude` (n,), the same number in all rows where
    none is known; `down` (n, 3) in the axes of the readings; `dip_deg` and `heading_deg` (n,)."""

    magnitude: Array
    down: Array | None = None
    dip_deg: Array | None = None
    heading_deg: Array | None = None

    def select(self, rows: Index | Mask) -> Known:
        """The same of some rows."""
        return Known._make(None if column is None else column[rows] for column in self)


def find_known(
    samples: Samples, reference: Reference | None, truth: Samples | None = None
) -> Known:
    """What samples, their reference and another's attitude `truth` at the same rows tell. A heading
    is a truth where it is independent of the magnetometer, and roll and pitch beside it make it
    level."""
    n, told = len(samples), samples if truth is None else truth
    columns = {"magnitude": np.ones(n)}
    in_units = reference is not None and samples.unit != "raw"
    if reference is not None and in_units:
        columns["magnitude"] = np.broadcast_to(reference.magnitudes(n), n)
    if told.roll_deg is None or told.pitch_deg is None:
        return Known(**columns)
    columns["down"] = down_b(told.roll_deg, told.pitch_deg)
    if told.heading_deg is not None and not told.heading_estimated:
        columns["heading_deg"] = told.heading_deg
    if reference is not None and in_units and reference.kind in ("vector", "horizontal-vertical"):
        horizontal, vertical = reference.horizontal_and_vertical(n).T
        columns["dip_deg"] = np.broadcast_to(np.degrees(np.arctan2(vertical, horizontal)), n)
    return Known(**columns)


def measure_errors(field: Array, known: Known) -> dict[str, Array]:
    """The errors (n,) of a field (n, 3) in every way that is known, degrees and per cent."""
    size = np.linalg.norm(field, axis=1)
    ratio = size / known.magnitude
    errors = {}
    if known.down is not None and known.heading_deg is not None:
        off = wrap_deg(heading_by_vectors_deg(field, known.down) - known.heading_deg)
        turn = np.degrees(np.angle(np.exp(1j * np.radians(off)).mean()))
        errors[HEADING] = np.asarray(wrap_deg(off - turn))
    if known.down is not None and known.dip_deg is not None:
        below = np.einsum("ni,ni->n", field, known.down)
        level = np.sqrt(np.maximum(size**2 - below**2, 0.0))
        errors[DIP] = np.asarray(np.degrees(np.arctan2(below, level)) - known.dip_deg)
    errors[MAGNITUDE] = np.asarray(100.0 * (ratio / ratio.mean() - 1.0))
    return errors


def measure_sensitivities(field: Array, sensitivity: Array, known: Known) -> dict[str, Array]:
    """How parameters move these errors, (n, m), where they move the field by (n, 3, m)."""
    size = np.maximum(np.linalg.norm(field, axis=1), np.finfo(float).tiny)[:, None]
    along = field / size

    def of(direction: Array, per: Array | float) -> Array:
        return np.asarray(np.einsum("ni,nij->nj", direction, sensitivity) / per)

    ratio = size / known.magnitude[:, None]
    longer = of(along, known.magnitude[:, None]) / ratio.mean()
    moves = {MAGNITUDE: 100.0 * (longer - ratio / ratio.mean() * longer.mean(axis=0))}
    if known.down is None:
        return moves
    below = np.einsum("ni,ni->n", field, known.down)[:, None]
    level = field - below * known.down
    flat = np.maximum(np.linalg.norm(level, axis=1, keepdims=True), 1e-9 * size)
    if known.heading_deg is not None:
        across = np.cross(level / flat, known.down)
        turned = of(across, flat)
        moves[HEADING] = np.degrees(turned - turned.mean(axis=0))
    if known.dip_deg is not None:
        steeper = (flat * known.down - below * level / flat) / size
        moves[DIP] = np.degrees(of(steeper, size))
    return moves


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

    def measure(field: Array) -> dict[str, float]:
        errors = measure_errors(field, known)
        return {kind: float(np.sqrt(np.mean(error**2))) for kind, error in errors.items()}

    noise = measure(result.corrected)
    if result.folds is not None:
        unseen, size = measure(result.folds.unseen), median(find_length(result.corrected))
        own = (100.0 * result.folds.magnitude_sd / size) ** 2
        unseen[MAGNITUDE] = float(np.sqrt(max(unseen[MAGNITUDE] ** 2 - own, 0.0)))
        noise = {kind: max(error, unseen[kind]) for kind, error in noise.items()}
    noise.setdefault(DIP, float(np.degrees(noise[MAGNITUDE] / 100.0)))
    return noise


def _find_heading_noise(noise: dict[str, float], level: float) -> float:
    """Of a heading, degrees, where the cosine of the dip is `level`."""
    own = float(np.degrees(noise[MAGNITUDE] / 100.0))
    tilt = np.sqrt(max(noise[DIP] ** 2 - own**2, 0.0))
    return float(np.hypot(own, np.sqrt(1.0 - level**2) * tilt) / level)
