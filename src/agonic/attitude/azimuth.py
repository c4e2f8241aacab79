"""Whether the azimuth of the field agrees with a known heading, or with what the gyro tells."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from agonic.fit import Channel
from agonic.health import Evidence, Finding, figure
from agonic.maths.equation.channels import Problem

HEADING_DOUBTFUL_DEG = 5.0
HEADING_REFUSED_DEG = 20.0


def check_azimuth(
    evidence: Evidence, problem: Problem, channels: Mapping[str, Channel]
) -> Finding | None:
    """The finding that the azimuth of the calibrated field scatters by too much."""
    if "azimuth" not in channels:
        return None
    felt = problem.relative is not None
    off = compute_azimuth_sd_deg(
        channels, evidence.radius, evidence.coverage.inclination_deg, felt=felt
    )
    if off <= HEADING_DOUBTFUL_DEG:
        return None
    if felt:
        beside = "what the gyro tells: its unit, axes, sign or clock are wrong"
        move = "check unit, axes and times of the gyro"
    else:
        beside = "that of the known heading: it is wrong, late, or in radians"
        move = "check the heading, its unit and its zero, or fit without it (levelled)"
    return Finding(
        "heading",
        "refuse" if off > HEADING_REFUSED_DEG else "check",
        f"the field's azimuth scatters by {figure(off)}° about {beside}",
        move,
    )


def compute_azimuth_sd_deg(
    channels: Mapping[str, Channel], radius: float, inclination_deg: float, *, felt: bool
) -> float:
    """What the azimuth scatters by over the level part of the field: errors of heading or gyro.

    A tilt that is felt wrongly by ε turns the field's azimuth by up to ε tan(dip): a vehicle that
    brakes and turns would be told that its gyro is wrong. The dip shows that ε, so its share
    √(σ_dip² − σ_magnitude²) sin(dip) is taken out.
    """
    dip = np.radians(inclination_deg)
    square = channels["azimuth"].noise ** 2
    if felt and "dip" in channels:
        tilt = channels["dip"].noise ** 2 - channels["magnitude"].noise ** 2
        square -= max(tilt, 0.0) * np.sin(dip) ** 2
    level = max(radius * np.cos(dip), 1e-9)
    return float(np.degrees(np.sqrt(max(square, 0.0)) / level))
