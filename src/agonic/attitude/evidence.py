"""What an attitude-aided fit rests on: residuals by kind, coverage, findings, remarks."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import polar

from agonic.arrays import Array, Index, Mask
from agonic.attitude.calibration import make_mean_calibration
from agonic.attitude.known_heading import (
    MountedHeading,
    check_azimuth,
    check_heading_column,
    check_turned_sensor,
    compute_mounted_heading,
)
from agonic.attitude.problem import Scale, Settings
from agonic.calibration.affine import Affine
from agonic.coverage import Coverage, compute_coverage
from agonic.fit import Accuracy, Channel, Fit, ModelTest, gather_evidence
from agonic.health import (
    REVERSED_FIELD,
    Evidence,
    Finding,
    check_mounting,
    check_resolution,
    check_scale,
    figure,
    find_side,
    inspect,
)
from agonic.health.evidence import HEADING_REFUSED_DEG
from agonic.maths.equation.channels import (
    Problem,
    compute_distances,
    compute_residuals,
    field_of_terms,
)
from agonic.maths.equation.coverage import DOWN, count_visits, find_level_down, make_level_axes
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.maths.one_pass import find_length, median
from agonic.maths.rotations.tilt import heading_by_vectors_deg
from agonic.model.posterior import Posterior
from agonic.model.verdict import examine_beside_terms, judge
from agonic.samples import Samples

ATTITUDE_DOUBTFUL_DEG = 5.0
HALF_DEG = 150
"""Headings that leave such a gap show less than a circle's centre, if the vehicle stays level."""
LEVEL_TILT_DEG = 20.0


def assess(
    affine: Affine,
    estimate: Estimate,
    problem: Problem,
    scale: Scale,
    samples: Samples,
    usable: Mask,
    tests: tuple[ModelTest, ...],
    turned: bool,
    settings: Settings,
    posterior: Posterior | None,
) -> Fit:
    """The fit with residuals of every row, coverage, findings and remarks."""
    weights = np.zeros(len(samples))
    weights[usable] = estimate.weights
    plain = make_mean_calibration(estimate, problem, scale, samples)
    cleaned = samples.field - field_of_terms(problem, estimate.solution.params) * scale.size
    coverage = _coverage(plain, cleaned, weights > 0, problem, settings)
    channels = _list_channels(estimate, problem, scale.size)
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
        shares={} if posterior is None else posterior.list_shares(),
    )
    magnitude = problem.magnitude * scale.magnitude
    _, normals = compute_distances(cleaned, plain.bias, plain.matrix, magnitude)
    evidence = gather_evidence(fit, plain, samples, cleaned, normals, usable, plain.magnitude)
    tilt_sd = _tilt_sd_deg(channels, evidence.radius)
    mounted = compute_mounted_heading(plain, coverage)
    evidence = replace(evidence, coverage=replace(coverage, heading_sd_deg=mounted.own_sd_deg))
    found = _findings(samples, evidence, problem, cleaned, channels, tilt_sd, posterior)
    named = {one.name for one in found}
    found += tuple(one for one in judge(posterior, evidence, found) if one.name not in named)
    told = check_turned_sensor(mounted, turned) if "dip" in channels else None
    bent = {f.name for f in found if f.severity == "refuse"} & {"mounting", "attitude"}
    column = None if bent else _check_heading(plain, cleaned, samples, problem, weights > 0)
    if column is not None:
        found = tuple(f for f in found if f.name != column.name)
    said = [] if told is not None and told.severity != "note" else [t.sentence for t in tests]
    if tilt_sd:
        felt = problem.shared is not None
        which = "the tilt by accelerometer and gyro is" if felt else "roll and pitch are"
        said.append(f"{which} good to {figure(tilt_sd)}° by the field's dip")
    fit = replace(fit, accuracy=_state_accuracy(fit, mounted), remarks=tuple(said))
    return fit.with_findings(*found, told, column)


def _state_accuracy(fit: Fit, mounted: MountedHeading) -> Accuracy:
    """How well the result is known, in the sensor's own axes and in the vehicle's."""
    return Accuracy(
        bias_sd=float(fit.sd[:3].max()),
        unit=fit.calibration.unit_in,
        own_deg=mounted.own_sd_deg,
        inclination_deg=fit.coverage.inclination_deg,
        vehicle_deg=mounted.vehicle_sd_deg,
        alone=set(fit.channels) == {"magnitude"},
    )


def _list_channels(estimate: Estimate, problem: Problem, size: float) -> dict[str, Channel]:
    """Residuals, noise and correlation of each kind, in the unit of the readings."""
    return {
        kind: Channel(
            residuals=compute_residuals(problem, kind, estimate.solution.params) * size,
            noise=noise.sd * size,
            correlation=noise.correlation,
        )
        for kind, noise in estimate.noise.items()
    }


def _check_heading(
    plain: Affine, cleaned: Array, samples: Samples, problem: Problem, used: Mask
) -> Finding | None:
    """Whether the logged heading is the true one, by the field in the sensor's own axes."""
    if problem.across is None or problem.dip is None or samples.heading_deg is None:
        return None
    down, logged = problem.dip.down[used], samples.heading_deg[used]
    own = plain.correct(cleaned[used]) @ polar(plain.matrix)[0]
    magnetic_north = np.cross(problem.across[used], down)
    declination = logged - heading_by_vectors_deg(magnetic_north, down)
    mean = float(np.degrees(np.angle(np.exp(1j * np.radians(declination)).mean())))
    return check_heading_column(heading_by_vectors_deg(own, down) + mean, logged, mean)


def find_dip_deg(problem: Problem, settings: Settings) -> float:
    """The dip at which the heading's standard error is stated: that of the place."""
    if settings.inclination_deg is not None:
        return settings.inclination_deg
    if problem.dip is None:
        return 60.0
    return float(np.degrees(np.arctan2(problem.dip.vertical.mean(), problem.dip.horizontal.mean())))


def find_down(problem: Problem) -> Array:
    """Where the sensor's axes have down in a level vehicle, as far as roll and pitch tell."""
    return DOWN if problem.dip is None else find_level_down(problem.dip.down, squarely=True)


def _coverage(
    plain: Affine,
    cleaned: Array,
    used: Mask,
    problem: Problem,
    settings: Settings,
) -> Coverage:
    """Coverage and heading uncertainty with the sources at their mean, at the dip of the place."""
    dip = find_dip_deg(problem, settings)
    field = plain.correct(cleaned[used])
    if problem.dip is None:
        return compute_coverage(plain, count_visits(field), dip)
    down = problem.dip.down[used]
    # recorded roll and pitch know level; a felt one shows it only to a vehicle that turned
    known = problem.shared is None or find_headings_seen(field, down).gap_deg >= HALF_DEG
    level = find_level_down(down, squarely=known)
    coverage = compute_coverage(plain, count_visits(field), dip, level)
    return replace(coverage, turns=describe_turns(field, down))


def _half_seen(e: Evidence, problem: Problem, cleaned: Array) -> Finding | None:
    """A level vehicle that never turned half of the way: bias and soft iron look the same there.
    What is stated then is mostly the prior, whatever the standard error says."""
    if problem.dip is None or "azimuth" in problem.channels:
        return None
    seen = find_headings_seen((cleaned - e.bias) @ e.shape.T, problem.dip.down)
    if seen.gap_deg < HALF_DEG or seen.tilt_deg >= LEVEL_TILT_DEG:
        return None
    return Finding(
        "coverage",
        "refuse",
        f"the headings leave a gap of {seen.gap_deg}° and the vehicle was level to "
        f"{figure(seen.tilt_deg)}°: bias and soft iron cannot be separated",
        e.coverage.turns,
    )


def _tilt_sd_deg(channels: dict[str, Channel], radius: float) -> float | None:
    """What the dip scatters by beyond the noise of the readings: errors of roll and pitch."""
    if "dip" not in channels:
        return None
    excess = channels["dip"].noise ** 2 - channels["magnitude"].noise ** 2
    return float(np.degrees(np.sqrt(max(excess, 0.0)) / radius))


def _findings(
    samples: Samples,
    evidence: Evidence,
    problem: Problem,
    cleaned: Array,
    channels: dict[str, Channel],
    tilt_sd: float | None,
    posterior: Posterior | None,
) -> tuple[Finding, ...]:
    """What is wrong with readings and fit; one cause is not reported twice."""
    seen = inspect(samples)
    if any(finding.severity == "refuse" for finding in seen):
        return seen
    if (by_dip := problem.dip) is not None:  # a felt tilt has the signs of its accelerometer
        vertical = None if problem.shared is not None else by_dip.vertical
        if (misplaced := check_mounting(cleaned, by_dip.down, vertical)) is not None:
            return (misplaced, *seen)
        side = find_side(cleaned, by_dip.down, np.eye(3), by_dip.vertical)
        astray = tilt_sd is not None and tilt_sd > HEADING_REFUSED_DEG
        if vertical is not None and astray and side < 0:
            return (REVERSED_FIELD, *seen)
    if evidence.radius < 0:
        return (REVERSED_FIELD, *seen)
    gain = evidence.known_radius / evidence.radius if evidence.known_radius else 1.0
    half = _half_seen(evidence, problem, cleaned)
    examined = examine_beside_terms(evidence, posterior, attitude_aided=True)
    coarse = check_resolution(samples.field, evidence.radius, samples.unit)
    known = evidence.known_radius
    size = median(find_length(samples.field)) / known if known else None
    found = [*seen, *filter(None, (check_scale(gain, samples.unit, size), coarse, half))]
    found += [f for f in examined if half is None or f.name != half.name]
    if tilt_sd is not None and tilt_sd > ATTITUDE_DOUBTFUL_DEG:
        why = "roll and pitch are wrong or late, or a magnet or steel stands near"
        move = "check the attitude, its axes and its delay; fly gentle turns"
        if problem.shared is not None:  # felt by an accelerometer
            why = (
                "a magnet or steel stands near, the vehicle speeds up and brakes, or the axes or "
                "units of accelerometer and gyro are wrong"
            )
            move = (
                "turn slowly, without jolts; check axes, units and times of accelerometer and gyro"
            )
        what = f"the field's dip scatters by {figure(tilt_sd)}° about that of the world model"
        refused = tilt_sd > HEADING_REFUSED_DEG
        grave = Finding("attitude", "refuse" if refused else "check", f"{what}: {why}", move)
        found.append(grave)
    if problem.relative is None:
        dip = evidence.coverage.inclination_deg
        found += filter(None, (check_azimuth(channels, evidence.radius, dip),))
    return tuple(found)


WIDEST_GAP_DEG = 60.0
LEAST_TILT_DEG = 10.0


class HeadingsSeen(NamedTuple):
    """What a vehicle showed: the sectors of 15° that its headings were in, and its tilt."""

    sectors: Index
    widest: int
    gap_deg: int
    tilt_deg: float


def find_headings_seen(field: Array, down: Array) -> HeadingsSeen:
    """The headings and the tilt of a vehicle, by field and down (n, 3) in a sensor's axes."""
    axes = make_level_axes(find_level_down(down)).T
    field, down = field @ axes, down @ axes
    heading = heading_by_vectors_deg(field, down)
    sectors = np.unique((heading // 15).astype(np.intp) % 24)
    gaps = np.diff(np.append(sectors, sectors[0] + 24)) - 1
    widest = int(np.argmax(gaps))
    tilt = float(np.degrees(np.arccos(np.clip(np.percentile(down[:, 2], 5), -1.0, 1.0))))
    return HeadingsSeen(sectors, widest, 15 * int(gaps[widest]), tilt)


def describe_turns(field: Array, down: Array) -> str:
    """The headings and the tilt that a vehicle would have to add."""
    seen = find_headings_seen(field, down)
    said = []
    if seen.gap_deg > WIDEST_GAP_DEG:
        first = 15 * seen.sectors[(seen.widest + 1) % len(seen.sectors)]
        last = 15 * (seen.sectors[seen.widest] + 1)
        said.append(f"turn through all headings (seen: {first}° to {last % 360}°)")
    if seen.tilt_deg < LEAST_TILT_DEG:
        said.append("bank and pitch by 20° or more on the way")
    return ", and ".join(said)
