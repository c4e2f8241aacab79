"""What a fit taught by the attitude rests on: residuals by kind, coverage, findings, remarks."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.attitude import calibration
from agonic.attitude.problem import Scale
from agonic.attitude.settings import Settings
from agonic.calibration.affine import Affine
from agonic.coverage import Coverage, cover
from agonic.fit import Channel, Fit, ModelTest
from agonic.health import (
    Evidence,
    Finding,
    check_mounting,
    check_scale,
    examine_attitude_aided,
    figure,
    inspect,
    sort_findings,
)
from agonic.maths.equation import attitude_aided
from agonic.maths.equation.coverage import count_visits
from agonic.maths.rotations.tilt import heading_by_vectors_deg
from agonic.samples import Samples

ATTITUDE_DOUBTFUL_DEG = 5.0
HEADING_DOUBTFUL_DEG = 5.0
HEADING_REFUSED_DEG = 20.0
WIDEST_GAP_DEG = 60.0
LEAST_TILT_DEG = 10.0
HALF_DEG = 150
"""Headings that leave such a gap show less than a circle's centre, if the vehicle stays level."""
LEVEL_TILT_DEG = 20.0


def with_evidence(
    affine: Affine,
    estimate: attitude_aided.Estimate,
    problem: attitude_aided.Problem,
    scale: Scale,
    samples: Samples,
    usable: Mask,
    tests: tuple[ModelTest, ...],
    settings: Settings,
) -> Fit:
    """The fit with residuals of every row, coverage, findings and remarks."""
    weights = np.zeros(len(samples))
    weights[usable] = estimate.weight
    plain = calibration.effective(estimate, problem, scale, samples)
    cleaned = samples.field - attitude_aided.added(problem, estimate.solution.params) * scale.size
    coverage = _coverage(plain, cleaned, weights > 0, problem, settings)
    channels = _channels(estimate, problem, scale.size)
    fit = Fit(
        calibration=affine,
        n=int(usable.sum()),
        residuals=channels["magnitude"].residuals,
        weights=weights,
        noise=channels["magnitude"].noise,
        correlation=max(channel.correlation for channel in channels.values()),
        condition=estimate.solution.condition,
        iterations=estimate.solution.iterations,
        converged=estimate.solution.converged,
        coverage=coverage,
        channels=channels,
        tests=tests,
    )
    evidence = _evidence(fit, plain, cleaned, problem, estimate.solution.params, samples, usable)
    tilt_sd = _tilt_sd_deg(channels, evidence.radius)
    found = _findings(samples, evidence, problem, cleaned, channels, tilt_sd)
    fit = replace(fit, findings=found)
    said = _remarks(fit, tilt_sd, problem)
    return fit if fit.verdict == "refused" else replace(fit, remarks=said)


def _channels(
    estimate: attitude_aided.Estimate, problem: attitude_aided.Problem, size: float
) -> dict[str, Channel]:
    """Residuals, noise and correlation of each kind, in the unit of the readings."""
    return {
        kind: Channel(
            residuals=attitude_aided.residuals(problem, kind, estimate.solution.params) * size,
            noise=noise.sd * size,
            correlation=noise.correlation,
        )
        for kind, noise in estimate.noise.items()
    }


def _evidence(
    fit: Fit,
    plain: Affine,
    cleaned: Array,
    problem: attitude_aided.Problem,
    params: Array,
    samples: Samples,
    usable: Mask,
) -> Evidence:
    """What the examination of a fit looks at: the readings without what sources added."""
    assert plain.magnitude is not None
    assert fit.weights is not None
    magnitude = fit.channels["magnitude"]
    gain = float(np.trace(plain.matrix) / 3)
    return Evidence(
        readings=cleaned[usable],
        time=None if samples.time is None else samples.time[usable],
        residuals=magnitude.residuals[usable],
        weights=fit.weights[usable],
        normals=attitude_aided.normals(problem, params)[usable],
        bias=plain.bias,
        shape=plain.matrix / gain,
        radius=plain.magnitude / gain,
        noise=magnitude.noise,
        correlation=magnitude.correlation,
        coverage=fit.coverage,
        known_radius=plain.magnitude,
        unit=samples.unit,
    )


def _coverage(
    plain: Affine,
    cleaned: Array,
    believed: Mask,
    problem: attitude_aided.Problem,
    settings: Settings,
) -> Coverage:
    """Coverage and heading uncertainty with the sources at their mean, at the dip of the place."""
    assert plain.covariance is not None
    assert plain.magnitude is not None
    dip = settings.inclination_deg
    if dip is None and problem.down is not None:
        dip = float(np.degrees(np.arctan2(problem.vertical.mean(), problem.horizontal.mean())))
    field = plain.correct(cleaned[believed])
    coverage = cover(
        count_visits(field),
        plain.magnitude,
        plain.bias,
        plain.matrix,
        plain.covariance,
        gauge=plain.gauge,
        inclination_deg=60.0 if dip is None else dip,
    )
    if problem.down is None:
        return coverage
    return replace(coverage, turns=turns_of_a_vehicle(field, problem.down[believed]))


class Seen(NamedTuple):
    """What a vehicle showed: the sectors of 15° that its headings were in, and its tilt."""

    sectors: Index
    widest: int
    gap_deg: int
    tilt_deg: float


def seen_of(field: Array, down: Array) -> Seen:
    """The headings and the tilt of a vehicle, by field and down (n, 3) in body axes."""
    heading = heading_by_vectors_deg(field, down)
    sectors = np.unique((heading // 15).astype(np.intp) % 24)
    gaps = np.diff(np.append(sectors, sectors[0] + 24)) - 1
    widest = int(np.argmax(gaps))
    tilt = float(np.degrees(np.arccos(np.clip(np.percentile(down[:, 2], 5), -1.0, 1.0))))
    return Seen(sectors, widest, 15 * int(gaps[widest]), tilt)


def turns_of_a_vehicle(field: Array, down: Array) -> str:
    """The headings and the tilt that a vehicle would have to add.

    Parameters: field and down (n, 3) in body axes, of the readings that were believed.

    >>> level = np.tile([0.0, 0.0, 1.0], (2, 1))
    >>> turns_of_a_vehicle(np.array([[1.0, 0.0, 2.0], [0.0, -1.0, 2.0]]), level)
    'turn through all headings (seen: 0° to 105°), and bank and pitch by 20° or more on the way'
    """
    seen = seen_of(field, down)
    said = []
    if seen.gap_deg > WIDEST_GAP_DEG:
        first = 15 * seen.sectors[(seen.widest + 1) % len(seen.sectors)]
        last = 15 * (seen.sectors[seen.widest] + 1)
        said.append(f"turn through all headings (seen: {first}° to {last % 360}°)")
    if seen.tilt_deg < LEAST_TILT_DEG:
        said.append("bank and pitch by 20° or more on the way")
    return ", and ".join(said)


def _half_seen(e: Evidence, problem: attitude_aided.Problem, cleaned: Array) -> Finding | None:
    """A level vehicle that never turned half of the way: bias and soft iron look the same there.

    What is stated then is mostly the prior's word, whatever the standard error says.
    """
    if problem.down is None or "azimuth" in problem.kinds:
        return None
    seen = seen_of((cleaned - e.bias) @ e.shape.T, problem.down)
    if seen.gap_deg < HALF_DEG or seen.tilt_deg >= LEVEL_TILT_DEG:
        return None
    return Finding(
        "coverage",
        "refuse",
        f"the headings leave a gap of {seen.gap_deg}° and the vehicle was level to "
        f"{figure(seen.tilt_deg)}°: bias and soft iron cannot be told apart",
        e.coverage.turns,
    )


def _tilt_sd_deg(channels: dict[str, Channel], radius: float) -> float | None:
    """What the dip scatters by beyond the noise of the readings: errors of roll and pitch."""
    if "dip" not in channels:
        return None
    excess = channels["dip"].noise ** 2 - channels["magnitude"].noise ** 2
    return float(np.degrees(np.sqrt(max(excess, 0.0)) / radius))


def _heading_sd_deg(evidence: Evidence, channels: dict[str, Channel]) -> float | None:
    """What the azimuth scatters by over the level part of the field: errors of the heading."""
    if "azimuth" not in channels:
        return None
    level = evidence.radius * np.cos(np.radians(evidence.coverage.inclination_deg))
    return float(np.degrees(channels["azimuth"].noise / max(level, 1e-9)))


def _findings(
    samples: Samples,
    evidence: Evidence,
    problem: attitude_aided.Problem,
    cleaned: Array,
    channels: dict[str, Channel],
    tilt_sd: float | None,
) -> tuple[Finding, ...]:
    """What is wrong with readings and fit, refusals first; one cause is not reported twice."""
    seen = inspect(samples)
    if any(finding.severity == "refuse" for finding in seen):
        return seen
    misplaced = None if problem.down is None else check_mounting(cleaned, problem.down)
    if misplaced is not None:
        return (misplaced, *seen)
    gain = evidence.known_radius / evidence.radius if evidence.known_radius else 1.0
    half = _half_seen(evidence, problem, cleaned)
    examined = (f for f in examine_attitude_aided(evidence) if half is None or f.name != half.name)
    found = [*seen, *filter(None, (check_scale(gain, samples.unit), half)), *examined]
    if tilt_sd is not None and tilt_sd > ATTITUDE_DOUBTFUL_DEG:
        found.append(
            Finding(
                "attitude",
                "check",
                f"the field's dip scatters by {figure(tilt_sd)}° about that of the world model: "
                "roll and pitch are wrong, late, or the field is disturbed",
                "check the attitude, its axes and its delay; fly gentle turns",
            )
        )
    turned = _heading_sd_deg(evidence, channels)
    if turned is not None and turned > HEADING_DOUBTFUL_DEG:
        found.append(
            Finding(
                "heading",
                "refuse" if turned > HEADING_REFUSED_DEG else "check",
                f"the field's azimuth scatters by {figure(turned)}° about that of the known "
                "heading: it is wrong, late, or in radians",
                "check the heading, its unit and its zero, or fit without it (levelled)",
            )
        )
    return sort_findings(found)


def _remarks(fit: Fit, tilt_sd: float | None, problem: attitude_aided.Problem) -> tuple[str, ...]:
    """How good the result is, in words."""
    said = [
        f"bias known to {figure(float(fit.sd[:3].max()))} {fit.calibration.unit_in}, a level "
        f"heading to {figure(fit.coverage.heading_sd_deg)}° at "
        f"{fit.coverage.inclination_deg:.0f}° dip",
        *(test.sentence for test in fit.tests),
    ]
    if tilt_sd:
        said.append(f"roll and pitch are good to {figure(tilt_sd)}° by the field's dip")
    if (
        "azimuth" not in problem.kinds
        and "dip" in problem.kinds
        and fit.calibration.gauge != "free"
    ):
        said.append(
            "a turn of the sensor about the vertical cannot be seen without a known heading"
        )
    return tuple(said)
