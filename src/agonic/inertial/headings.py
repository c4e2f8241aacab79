"""Headings of a log that do not come from the magnetometer: whether and how they join the fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.arrays import Array
from agonic.attitude.calibration import make_mean_calibration
from agonic.attitude.heading_column import check_heading_column
from agonic.attitude.heading_source import check_heading_source
from agonic.health import FEWEST, Finding
from agonic.inertial.maths.headings import Headings
from agonic.inertial.problem import orient
from agonic.inertial.start import Solved
from agonic.reference import Reference
from agonic.samples import Samples

LEAST_SD_DEG = 0.2
"""Of a heading: none is known better beside readings of another moment."""
USUAL_SD_DEG = 2.0
"""Of headings whose log states no standard deviation."""
UNKNOWN_OFFSET_SD = 1.0
"""rad: of headings from another zero, about where they are seen."""


def find_headings(solved: Solved) -> tuple[Headings | None, Finding | None]:
    """The headings that can join an estimate made without them, and what speaks against them.

    Headings of another zero, or where the declination is not known, tell by their changes alone.
    """
    samples, felt = solved.samples, solved.felt
    if samples.heading_deg is None or samples.heading_estimated or felt.ahead is None:
        return None, None
    known = samples.heading_known & solved.usable
    if known.sum() < FEWEST:
        return None, None
    attitudes = orient(solved.problem, samples, felt, solved.found.solution.params)
    magnetic = np.degrees(np.arctan2(attitudes[:, 1, 0], attitudes[:, 0, 0]))
    declination = find_declination_deg(solved.reference)
    doubt = _check_column(magnetic[known], samples.heading_deg[known], declination)
    if doubt is not None and doubt.severity == "refuse":
        return None, replace(doubt, severity="check", what=f"{doubt.what}; it was not used")
    plain = make_mean_calibration(solved.found, solved.problem, solved.scale, samples)
    wrong = check_heading_source(samples, solved.reference, plain)
    if wrong is not None:
        return None, wrong
    sd = USUAL_SD_DEG if samples.heading_sd_deg is None else samples.heading_sd_deg
    sd = np.where(known, np.radians(np.maximum(sd, LEAST_SD_DEG)), np.inf)
    if declination is not None and doubt is None:
        angle = np.radians(samples.heading_deg - declination)
        offset_sd = float(np.radians(solved.settings.heading_offset_sd_deg))
        return Headings(angle, sd, offset_sd), None
    turned = np.exp(1j * np.radians(magnetic - samples.heading_deg))[known].mean()
    angle = np.radians(samples.heading_deg) + float(np.angle(turned))
    if doubt is not None:
        doubt = replace(doubt, what=f"{doubt.what}; only how it changes was used")
    return Headings(angle, sd, UNKNOWN_OFFSET_SD), doubt


def _check_column(
    magnetic_deg: Array, logged_deg: Array, declination_deg: float | None
) -> Finding | None:
    """Whether the column looks like a true heading; without a declination any zero may be right."""
    if declination_deg is not None:
        return check_heading_column(magnetic_deg + declination_deg, logged_deg, declination_deg)
    zero = np.exp(1j * np.radians(logged_deg - magnetic_deg)).mean()
    apart = float(np.degrees(np.angle(zero)))
    return check_heading_column(magnetic_deg + apart, logged_deg, 0.0)


def find_declination_deg(reference: Reference) -> float | None:
    """The mean declination of a reference; `None` where it has none."""
    if reference.kind != "vector":
        return None
    north, east = np.atleast_2d(reference.values)[:, :2].mean(axis=0)
    return float(np.degrees(np.arctan2(east, north)))


def name_heading(samples: Samples) -> str:
    """What told the headings, in words."""
    return samples.heading_source or "the logged heading"


def without_heading(samples: Samples) -> Samples:
    """The samples with nothing of a heading, for what is checked is roll and pitch as felt."""
    return samples.with_columns(heading_deg=None, heading_sd_deg=None, heading_source=None)
