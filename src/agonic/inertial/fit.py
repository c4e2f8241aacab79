"""`fit_inertial`: for what cannot be turned over, from raw accelerometer and gyro; `InertialFit`: a
calibration with the errors of these."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.attitude.calibration import make_calibration, make_mean_calibration
from agonic.attitude.fit import make_fit
from agonic.attitude.heading_source import check_heading_source
from agonic.attitude.known_heading import check_heading_column
from agonic.attitude.problem import Gauge, Model
from agonic.attitude.undo_latency import find_and_undo, keep_latency
from agonic.calibration.affine import Affine
from agonic.ellipsoid.problem import describe_missing_scale
from agonic.errors import LogError
from agonic.fit import Fit
from agonic.health import MIN_READINGS, Finding
from agonic.health.finding import find_facts, find_first
from agonic.health.inertial_unit import check_clipping, repair
from agonic.inertial.attitude import Inertial
from agonic.inertial.evidence import (
    CONTRADICTION,
    INCLINATION,
    ONE_RATE,
    check_gravity,
    check_gyro,
)
from agonic.inertial.maths.factors import Headings
from agonic.inertial.problem import Settings, orient
from agonic.inertial.solve import free_attitude, keep_level, solve, solve_part
from agonic.inertial.start import Solved
from agonic.new_rows import interpolate_repeated
from agonic.reference import Reference
from agonic.samples import Samples


@dataclass(frozen=True, kw_only=True, eq=False)
class InertialFit(Fit):
    """A calibration beside accelerometer and gyro, and what was found of these.

    `samples` are those that were fitted, with roll and pitch as they were felt, and `reference`
    theirs; `felt` is that attitude, with the errors found taken out, but level as the accelerometer
    reads it where the vehicle stays near level: so calibration and tilt go together afterwards.
    `inertial_errors` (q,) and their `inertial_sd`: the accelerometer's bias, m/s², and with a gyro
    its bias, rad/s, its scale, the speed, m/s, that the vehicle keeps in turns, and how late, s,
    beside the gyro the readings are beyond what was undone, and the acceleration; where the dip is
    an unknown it is the last, rad. `accelerometer_gain` (3, 3) is what the accelerometer reads over
    what it feels, where there is a gyro. `heading_source` is what told the headings that
    joined, and `solved` the estimate by which parts of the rows are fitted.
    """

    samples: Samples
    reference: Reference
    felt: Inertial
    inertial_errors: Array
    inertial_sd: Array
    accelerometer_gain: Array | None
    settings: Settings
    solved: Solved
    heading_source: str | None = None

    @property
    def accelerometer_bias(self) -> Array:
        """What the accelerometer reads too much, (3,) m/s²."""
        return self.inertial_errors[:3]

    @property
    def gyro_bias(self) -> Array | None:
        """What the gyro reads too much, (3,) rad/s; `None` without one."""
        return None if self.felt.ahead is None else self.inertial_errors[3:6]

    @property
    def source(self) -> str:
        """What told the attitude."""
        unit = "accelerometer" if self.felt.ahead is None else "accelerometer and gyro"
        return unit if self.heading_source is None else f"{unit}, and {self.heading_source}"

    def find_rows(self, samples: Samples) -> Index | None:
        """The rows of the fit that some of its samples are; `None` where they are others."""
        if self.samples.time is None or samples.time is None:
            return None
        rows = np.searchsorted(self.samples.time, samples.time)
        rows = np.minimum(rows, len(self.samples) - 1)
        return rows if np.array_equal(self.samples.time[rows], samples.time) else None


LEAST_SD_DEG = 0.2
"""Of a heading: none is known better beside readings of another moment."""
USUAL_SD_DEG = 2.0
"""Of headings whose log states no standard deviation."""
UNKNOWN_OFFSET_SD = 1.0
"""rad: of headings from another zero, about where they are seen."""


def find_headings(solved: Solved) -> tuple[Headings | None, Finding | None]:
    """The headings that can join an estimate made without them, and what speaks against them.
    Headings of another zero, or where the declination is not known, tell by their changes alone."""
    samples, felt = solved.samples, solved.felt
    if samples.heading_deg is None or samples.heading_estimated or felt.ahead is None:
        return None, None
    known = samples.heading_known & solved.usable
    if known.sum() < MIN_READINGS:
        return None, None
    attitudes = orient(solved.problem, samples, felt, solved.found.solution.params)
    magnetic = np.degrees(np.arctan2(attitudes[:, 1, 0], attitudes[:, 0, 0]))
    declination, logged = None, samples.heading_deg[known]
    if solved.reference.kind == "vector":
        north, east = np.atleast_2d(solved.reference.values)[:, :2].mean(axis=0)
        declination = float(np.degrees(np.arctan2(east, north)))
    # without a declination any zero may be right
    zero = np.degrees(np.angle(np.exp(1j * np.radians(logged - magnetic[known])).mean()))
    turned_by = float(zero) if declination is None else declination
    doubt = check_heading_column(magnetic[known] + turned_by, logged, declination or 0.0)
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


def without_heading(samples: Samples) -> Samples:
    """The samples with nothing of a heading, for what is checked is roll and pitch as felt."""
    return samples.with_columns(heading_deg=None, heading_sd_deg=None, heading_source=None)


def fit_inertial(
    samples: Samples,
    reference: Reference | None = None,
    *,
    model: Model = "full",
    gauge: Gauge = "auto",
    sources: Sequence[str] = (),
    robust: bool = True,
    soft_iron_sd: float | None = 0.1,
    turn_sd_deg: float | None = 2.0,
    inclination_deg: float | None = None,
    accelerometer_sd_m_s2: float = 0.1,
    gyro_bias_sd_deg_s: float = 1.0,
    gyro_scale_sd: float = 0.02,
    speed_sd_m_s: float = 10.0,
    stretch_s: float = 30.0,
    heading_offset_sd_deg: float = 1.0,
    accelerometer_scale_sd: float | None = None,
    latency: bool = True,
    seed: int = 0,
) -> InertialFit:
    """Bias and matrix by magnitude, dip and azimuth of the field beside accelerometer and gyro.

    With d down and e level, as the inertial unit feels them, and u = W (raw − bias):

        |u| = F,   u·d = F sin I,   atan2(u·(d × e), u·e) = ψ_k in every stretch k of time.

    The heading ψ_k of a stretch is never needed. The accelerometer's bias, the gyro's bias and
    scale, and a small turn between magnetometer and inertial unit are unknowns under priors; each
    of the three kinds of residual is weighted by its own scatter. Without a gyro, or without times,
    the azimuth is left out and each row's acceleration tells down.

    Headings that do not come from the magnetometer (by GPS, of a filter of velocities, the course)
    join beside a gyro: heading = atan2(Rx̂ east, Rx̂ north) + offset, the offset one unknown of all.
    Those that follow the magnetometer, or turn otherwise than the gyro, are left out and told.

    Parameters
    ----------
    samples : with `acceleration`, and best `rotation_rate` and `time`.
    reference : horizontal and vertical intensity: `Reference.horizontal_vertical`, or a vector in
        the frame n as `ag.wmm().along(samples)` gives it. Of a magnitude the dip is found; without
        a reference the magnitude too is whatever makes the mean gain one.

    model, gauge, sources, robust, soft_iron_sd, turn_sd_deg, inclination_deg, seed : as in
        `fit_levelled`.
    accelerometer_sd_m_s2 : standard deviation of the prior on each axis of its bias.
    gyro_bias_sd_deg_s, gyro_scale_sd : those of the gyro's bias, degrees a second, and scale.
    speed_sd_m_s : that of a speed which the vehicle keeps in turns, on each of its axes.
    heading_offset_sd_deg : that of what all known headings share, where the declination is known.
    stretch_s : seconds over which the first estimate trusts the gyro to keep a heading.
    accelerometer_scale_sd : prior on the nine entries of the accelerometer's gain beside one;
        `None`: its gain is one, but for gravity's own 0.3 % from place to place.
    latency : find how late the readings are beside the gyro, as `fit_latency` does, and undo it.

    Returns an `InertialFit`. Raises `LogError` without acceleration that can be used, and
    `CoverageError` where nothing can be fitted at all.

    Source: maximum likelihood with Huber's sandwich covariance (Huber 1981); the joint model after
    Huang, Hendeby & Skog, arXiv 2505.16662 (2025); variable projection (Golub & Pereyra 1973).

    Examples
    --------
    >>> from agonic.simulation import simulate
    >>> made = simulate("circle", tilt_deg=8.0, n=2000)
    >>> bare = made.samples.with_columns(roll_deg=None, pitch_deg=None, heading_deg=None)
    >>> fit = fit_inertial(bare, Reference.vector(made.field_n, frame="n"))
    >>> bool((abs(fit.calibration.bias - made.truth.bias) < 4 * fit.sd[:3]).all())
    True
    """
    settings = Settings.of(locals())
    samples, late = interpolate_repeated(samples), None
    clipped = check_clipping(samples)
    repaired, wrong = repair(samples)
    if samples.acceleration is not None and repaired.acceleration is None:
        raise LogError("; ".join(one.sentence for one in wrong))
    samples = repaired
    if latency:
        samples, reference, late = find_and_undo(samples, reference)
    solved = solve(samples, reference, settings)
    headings, doubt = find_headings(solved)
    if headings is not None:
        solved = free_attitude(solved._replace(headings=headings))
    level = keep_level(solved)
    fit = _judge(level, samples, reference, wrong, (doubt, clipped))
    return _make_result(keep_latency(fit, level.samples, late), level, solved)


def _judge(
    solved: Solved,
    samples: Samples,
    reference: Reference | None,
    wrong: Sequence[Finding],
    others: Sequence[Finding | None],
) -> Fit:
    """The fit of an estimate with its evidence, with what was `wrong` with the inertial unit and
    what the `others` say of the log."""
    fit = make_fit(
        solved.found,
        solved.problem,
        solved.scale,
        without_heading(solved.samples),
        solved.usable,
        solved.settings,
        "inertial",
    )
    told = (check_gyro(fit, solved), *wrong, *find_facts([INCLINATION], fit, solved), *others)
    fit = fit.with_findings(*told, *find_facts([ONE_RATE], fit, solved))
    refuted = find_first([CONTRADICTION], solved)
    opposite = None  # without the gyro that was left out the sign of a level field is open
    if not any(one.severity == "refuse" for one in wrong):
        opposite = check_gravity(fit.with_findings(refuted), samples, reference, solved.settings)
    fit = fit.with_findings(opposite or refuted)
    if reference is None:
        magnitude, unit = fit.calibration.magnitude, samples.unit
        assert magnitude is not None
        remarks = (*fit.remarks, describe_missing_scale(magnitude, unit))
        calibration = replace(fit.calibration, unit_out=unit)
        fit = replace(fit, calibration=calibration, remarks=remarks)
    if solved.headings is None:
        return fit
    named = samples.heading_source or "the logged heading"
    return replace(fit, remarks=(*fit.remarks, f"{named} was used beside the gyro"))


def _make_result(fit: Fit, solved: Solved, before: Solved) -> InertialFit:
    """The fit with what was found of accelerometer and gyro; `before` its level was kept."""
    variances = np.diag(solved.found.solution.covariance)[-len(solved.sds) :]
    source = None
    if solved.headings is not None:
        source = solved.samples.heading_source or "the logged heading"
    return InertialFit(
        **{f.name: getattr(fit, f.name) for f in fields(Fit)},
        samples=without_heading(solved.samples),
        reference=solved.reference,
        felt=solved.felt,
        inertial_errors=solved.errors,
        inertial_sd=np.sqrt(variances) * solved.sds,
        accelerometer_gain=solved.gain,
        settings=solved.settings,
        solved=before,
        heading_source=source,
    )


def open_inertial_parts(
    whole: InertialFit, samples: Samples, reference: Reference | None
) -> Callable[[Mask], Affine]:
    """What gives the calibration by some of the rows (n,) of readings of a fit; acceleration and
    rates count in all rows. Readings that the fit does not have are fitted anew."""
    numbers = whole.find_rows(samples)

    def fit(rows: Mask) -> Affine:
        if numbers is None:
            known = None if reference is None else reference.select(rows)
            found = keep_level(solve(samples.select(rows), known, whole.settings))
        else:
            among = np.zeros(len(whole.samples), dtype=bool)
            among[numbers[rows]] = True
            found = solve_part(whole.solved, among)
        return make_calibration(
            found.found, found.problem, found.scale, found.samples, whole.settings, "inertial"
        )

    return fit
