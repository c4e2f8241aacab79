"""`compare`: by how much two calibrations differ, in field and heading, and where it matters;
`judge`: a calibration that was made earlier, by what samples say of it now."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import chdtrc

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration, select_columns
from agonic.calibration.interference import Interference
from agonic.calibration.sources import stack_inputs
from agonic.calibration.steps import compose, compute_composed_covariance
from agonic.calibration.thermal import Thermal
from agonic.ellipsoid import evaluate, open_ellipsoid_parts
from agonic.errors import AgonicError, FrameError, UnitError
from agonic.fit import Fit
from agonic.maths.equation.affine import FREE, model_basis
from agonic.maths.equation.coverage import (
    field_covariance,
    heading_jacobian_deg,
    icosphere,
    level_directions,
)
from agonic.maths.rotations.angles import wrap_deg
from agonic.maths.rotations.tilt import two_axis_deg
from agonic.readable import Readable
from agonic.recording.calibrated import Calibrated, conclude
from agonic.recording.choice.fits import Choice
from agonic.reference import Reference
from agonic.samples import Samples
from agonic.verification import verify

MATTERS_DEG = 0.5
"""A heading that differs by less is of no matter to a vehicle."""
SIGNIFICANT = 0.01
"""How often chance makes headings differ as much, where that is taken for a difference."""
_TERMS = 5  # of a heading's error: constant, once and twice around


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison(Readable):
    """By how much the second of two calibrations differs from the first.

    `field` (80, 3) is the difference of the corrected field in each direction of the sphere, in
    the unit of the field, and `field_sd` (80,) its standard error along its largest axis;
    `directions` (80, 3) are those. `heading_deg` (36,) is the difference of the heading of a level
    vehicle at even `headings_deg`, `heading_sd_deg` (36,) its standard error, where both
    calibrations state one, as if their errors were independent; `p_value` is how often chance alone
    makes headings differ as much. `inclination_deg` is the dip.
    """

    directions: Array
    field: Array
    field_sd: Array | None
    headings_deg: Array
    heading_deg: Array
    heading_sd_deg: Array | None
    inclination_deg: float
    unit: str
    p_value: float = 0.0

    @property
    def heading_rms_deg(self) -> float:
        """The difference of the headings, rms over all."""
        return float(np.sqrt(np.mean(self.heading_deg**2)))

    @property
    def field_rms(self) -> float:
        """The difference of the field, rms over all directions."""
        return float(np.sqrt(np.mean(np.sum(self.field**2, axis=1))))

    @property
    def sure(self) -> bool:
        """Whether the headings differ by more than chance."""
        return self.p_value < SIGNIFICANT and bool(np.any(self.heading_deg != 0.0))

    @property
    def matters(self) -> bool:
        """Whether a heading differs by more than chance and by more than half a degree."""
        return self.sure and bool(np.any(np.abs(self.heading_deg) > MATTERS_DEG))

    @property
    def status(self) -> str:
        """What the comparison says, in sentences."""
        worst = int(np.argmax(np.abs(self.heading_deg)))
        far = int(np.argmax(np.linalg.norm(self.field, axis=1)))
        sd = "" if self.heading_sd_deg is None else f" ± {self.heading_sd_deg[worst]:.2g}°"
        x, y, z = self.directions[far]
        told = {
            True: "The difference matters: it is more than chance and more than half a degree.",
            False: "The difference does not matter for headings."
            if self.sure
            else "The difference is within what chance explains.",
        }[self.matters]
        size = float(np.linalg.norm(self.field[far]))
        return (
            f"{told} Headings differ by {self.heading_rms_deg:.2g}° rms, most at "
            f"{self.headings_deg[worst]:.0f}°: {self.heading_deg[worst]:+.2g}°{sd} (level, dip "
            f"{self.inclination_deg:.0f}°). The field differs by {self.field_rms:.3g} {self.unit} "
            f"rms, most towards ({x:.1f}, {y:.1f}, {z:.1f}): {size:.3g} {self.unit}."
        )

    def _say(self) -> list[str]:
        return ["Comparison", *self.status.replace(". ", ".\n").split("\n")]


def compare(
    first: Affine | Thermal,
    second: Affine | Thermal,
    *,
    inclination_deg: float = 60.0,
    magnitude: float | None = None,
    temperature_C: float | None = None,
) -> Comparison:
    """By how much two calibrations of a sensor differ in field and heading, and where.

    The readings that the first turns into a field of the magnitude go through both. Errors of the
    two are taken to be independent, so that standard errors add in squares.

    Parameters
    ----------
    first, second : calibrations, or fits, of readings in one unit and frame.
    inclination_deg : dip of the field at which headings are compared.
    magnitude : of the field; default: that of the first, else 50 000.
    temperature_C : at which temperature calibrations are taken.

    Raises `UnitError` and `FrameError` where the two do not meet.

    >>> one = Affine(bias=[0, 0, 0], matrix=np.eye(3))
    >>> found = compare(one, Affine(bias=[0, 500.0, 0], matrix=np.eye(3)))
    >>> found.matters, round(found.heading_rms_deg, 2), round(found.field_rms)
    (True, 0.81, 500)
    """
    a, b = (_as_affine(one, temperature_C) for one in (first, second))
    if (a.unit_in, a.unit_out) != (b.unit_in, b.unit_out):
        raise UnitError(
            f"one is from {a.unit_in} to {a.unit_out} and the other from {b.unit_in} to "
            f"{b.unit_out}; fit them in the same unit"
        )
    if (a.frame_in, a.frame_out) != (b.frame_in, b.frame_out):
        raise FrameError("the calibrations are in other axes", left=a.frame_out, right=b.frame_out)
    size = magnitude or a.magnitude or (50_000.0 if a.unit_out == "nT" else 1.0)
    directions, (level, _) = icosphere()[0], level_directions(inclination_deg)
    turned = _correct_as(a, b, size * level)
    heading, before = (two_axis_deg(f[:, 0], f[:, 1]) for f in (turned, level))
    difference = wrap_deg(heading - before)
    by_field, spread = np.zeros((80, 3, 3)), np.zeros((36, 36))  # nT², degrees²
    stated = a.covariance is not None and b.covariance is not None
    for one in (a, b) if stated else ():
        assert one.covariance is not None
        at = (one.bias, one.matrix, one.covariance, one.gauge)
        by_field += field_covariance(directions, size, *at)
        jacobian = heading_jacobian_deg(inclination_deg, size, one.matrix, one.gauge)
        m = jacobian.shape[-1]
        spread += jacobian @ one.covariance[:m, :m] @ jacobian.T
    return Comparison(
        directions=directions,
        field=_correct_as(a, b, size * directions) - size * directions,
        field_sd=np.sqrt(np.linalg.eigvalsh(by_field)[:, -1]) if stated else None,
        headings_deg=before % 360.0,
        heading_deg=difference,
        heading_sd_deg=np.sqrt(np.diag(spread)) if stated else None,
        inclination_deg=inclination_deg,
        unit=a.unit_out,
        p_value=_find_chance(difference, spread) if stated else 0.0,
    )


def _as_affine(given: object, temperature_C: float | None) -> Affine:
    """The affine calibration that was meant."""
    one = getattr(given, "calibration", given)
    if isinstance(one, Thermal):
        return one.at(sum(one.range_C) / 2 if temperature_C is None else temperature_C)
    if isinstance(one, Affine) and not one.needs:
        return one
    needs = f" that needs {', '.join(one.needs)}" if isinstance(one, Affine) else ""
    raise AgonicError(
        f"compare takes two Affine or Thermal calibrations and was given a {type(one).__name__}"
        f"{needs}; take it at a state of what it needs (calibration.at), or verify both on one log"
    )


def _correct_as(a: Affine, b: Affine, field: Array) -> Array:
    """What the second makes of the readings that the first corrects to a field (n, 3)."""
    raw = field @ np.linalg.inv(a.matrix).T + a.bias
    return np.asarray((raw - b.bias) @ b.matrix.T)


def _find_chance(difference: Array, spread: Array) -> float:
    """How often chance makes a difference (36,) of covariance (36, 36), χ² of its five terms."""
    values, vectors = np.linalg.eigh(spread)
    values, along = values[-_TERMS:], vectors[:, -_TERMS:].T @ difference
    known = values > 1e-12 * values[-1]
    if not known.any():
        return 0.0
    return float(chdtrc(int(known.sum()), float(np.sum(along[known] ** 2 / values[known]))))


def judge(
    calibration: Calibration,
    samples: Samples,
    reference: Reference | None = None,
    **settings: Any,
) -> Calibrated:
    """A calibration made earlier, with the evidence and checks that these samples give."""
    if isinstance(calibration, Alignment):
        raise AgonicError(
            "an alignment turns axes and changes no size, so a log cannot check it: report "
            "the chain of a calibration and this alignment, or look at its session (agonic fit)"
        )
    calibration = _join_steps(calibration)
    method = str(calibration.provenance.settings.get("fit", "ellipsoid"))
    settings["by_magnitude"] = method == "ellipsoid"
    fit = _evidence(calibration, samples, reference, settings)
    known = reference if calibration.unit_out == "nT" else None
    why = "the calibration was made before"
    given = Choice(samples, reference, fit, method, why, open_ellipsoid_parts)
    return conclude(given, verify(calibration, samples, known))


def _join_steps(calibration: Calibration) -> Affine:
    """A calibration in one step or in several, as one, with its covariance. Raises `AgonicError`
    where a step depends on temperature or is a network."""
    if isinstance(calibration, Affine):
        return calibration
    one, covariance = compose(calibration), compute_composed_covariance(calibration)
    if covariance is None:
        return one
    to_free = np.linalg.inv(model_basis("full", FREE))
    return replace(one, covariance=to_free @ covariance @ to_free.T)


def _evidence(
    calibration: Affine, samples: Samples, reference: Reference | None, settings: dict[str, Any]
) -> Fit:
    """What the samples say of a calibration; sources on board are taken at their mean."""
    if not isinstance(calibration, Interference):
        return evaluate(calibration, samples, reference, **settings)
    mean = stack_inputs(calibration.sources, None, select_columns(calibration, samples)).mean(
        axis=0
    )
    cleaned = calibration.cleaned(samples.field, **select_columns(calibration, samples))
    steady = samples.with_columns(field=cleaned + calibration.coefficients @ mean)
    fit = evaluate(calibration.at(mean), steady, reference, **settings)
    return replace(fit, calibration=calibration)
