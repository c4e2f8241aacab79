"""From samples to what the estimator takes, points of about one, terms and directions; the estimate
from the rows that can be used; and errors that all rows share.

An error of the reference's dip or declination, or of the zero of roll and pitch, is the same in
every row, so no number of rows averages it out. Each is one unknown with a standard deviation; what
it moves the estimate by joins the covariance (Schmidt's consider covariance, `model.posterior`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields
from typing import Any, Literal, NamedTuple, Self, get_args

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.sources import list_columns, list_disturbers, signals, stack_inputs
from agonic.calibration.timing import find_timing, restore
from agonic.errors import AgonicError, CoverageError, LogError, check_choice
from agonic.health import MIN_READINGS, find_rounding
from agonic.maths.equation.affine import FREE, split
from agonic.maths.equation.channels import Dip, Problem, compute_residuals, pieces
from agonic.maths.equation.crowding import weigh_places
from agonic.maths.equation.maximum_likelihood import Estimate, estimate, refine
from agonic.maths.equation.priors import compute_turn
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.inference import wald
from agonic.maths.one_pass import median
from agonic.maths.rotations.attitude import down_b, rot_nb
from agonic.maths.rotations.vectors import skew
from agonic.reference import Reference
from agonic.samples import Samples

Model = Literal["sphere", "diagonal", "full"]
Gauge = Literal["auto", "symmetric", "free"]


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The settings of a fit; see `fit_levelled`."""

    model: Model = "full"
    gauge: Gauge = "auto"
    sources: tuple[str, ...] = ()
    robust: bool = True
    soft_iron_sd: float | None = 0.1
    turn_sd_deg: float | None = 2.0
    inclination_deg: float | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        check_choice("model", self.model, get_args(Model))
        check_choice("gauge", self.gauge, get_args(Gauge))
        object.__setattr__(self, "sources", tuple(self.sources))
        if len(set(self.sources)) < len(self.sources):
            raise AgonicError(f"a source is named twice: {', '.join(self.sources)}")
        for name in ("soft_iron_sd", "turn_sd_deg"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise AgonicError(f"{name} is {value}; a prior needs it above zero, or None")

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> Self:
        """Those among what a public function was given."""
        return cls(**{f.name: given[f.name] for f in fields(cls) if f.name in given})

    def recorded(self) -> Mapping[str, Any]:
        """The settings for the provenance."""
        plain = {f.name: getattr(self, f.name) for f in fields(self)}
        return plain | {"sources": list(self.sources)}


def estimate_usable(
    problem: Problem, usable: Mask, settings: Settings, start: Array | None = None
) -> Estimate:
    """The estimate from the usable rows of a problem of all rows; from `start` first, if given."""
    part = select_usable(problem, usable)
    with name_missing_hold():
        return estimate(part, robust=is_robust(part, settings), seed=settings.seed, start=start)


def refine_usable(problem: Problem, usable: Mask, settings: Settings, params: Array) -> Estimate:
    """The same from near parameters, and nowhere else."""
    part = select_usable(problem, usable)
    with name_missing_hold():
        return refine(part, params, is_robust(part, settings))


@contextmanager
def name_missing_hold() -> Iterator[None]:
    """The error of a fit that runs away."""
    try:
        yield
    except (OverflowError, np.linalg.LinAlgError):
        raise CoverageError(
            "the readings do not determine a calibration: an axis never changes, or repeats "
            "another axis",
            turns="look at each axis of the log, and turn the sensor about all three",
        ) from None


def select_usable(problem: Problem, usable: Mask) -> Problem:
    """The problem of the usable rows (n,)."""
    return problem if usable.all() else problem.subset(np.flatnonzero(usable))


def is_robust(part: Problem, settings: Settings) -> bool:
    """Whether outliers are down-weighted, which few rows do not allow."""
    return settings.robust and len(part.points) >= 2 * MIN_READINGS


OTHER_DEG = 1.0
"""What else errs in the azimuth of a row, about: tilt, time, noise of the magnetometer."""
MIN_HEADING_KNOWN = 0.5


class Scale(NamedTuple):
    """From normalised numbers back to readings. reading = centre + size · point, term = middle +
    spread · normalised term, field = magnitude · normalised field; `sd` is the uncertainty of the
    magnitude, `reference` says whose it is."""

    centre: Array
    size: float
    magnitude: float
    sd: float
    middle: Array
    spread: Array
    reference: str


def normalise(
    samples: Samples,
    reference: Reference,
    channels: tuple[str, ...],
    gauge: str,
    settings: Settings,
) -> tuple[Problem, Scale]:
    """The problem that samples and reference pose to the estimator, all rows, and its scale."""
    n = len(samples)
    centre = samples.field.mean(axis=0)
    size = float(np.linalg.norm(samples.field - centre) / np.sqrt(n))
    if size <= 1e-9 * float(np.linalg.norm(centre)):
        raise CoverageError(
            "there is one usable reading only"
            if n == 1
            else "the readings never change: the sensor did not turn, or it is stuck",
            turns="turn the vehicle through all headings, banking both ways, while recording",
        )
    x = find_terms(samples, settings.sources)
    # over what was seen, not over time: on the ground before a flight motors stand still
    middle = np.average(x, axis=0, weights=weigh_places(samples.field)) if x.size else np.zeros(0)
    spread = x.std(axis=0)
    still = spread < 1e-9 * (np.abs(middle) + 1e-9)
    if still.any():
        names = [one for one, never in zip(signals(settings.sources), still, strict=True) if never]
        raise CoverageError(
            f"{', '.join(names)} never changes, so its effect on the readings cannot be separated "
            f"from the bias",
            turns="record with the motors at several powers, or fit without it",
        )
    dip = None
    parts = reference.horizontal_and_vertical(n).T if "dip" in channels else None
    magnitudes = reference.magnitudes(n) if parts is None else np.hypot(*parts)
    magnitude = float(magnitudes.mean())
    if parts is not None:
        dip = Dip(down_b(*_angles(samples, channels)[:2]), *(parts / magnitude))
    attitude = rot_nb(*_angles(samples, channels)) if "azimuth" in channels else None
    problem = Problem(
        points=(samples.field - centre) / size,
        magnitude=magnitudes / magnitude,
        model=settings.model,
        soft_iron_sd=settings.soft_iron_sd,
        gauge=gauge,
        turn_sd=None if settings.turn_sd_deg is None else float(np.radians(settings.turn_sd_deg)),
        terms=(x - middle) / spread if settings.sources else None,
        dip=dip,
        across=None if attitude is None else _across(attitude, reference),
        across_weight=None if attitude is None else weigh_rows(samples),
        rounding=find_rounding(samples.field) / size,
    )
    at = (centre, size, magnitude, reference.sd, middle, spread, reference.describe())
    return problem, Scale(*at)


def find_terms(samples: Samples, sources: tuple[str, ...]) -> Array:
    """What joins the bias, (n, k): currents as they are, of a second magnetometer the difference.
    Two sensors see the same field, so their difference tells of disturbance only, whatever the
    attitude; the readings themselves would say the same thing twice."""
    if not sources:
        return np.zeros((len(samples), 0))
    columns, needed = samples.columns(), list_columns(sources)
    missing = [name for name in needed if name not in columns]
    if missing:
        held = f"; it holds {', '.join(there)}" if (there := list_disturbers(samples)) else ""
        raise LogError(
            f"{samples.name}: the log holds no {', '.join(missing)}; a fit with it needs it "
            f"recorded beside the readings{held} (for second: samples.with_second(other))"
        )
    at_rows = restore(columns, find_timing(sources))
    known = {name: at_rows[name] for name in needed}
    if "second" in known:
        known["second"] = known["second"] - samples.field
    return stack_inputs(sources, None, known)


def _angles(samples: Samples, channels: tuple[str, ...]) -> tuple[Array, Array, Array]:
    """Roll, pitch and heading, as far as they are needed."""
    angles = {"roll": samples.roll_deg, "pitch": samples.pitch_deg}
    if "azimuth" in channels:
        angles["heading"] = samples.heading_deg
    missing = [name for name, values in angles.items() if values is None]
    if missing:
        raise LogError(
            f"{samples.name}: the log holds no {', '.join(missing)}; this fit needs the attitude "
            "recorded beside the readings; fit the magnitude alone with fit_ellipsoid"
        )
    known = [values for values in angles.values() if values is not None]
    return known[0], known[1], known[-1]


def _across(attitude: Array, reference: Reference) -> Array:
    """Horizontal unit vectors square to the field, in body axes, (n, 3)."""
    if reference.kind != "vector" or reference.frame != "n":
        raise AgonicError(
            "a fit to the full vector needs the field's components north, east, down: "
            "Reference.vector(…, frame='n'), as the world model gives them"
        )
    north, east = reference.values[:, 0], reference.values[:, 1]
    level = np.hypot(north, east)
    side = np.stack([-east / level, north / level, np.zeros_like(north)], axis=1)
    return np.asarray(np.einsum("nji,nj->ni", attitude, np.broadcast_to(side, (len(attitude), 3))))


def is_known(samples: Samples) -> bool:
    """Whether the heading is there, is not the magnetometer's own, and is known in most rows."""
    there = samples.heading_deg is not None and not samples.heading_estimated
    return there and float(samples.heading_known.mean()) >= MIN_HEADING_KNOWN


def weigh_rows(samples: Samples) -> Array | None:
    """The weight (n,) of each row's azimuth beside a usual one; `None` where all count alike."""
    if samples.heading_sd_deg is None:
        return None
    total = np.hypot(samples.heading_sd_deg, OTHER_DEG)
    usual = median(total[samples.heading_known]) if samples.heading_known.any() else 1.0
    return np.asarray(usual / total)


TURN_DOUBTFUL = 0.01
"""A turn that chance makes this seldom may be the sensor's, or an error of roll and pitch."""
TURN = "misalignment of the sensor"
_SMALL = 0.1  # of a standard deviation of the reference: the residuals are linear in so little


def list_considered(estimate: Estimate, problem: Problem, scale: Scale) -> dict[str, Array]:
    """By how much errors that all rows share move the parameters, by the name of the error."""
    moves = find_reference_moves(estimate, problem, scale.sd / scale.magnitude)
    named = dict(zip(("dip of the reference", "azimuth of the reference"), moves, strict=False))
    turn = find_turn_move(estimate, problem) if problem.shared is None else None
    return named if turn is None else {**named, TURN: turn}


def find_reference_moves(estimate: Estimate, problem: Problem, sd: float) -> list[Array]:
    """By how much an error of one standard deviation of the reference moves the parameters."""
    of_dip = problem.shared is not None and problem.shared.dip_by.any()
    if sd == 0.0 or problem.dip is None or of_dip:  # then the dip is among the unknowns
        return []
    small = _SMALL * sd
    dip = problem.dip
    size = np.hypot(dip.horizontal, dip.vertical)
    steeper = Dip(
        dip.down,
        dip.horizontal - small * dip.vertical / size,
        dip.vertical + small * dip.horizontal / size,
    )
    shifted = [problem._replace(dip=steeper)]
    if problem.across is not None:
        ahead = np.cross(problem.across, dip.down)
        aside = (small / dip.horizontal)[:, None] * ahead
        shifted.append(problem._replace(across=problem.across + aside))
    return [_move(estimate, problem, other) / _SMALL for other in shifted]


def _move(estimate: Estimate, problem: Problem, other: Problem) -> Array:
    """How far another problem's minimum lies from this one's, to first order: −A⁻¹ Σ Jᵀ w δr/σ²."""
    solution = estimate.solution
    known = solution.information + problem.prior_information(solution.params)
    pull = np.zeros(len(solution.params))
    for channel, noise in estimate.noise.items():
        here = compute_residuals(problem, channel, solution.params)
        change = compute_residuals(other, channel, solution.params) - here
        weight = noise.loss.curvature((here / noise.sd) ** 2) / noise.sd**2 / noise.correlation
        by_params = np.concatenate([j for _, j in pieces(problem, channel)(solution.params)])
        pull += (weight * change) @ by_params
    return -leastsq.inverse(known) @ pull


def find_turn_move(estimate: Estimate, problem: Problem) -> Array | None:
    """By how much the parameters are off if a turn that was found is not the sensor's. Roll and
    pitch with an error of their zero look the same as a misaligned sensor. Either may be; halfway
    between the two the variance is half of the square of the turn."""
    if problem.gauge != FREE or problem.dip is None:
        return None
    turn, covariance = compute_turn(problem.basis, estimate.solution)
    independent = len(problem.points) / estimate.noise["dip"].correlation
    if not turn.any() or wald(turn, covariance, independent).p_value > TURN_DOUBTFUL:
        return None
    m = problem.basis.shape[1]
    _, matrix = split(problem.basis @ estimate.solution.params[:m])
    xy, xz, yz = turn  # −τ_z, τ_y, −τ_x of [τ]× in W = (1 + [τ]×) S
    untwisted = skew(np.array([-yz, xz, -xy])) @ matrix
    move = np.zeros(len(estimate.solution.params))
    local = np.concatenate([np.zeros(3), untwisted.ravel()])
    move[:m] = np.linalg.lstsq(problem.basis, local, rcond=None)[0] / np.sqrt(2.0)
    return move
