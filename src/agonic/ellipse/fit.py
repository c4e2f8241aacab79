"""`fit_ellipse`: a two-axis compass, from readings while the vehicle turned level."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.base import Validity
from agonic.ellipse.evidence import (
    Found,
    compute_spread,
    count_sectors,
    examine,
    find_change,
    solve,
)
from agonic.ellipse.maths.conic import compute_heading_sd_deg, make_matrix
from agonic.ellipse.result import EllipseFit
from agonic.errors import AgonicError, CoverageError
from agonic.health import Finding, figure
from agonic.health.resolution import find_rounding
from agonic.provenance import Provenance
from agonic.reference import Reference
from agonic.samples import Samples

FEWEST = 12
"""Readings that five unknowns, their noise and an outlier need."""
_PLACES = [0, 1, 3, 4, 6]
"""Where bias x y and matrix xx yy xy stand among the nine of an affine calibration."""


class _Place(NamedTuple):
    """The horizontal intensity, nT, with its sd, and the dip; None without a place."""

    horizontal: float
    sd: float
    inclination_deg: float
    source: str


def fit_ellipse(
    samples: Samples, reference: Reference | None = None, *, robust: bool = True, seed: int = 0
) -> EllipseFit:
    """Bias and matrix in the plane that put the readings of a level two-axis compass on a circle.

    Minimises, with r the distance from the ellipse,

        Σ ρ(r_i/σ),   r = (|W(raw − bias)| − H)/|Wᵀû|

    by the five unknowns bias x y and W xx yy xy, W symmetric.

    Parameters
    ----------
    samples : readings with `axes="xy"`, while the vehicle turned level through all headings.
    reference : with the horizontal intensity H of the place. Without one the mean gain is set to 1;
        a heading needs no more.
    robust : down-weight outliers by Tukey's loss where a reading stands out. seed : of the starts.

    Returns an `EllipseFit`, refused where less than three quarters of the circle was seen. A turn
    of the sensor about the vertical is none of its unknowns: a deviation card has it (A).

    Raises `CoverageError` for readings too few or that never change, `AgonicError` for samples
    with a z axis.

    Source: Caruso (2000), Applications of magnetic sensors for low cost compass systems, IEEE
    Position Location and Navigation Symposium, 177–184, doi 10.1109/PLANS.2000.838300.

    Examples
    --------
    >>> angle, rng = np.radians(np.arange(0.0, 720.0)), np.random.default_rng(1)
    >>> circle = 20_000 * np.stack([np.cos(angle), -np.sin(angle), 0 * angle], axis=1)
    >>> noise = rng.normal(size=(720, 3)) * [50, 50, 0]
    >>> level = Samples(field=circle + [3000.0, -500.0, 0.0] + noise, axes="xy")
    >>> fit = fit_ellipse(level)
    >>> fit.verdict, bool(np.all(np.abs(fit.bias - [3000, -500, 0]) <= 4 * fit.sd[:3]))
    ('good', True)
    """
    if samples.axes != "xy":
        raise AgonicError(
            f'{samples.name} has three axes; fit_ellipsoid takes them all, and axes="xy" with '
            "zeros along z says that there are two"
        )
    place = _find_place(samples, reference)
    fit, found = _fit(samples, place, robust, seed)
    fit = fit.with_findings(*examine(fit, found))
    if fit.verdict == "refused":
        return fit
    return fit.with_findings(_compare_halves(samples, place, robust, seed))


def _fit(
    samples: Samples, place: _Place | None, robust: bool, seed: int
) -> tuple[EllipseFit, Found]:
    readings = samples.field[:, :2]
    _refuse_few(readings)
    found = solve(readings, find_rounding(readings), robust=robust, seed=seed)
    calibration = _make_calibration(found, samples, place, {"robust": robust, "seed": seed})
    covariance = calibration.covariance
    assert covariance is not None
    magnitude = calibration.magnitude
    assert magnitude is not None
    used = found.weights > 0
    after = np.linalg.norm(calibration.correct(samples.field)[used, :2], axis=1)
    heading_sd_deg = compute_heading_sd_deg(
        calibration.matrix[:2, :2], covariance[np.ix_(_PLACES, _PLACES)], magnitude
    )
    fit = EllipseFit(
        samples=samples,
        calibration=calibration,
        n=len(readings),
        residuals=found.residuals,
        weights=found.weights,
        noise=found.noise,
        correlation=found.correlation,
        sectors=count_sectors(readings, found),
        heading_sd_deg=heading_sd_deg,
        spread_before=compute_spread(np.linalg.norm(readings[used], axis=1)),
        spread_after=compute_spread(after),
        inclination_deg=None if place is None else place.inclination_deg,
        remarks=_describe(calibration, heading_sd_deg, place),
    )
    return fit, found


def _refuse_few(readings: Array) -> None:
    if len(readings) < FEWEST:
        raise CoverageError(
            f"{len(readings)} readings cannot determine the five unknowns of an ellipse",
            turns="record a few hundred readings while the vehicle turns through all headings",
        )
    if float(np.ptp(readings, axis=0).min()) <= 1e-9 * float(np.abs(readings).max()):
        raise CoverageError(
            "an axis never changes: the sensor did not turn, or it is stuck",
            turns="turn the vehicle level through all headings while recording",
        )


def _find_place(samples: Samples, reference: Reference | None) -> _Place | None:
    """The mean horizontal intensity and dip of the reference."""
    if reference is None:
        return None
    if reference.kind not in ("vector", "horizontal-vertical"):
        raise AgonicError(
            "the magnitude of the whole field was given, of which a level compass measures the "
            "horizontal part only: give the place (--at LAT,LON) instead, or neither, for headings "
            "need no magnitude"
        )
    h, z = reference.horizontal_and_vertical(len(samples)).mean(axis=0)
    dip = float(np.degrees(np.arctan2(z, h)))
    return _Place(float(h), reference.sd, dip, reference.source)


def _make_calibration(
    found: Found, samples: Samples, place: _Place | None, settings: dict[str, object]
) -> Affine:
    """The calibration in the unit of the field; along z the mean gain, so that it can be undone."""
    plane, spread = make_matrix(found.ellipse), found.covariance
    gain = float(np.trace(plane)) / 2
    if place is None:
        toward = np.array([0.0, 0.0, 0.5, 0.5, 0.0])
        change = np.eye(5)
        change[2:] = (change[2:] - np.outer(found.ellipse[2:], toward) / gain) / gain
        magnitude, unit_out = 1 / gain, samples.unit
        spread, extra = change @ spread @ change.T, 0.0
    else:
        magnitude, unit_out = place.horizontal, "nT"
        size = np.array([1.0, 1.0, magnitude, magnitude, magnitude])
        spread, extra = spread * np.outer(size, size), place.sd
    matrix = np.diag([0.0, 0.0, gain * magnitude])
    matrix[:2, :2] = plane * magnitude
    stretch = np.r_[0.0, 0.0, found.ellipse[2:] * extra]
    covariance = np.zeros((9, 9))
    covariance[np.ix_(_PLACES, _PLACES)] = spread + np.outer(stretch, stretch)
    told = "none: mean gain set to 1" if place is None else f"{magnitude:g} nT ({place.source})"
    return Affine(
        bias=np.r_[found.ellipse[:2], 0.0],
        matrix=matrix,
        covariance=covariance,
        unit_in=samples.unit,
        unit_out=unit_out,
        model="ellipse",
        magnitude=magnitude,
        noise=found.noise,
        sensor=samples.name,
        device_id=samples.device_id,
        frame_in=samples.frame,
        frame_out=samples.frame,
        validity=Validity.of(samples),
        provenance=Provenance(
            inputs=(samples.origin,),
            settings={"fit": "ellipse", **settings, "reference": told},
            method=("huber-1981", "beaton-tukey-1974", "caruso-2000"),
        ),
    )


def _describe(affine: Affine, heading_sd_deg: float, place: _Place | None) -> tuple[str, ...]:
    assert affine.sd is not None
    bias_sd = figure(float(affine.sd[:2].max()))
    said = f"standard error: bias {bias_sd} {affine.unit_in}, heading {figure(heading_sd_deg)}°"
    if place is None:
        size = figure(affine.magnitude or 0.0, 5)
        return (
            f"{said} (level)",
            "no place was given, so the mean gain is set to 1 (horizontal intensity "
            f"{size} {affine.unit_in}); headings need no more",
        )
    tilt = float(np.tan(np.radians(abs(place.inclination_deg))))
    return (f"{said} (level; each degree of tilt adds up to {figure(tilt)}°)",)


def _compare_halves(
    samples: Samples, place: _Place | None, robust: bool, seed: int
) -> Finding | None:
    """What changed between the halves of a log, where each saw enough of the circle."""
    half = len(samples) // 2
    if half < 5 * FEWEST:
        return None
    halves = []
    for rows in (slice(0, half), slice(half, None)):
        part, found = _fit(samples[rows], place, robust, seed)
        if any(one.severity == "refuse" for one in examine(part, found)):
            return None
        halves.append(part)
    return find_change(*halves)
