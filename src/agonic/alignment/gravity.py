"""`fit_gravity`: the rotation from a magnetometer to an accelerometer, by gravity.

Gravity as a reference: the angle between the field and the vertical is the same everywhere.

At rest an accelerometer reads the vertical. With d the direction of down in its axes, m the field
in the magnetometer's and R from these to those,

    d · R (m − b) = Z

in every orientation, Z the vertical intensity of the place: vectors in two frames of which one
component is known. Z follows from the orientations alone; b, a bias that the
magnetometer still has, may be sought as well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.alignment.calibration import make_calibration, make_provenance
from agonic.alignment.explanations import find_causes
from agonic.alignment.maths.columns import average, find_rows
from agonic.alignment.maths.two_frames import (
    GROUPS,
    Measured,
    compute_turn_sd,
    invert,
    make_prior,
    solve,
)
from agonic.alignment.session.session import correct_field
from agonic.arrays import Array
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration
from agonic.calibration.chain import Chain
from agonic.errors import LogError
from agonic.health import Finding, Judged, figure
from agonic.health.finding import Fact, Limit, Told
from agonic.maths.estimation.changes.rest import find_rest
from agonic.maths.estimation.noise.student import compute_widening
from agonic.maths.rotations.right_angles import right_angles
from agonic.maths.rotations.tilt import down_from_force
from agonic.readable import Shown
from agonic.samples import Samples

VERTICAL = GROUPS["pier"].stop - 1
"""Place of Z among the unknowns of vectors in two frames."""
ASSUMED_NOISE = 1e-3
"""Share of the field by which steps are weighed; the noise itself follows from the residuals."""


class GravityEstimate(NamedTuple):
    """R (3, 3), Z, b (3,), the covariance (7, 7) of turn, Z, b, and residuals (k,)."""

    rotation: Array
    vertical: float
    bias: Array
    covariance: Array
    residuals: Array
    freedom: int


def estimate(
    down: Array, field: Array, *, bias: bool = False, gravity: Array | None = None
) -> GravityEstimate:
    """R, Z and perhaps b of k orientations, from whichever of the 24 right angles fits best.
    Parameters: down (k, 3) unit vectors, field (k, 3), the size of gravity (k,) that was read. The
    noise follows from the residuals, and is no less than the sizes of field and gravity scatter by,
    which are the same everywhere too: six orientations leave two residuals, small by chance. The
    covariance is widened by Student's t of the residuals' freedom."""
    size = float(np.linalg.norm(field, axis=1).mean())
    # of the field's attitude only down is known, and only along it is the field
    attitude, none = np.zeros((len(down), 3, 3)), np.zeros(len(down))
    attitude[:, :, 2] = down
    measured = Measured(
        field / size, np.zeros_like(field), attitude, 0 * attitude, none + ASSUMED_NOISE, none, down
    )
    prior = make_prior({"alignment", *(("bias",) if bias else ())})
    prior[VERTICAL] = 0.0
    vertical = (down @ right_angles() * field / size).sum(axis=-1)
    tried = (
        solve(measured, prior, (0.0, 0.0, float(vertical[k].mean())), right_angles()[k].T)
        # those by which Z varies least: of 120 random turns the first or second led to the best
        for k in np.argsort(vertical.var(axis=1))[:4]
    )
    found = min(tried, key=lambda one: one.chi2)
    at, rotation = found.unknowns, found.unknowns.rot_mc.T
    own, z = field / size - at.bias, float(at.offset[2])
    residuals = (down * (own @ at.rot_mc)).sum(axis=1) - z
    variance = float(residuals @ residuals) / found.freedom if found.freedom > 0 else np.nan
    # the sizes of field and gravity scatter by their own errors; those of the tilt are multiplied
    # by the horizontal field
    sizes = np.linalg.norm(own, axis=1)
    scatter = float(sizes.var(ddof=1))
    if gravity is not None:
        horizontal = max(float(np.mean(sizes**2)) - z**2, 0.0)
        scatter += horizontal * float(np.var(gravity / gravity.mean(), ddof=1))
    variance = max(variance, scatter) * compute_widening(found.freedom) ** 2
    # turns are counted about the axes of the accelerometer, and the other way round
    onto = np.zeros((7, 18))
    onto[:3, GROUPS["alignment"]] = -rotation
    onto[3, VERTICAL] = size
    onto[4:, GROUPS["bias"]] = size * np.eye(3)
    covariance = onto @ invert(found.information, prior) @ onto.T * variance / ASSUMED_NOISE**2
    return GravityEstimate(
        rotation, z * size, at.bias * size, covariance, residuals * size, found.freedom
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class GravityFit(Judged):
    """The result of `fit_gravity`.

    Parameters
    ----------
    calibration : field_b = rotation.apply(field_m), b the accelerometer's axes; after the
        magnetometer's own calibration where one was given.
    estimate : rotation, vertical intensity, bias, covariance, residuals by orientation.
    down, field : (k, 3) of the orientations at rest. gravity : (k,) its size as it was read.
    magnitude : of the field, nT or raw.
    """

    calibration: Alignment | Chain
    estimate: GravityEstimate
    down: Array
    field: Array
    gravity: Array
    magnitude: float
    findings: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def n(self) -> int:
        """How many orientations."""
        return len(self.down)

    @property
    def rot_bm(self) -> Annotated[Array, Shown(key="matrix_bm")]:
        """Magnetometer components into the accelerometer's, (3, 3)."""
        return self.estimate.rotation

    @property
    def angle_deg(self) -> Annotated[float, Shown(key="turn_deg")]:
        """By how much the two are turned against each other."""
        return float(np.degrees(Rotation.from_matrix(self.rot_bm).magnitude()))

    @property
    def sd_deg(self) -> Annotated[Array, Shown()]:
        """Standard errors (3,) of the turn about the accelerometer's axes."""
        return np.asarray(np.degrees(np.sqrt(np.diag(self.estimate.covariance)[:3])))

    @property
    def worst_sd_deg(self) -> Annotated[float, Shown()]:
        """About the axis about which it is known least."""
        return float(np.degrees(compute_turn_sd(self.estimate.covariance)))

    @property
    def inclination_deg(self) -> Annotated[float, Shown()]:
        """Of the field, down positive, by magnetometer and accelerometer alone."""
        return float(np.degrees(np.arcsin(np.clip(self.estimate.vertical / self.magnitude, -1, 1))))


METHOD = ("kok-2016",)
MIN_ORIENTATIONS = 6


def fit_gravity(
    samples: Samples, calibration: Calibration | None = None, *, bias: bool = False
) -> GravityFit:
    """The rotation from a magnetometer's axes to those of an accelerometer on the same body.

    At one place the angle between field and gravity is constant, so in every orientation at rest
    d · R (m − b) = Z, with d the direction of down that the accelerometer reads.

    Parameters
    ----------
    samples : with acceleration; the orientations at rest are those of `station`, or are found.
    calibration : of the magnetometer, applied first. bias : whether a bias is sought as well.

    Returns a `GravityFit`, refused where the orientations leave the turn open. Raises `LogError`
    without acceleration or with too few orientations at rest.

    Source: M. Kok, T. B. Schön, IEEE Sensors Journal 16(14), 2016: the constant inner product of
    field and gravity.

    >>> from agonic.alignment.simulation.laboratory import simulate_gravity
    >>> made = simulate_gravity(seed=1)
    >>> fit = fit_gravity(made.samples)
    >>> fit.n, bool(fit.worst_sd_deg < 0.1)
    (24, True)
    """
    if samples.acceleration is None:
        raise LogError(f"{samples.name} was logged without acceleration; record the accelerometer")
    field = correct_field(samples, calibration)
    down, means, gravity = _orientations(samples, samples.acceleration, field)
    need = MIN_ORIENTATIONS + (3 if bias else 0)
    if len(down) < need:
        raise LogError(
            f"{len(down)} orientations at rest were found and {need} are needed; hold the body "
            "still for two seconds on each side, and tilted between"
        )
    found = estimate(down, means, bias=bias, gravity=gravity)
    fit = GravityFit(
        calibration=make_calibration(
            found.rotation.T,
            found.rotation.T @ found.covariance[:3, :3] @ found.rotation,
            samples,
            make_provenance(
                () if samples.source is None else (samples.source,),
                {samples.name: samples.field},
                {"fit": "gravity", "bias": bias},
                *METHOD,
            ),
            frame="b",
            before=calibration,
        ),
        estimate=found,
        down=down,
        field=means,
        gravity=gravity,
        magnitude=float(np.linalg.norm(means - found.bias, axis=1).mean()),
    )
    judged = replace(fit, findings=find_causes(FACTS, EFFECTS, fit, samples.latitude_deg))
    if judged.verdict == "refused":
        return judged
    turn = (
        f"the magnetometer is misaligned by {figure(fit.angle_deg, 3)}° from the accelerometer, ± "
        f"{figure(fit.worst_sd_deg)}° about its worst axis, from {fit.n} orientations"
    )
    return replace(judged, remarks=(turn, f"the field dips by {fit.inclination_deg:.2f}°"))


def _orientations(samples: Samples, force: Array, field: Array) -> tuple[Array, Array, Array]:
    """Down (k, 3), field (k, 3) and the size of gravity (k,) of the orientations at rest."""
    if samples.station is not None:
        number = samples.station.astype(np.int64)
    elif samples.time is None:
        raise LogError("what stands still follows from times; log them, or number the stations")
    else:
        number = find_rest(samples.time, force, field)
    still = number >= 0
    if not still.any():
        return np.empty((0, 3)), np.empty((0, 3)), np.empty(0)
    rows = find_rows(number, np.unique(number[still]))
    forces = average(force, rows)
    return down_from_force(forces), average(field, rows), np.linalg.norm(forces, axis=1)


def _is_open(fit: GravityFit) -> bool:
    return not fit.worst_sd_deg <= 5.0


def _measure_scatter(fit: GravityFit) -> float:
    """By how much the vertical field scatters, percent of the field."""
    return 100 * float(np.sqrt((fit.estimate.residuals**2).mean())) / fit.magnitude


def _name_worst_axis(fit: GravityFit) -> dict[str, Any]:
    turn, axis = fit.estimate.covariance[:3, :3], "all axes"
    if np.isfinite(turn).all():
        worst = np.linalg.eigh(turn)[1][:, -1]
        axis = f"({', '.join(f'{part:.2f}' for part in worst)}) of the accelerometer's axes"
    return {"n": fit.n, "axis": axis, "value": fit.worst_sd_deg}


def _find_wrong_dip(fit: GravityFit, latitude_deg: Array | None) -> Told:
    """An axis of the wrong sign, or two exchanged, fits as well as a true turn: −M is a rotation
    where M mirrors, and the field then dips the other way. Only the hemisphere shows it: beyond 25°
    of latitude the field dips down in the north and up in the south everywhere."""
    dip = fit.inclination_deg
    north = float("nan") if latitude_deg is None else float(np.nanmedian(latitude_deg))
    known = abs(north) > 25.0
    if not (dip * north < 0 if known else (dip < 0 and fit.angle_deg >= 90.0)):
        return None
    here = f"at latitude {north:.0f}° it does not" if known else "it does so in the south only"
    unknown = "" if known else ", or log latitude_deg if this is south of the magnetic equator"
    return {
        "way": "up" if dip < 0 else "down",
        "dip": abs(dip),
        "here": here,
        "unknown": unknown,
    }


SCATTERS = (
    "the vertical field scatters by {value} % of the field between orientations",
    "calibrate the magnetometer first, and keep away from iron",
)
FACTS = (
    Fact(
        "vertical varies",
        lambda fit, _: None if _is_open(fit) else _measure_scatter(fit),
        Limit(check=2.0),  # percent
        *SCATTERS,
    ),
    Fact(
        "vertical varies",
        lambda fit, _: _measure_scatter(fit) if _is_open(fit) else None,
        Limit(refuse=2.0),
        *SCATTERS,
    ),
    Fact(
        "turn undetermined",
        lambda fit, _: _name_worst_axis(fit) if _is_open(fit) else None,
        "refuse",
        "{n} orientations do not determine the turn about {axis}",
        "hold it still also nose up, on either side and upside down, and in between",
    ),
    Fact(
        "turn loose",
        lambda fit, _: None if _is_open(fit) else _name_worst_axis(fit),
        Limit(check=1.0),  # degrees
        "the standard error of the turn about {axis} is {value}°",
        "add orientations far from the others",
    ),
    Fact(
        "uneven gravity",
        lambda fit, _: 100 * float(np.ptp(fit.gravity) / fit.gravity.mean()),
        Limit(check=3.0),  # percent
        "the accelerometer reads gravity as {value} % larger one way than another",
        "calibrate it; its bias tilts every orientation",
    ),
    Fact(
        "dips the wrong way",
        _find_wrong_dip,
        "check",
        "by this fit the field dips {way} by {dip:.0f}°, and {here}: an axis of the magnetometer "
        "or accelerometer with the wrong sign, or two exchanged, fits as well",
        "compare the axes with the data sheets{unknown}",
    ),
)
"""What is said of a fit, given the latitudes (n,) of the readings where they are known."""
EFFECTS = {"vertical varies": ("turn undetermined", "turn loose")}
