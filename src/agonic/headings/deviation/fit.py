"""`fit_deviation`: the deviation card from compass headings and what they should have been."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri

from agonic.arrays import Array, Mask
from agonic.calibration.deviation import PARAMETERS, Deviation, format_east_west, name_heading
from agonic.errors import AgonicError
from agonic.fit import Estimated
from agonic.headings.deviation.evidence import Evidence, examine
from agonic.headings.deviation.readings import SwingReadings, select_complete
from agonic.headings.maths import swing_plan
from agonic.headings.maths.reference_drift import (
    MOST,
    ReferenceDrift,
    add_drift,
    average_over_drift,
)
from agonic.health import Finding, figure
from agonic.maths.rotations import deviation as kernel
from agonic.maths.rotations.angles import wrap_deg
from agonic.provenance import Input, Provenance
from agonic.readable import Shown

CITATIONS = ("nga-2004", "huber-1981", "beaton-tukey-1974")


@dataclass(frozen=True, kw_only=True, eq=False)
class DeviationFit(Estimated):
    """A deviation card and what it rests on.

    `compass_deg`, `deviation_deg`, `residuals_deg` and `weights` (n,) are the readings that were
    used, in their order: what the compass read, reference less compass, that less the curve, and
    what the robust loss left of each. `classical` holds A to E by the eight-heading formulas where
    all eight were steered; `noise_deg` is the standard deviation of one reading, NaN where there
    are as many terms as readings; `correlation` is how many successive readings count as one, and
    `condition` that of the scaled information matrix. `covariance` (9, 9) is that of A to E in
    degrees, then of the heel terms in degrees per degree; `sd` is 0 for terms that were not fitted.
    """

    calibration: Deviation
    classical: Annotated[Mapping[str, float] | None, Shown()]
    compass_deg: Array
    deviation_deg: Array
    residuals_deg: Array
    weights: Array
    noise_deg: Annotated[float, Shown()]
    correlation: Annotated[float, Shown()]
    condition: Annotated[float, Shown()]
    findings: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def sd(self) -> Array:
        """Standard errors of the same, widened by Student's t where few readings tell the noise."""
        sd = self.calibration.sd
        assert sd is not None, "a fitted card has a covariance"
        return sd

    @property
    def n(self) -> Annotated[int, Shown()]:
        """How many readings were used."""
        return len(self.compass_deg)


def fit_deviation(
    compass_deg: ArrayLike,
    reference_deg: ArrayLike,
    *,
    heel: ArrayLike | None = None,
    declination_deg: ArrayLike | None = None,
    terms: str = "ABCDE",
    robust: bool = True,
    noise_deg: float | None = None,
    drift_deg: float | None = None,
    estimated: bool = False,
    power_state: str = "",
    current_A: float | None = None,
    sensor: str = "compass",
    source: Input | None = None,
) -> DeviationFit:
    """The coefficients A to E of a compass's deviation, and its heel terms.

    Least squares on δ = A + B sin ψ + C cos ψ + D sin 2ψ + E cos 2ψ + heel terms, where ψ is the
    compass heading and δ the magnetic heading less ψ.

    Parameters
    ----------
    compass_deg : (n,) what the compass read, in the order it was read.
    reference_deg : (n,) magnetic heading of the vehicle at the same moments; true heading where
        `declination_deg` (n,), or one, is given.
    heel : (n,) roll, or (n, 2) roll and pitch, degrees: adds roll × cos ψ, roll × sin ψ and the
        same of pitch, where it is not zero throughout. `None` for a level swing.
    terms : the level terms to fit; the others are fixed at zero. Never chosen for you.
    robust : down-weight outliers with Tukey's loss where one stands out of many readings.
    noise_deg : standard deviation of one reading where it is known; else the residuals tell.
    drift_deg : standard deviation of what the reference drifts from the first reading to the last
        where it is known, 0 for a surveyed line; else a drift is counted with as the readings
        allow.
    estimated : whether the reference is an estimate that follows a compass, as an autopilot's is.
    power_state, current_A : what was switched on and the current it drew; the card belongs to it.
    sensor, source : whose headings, and the file they came from.

    Returns a `DeviationFit`; `fit.ok` and `fit.status` say whether to use it, and a refusal names
    the headings to add. Raises `AgonicError` where the columns do not fit together and
    `CoverageError` where there is no reading at all.

    Source: Handbook of Magnetic Compass Adjustment (NGA 2004), chapters III and V; covariance by
    Huber (1981).

    Examples
    --------
    >>> compass = np.arange(0, 360, 45.0)
    >>> deviation = np.array([10.5, 20.0, 11.5, -1.2, -5.5, -8.0, -12.5, -6.8])
    >>> fit = fit_deviation(compass, compass + deviation, power_state="engine on")
    >>> fit.calibration.coefficients.round(3).tolist(), fit.classical["B"]
    ([1.0, 11.94, 7.96, 5.0, 1.5], 12.0)
    """
    level = parse_terms(terms)
    readings = select_complete(compass_deg, reference_deg, heel, declination_deg)
    chosen = np.concatenate([level, np.repeat(readings.heeled, 2)])
    rows = readings.rows[:, chosen]
    # else an outlier cannot be told from the rest by its weight
    weighted = robust and len(rows) >= 4 * rows.shape[1]
    solved, known = _solve(readings, rows, weighted, noise_deg)
    drift = _allow_drift(rows, solved, weighted, noise_deg and known, drift_deg)
    solved = solved._replace(covariance=drift.covariance)
    settings = {
        "terms": terms,
        "robust": robust,
        "noise_deg": noise_deg,
        "drift_deg": drift_deg,
        "declination_deg": None if declination_deg is None else readings.declination,
        "heel": ("none", "roll", "roll and pitch")[readings.tilt.shape[1]],
    }
    inputs = (source or Input.of_array(sensor, readings.columns),)
    card = replace(
        _make_card(readings, solved, chosen, known, stated=bool(noise_deg)),
        terms=terms,
        power_state=power_state,
        current_A=current_A,
        sensor=sensor,
        provenance=Provenance(inputs=inputs, settings=settings, method=CITATIONS),
    )
    seen = (readings, solved, card, chosen, noise_deg, weighted, drift.probability, estimated)
    findings = examine(Evidence(*seen))
    refused = any(finding.severity == "refuse" for finding in findings)
    at_eight = kernel.average_on_rose(readings.compass, wrap_deg(readings.difference))
    classical = () if at_eight is None else kernel.solve_eight_headings(at_eight).tolist()
    return DeviationFit(
        calibration=card,
        classical=dict(zip(kernel.LEVEL, classical, strict=True)) if classical else None,
        compass_deg=readings.compass,
        deviation_deg=wrap_deg(solved.residuals + rows @ solved.params),
        residuals_deg=solved.residuals,
        weights=solved.weights,
        noise_deg=np.nan if card.noise_deg is None else card.noise_deg,
        correlation=solved.correlation,
        condition=solved.condition,
        findings=findings,
        remarks=() if refused else _remarks(card, readings.compass, drift_deg),
    )


def parse_terms(terms: str) -> Mask:
    """Which of A to E were asked for, (5,)."""
    known = "".join(kernel.LEVEL)
    if not terms or any(term not in known for term in terms) or len(set(terms)) < len(terms):
        raise AgonicError(f"terms {terms!r} are not known; use some of {known}, each once")
    if "A" not in terms:
        raise AgonicError(f"terms {terms!r} lack A: a compass is never mounted exactly; add A")
    return np.array([term in terms for term in known])


def _solve(
    readings: SwingReadings, rows: Array, robust: bool, noise_deg: float | None
) -> tuple[kernel.DeviationSolution, float | None]:
    """The solution, and the noise of a reading where it is known: what was stated, or at least the
    rounding; `None` where the residuals tell it, as where they exceed it.

    Where as many terms as readings leave no residuals, a noise of 1° is taken for unknown.
    """
    if noise_deg is not None and not noise_deg > 0.0:
        raise AgonicError(
            f"noise_deg is {noise_deg}; give the standard deviation of a reading, > 0"
        )
    difference, freedom = readings.difference, len(rows) - rows.shape[1]
    if freedom < 1:
        assumed = noise_deg or 1.0
        return kernel.solve(rows, difference, robust=robust, noise_deg=assumed), noise_deg
    solved = kernel.solve(rows, difference, robust=robust)
    known = readings.rounding_deg if noise_deg is None else noise_deg
    # the scatter over a stated noise that chance exceeds once in a hundred swings
    within = 1.0 if noise_deg is None else float(np.sqrt(chdtri(freedom, 0.01) / freedom))
    if solved.noise > known * within:
        return solved, None
    return kernel.solve(rows, difference, robust=robust, noise_deg=known), known


def _make_card(
    readings: SwingReadings,
    solved: kernel.DeviationSolution,
    chosen: Mask,
    known: float | None,
    *,
    stated: bool,
) -> Deviation:
    """The card of a solution, in the order of `PARAMETERS`, zero where a term was not fitted;
    `known` noise of a reading, and whether it was `stated`."""
    params, covariance = np.zeros(len(PARAMETERS)), np.zeros((len(PARAMETERS),) * 2)
    params[chosen], covariance[np.ix_(chosen, chosen)] = solved.params, solved.covariance
    left = len(solved.residuals) > len(solved.params)  # else nothing shows the noise of a reading
    # of the noise: readings that count, less terms
    freedom = float((solved.weights > 0).sum()) / solved.correlation - len(solved.params)
    tilt = np.abs(readings.tilt).max(axis=0).tolist()
    visited = swing_plan.find_visited(readings.compass)
    return Deviation(
        coefficients=params[:5],
        heel=params[5:] if chosen[5:].any() else None,
        covariance=covariance,
        noise_deg=known or (solved.noise if left else None),
        freedom=None if stated and known else max(freedom, 1.0),
        largest_gap_deg=swing_plan.compute_largest_gap_deg(visited),
        largest_heel_deg=(*tilt, 0.0)[:2] if tilt else None,
    )


def _remarks(card: Deviation, compass_deg: Array, drift_deg: float | None) -> tuple[str, ...]:
    """How large the deviation is, how well the card is known, and what would show a drift that was
    not stated, where few readings went round once."""
    circle = np.arange(0.0, 360.0)
    curve, sd = card.at(circle), float(card.sd_at(circle).max())
    worst = int(np.abs(curve).argmax())
    said = (
        f"the deviation is largest, {format_east_west(float(curve[worst]))}, at compass "
        f"{name_heading(float(circle[worst]))}",
        f"standard error of a level heading corrected with this card: {figure(sd)}°, at the worst "
        "heading",
    )
    returned = abs(float(wrap_deg(compass_deg[-1] - compass_deg[0]))) <= swing_plan.CELL_DEG
    if returned or drift_deg is not None or len(compass_deg) > MOST:
        return said
    return (
        *said,
        "a reference that drifted meanwhile looks like A to E: steer the first heading again at "
        "the end, or state its drift (drift_deg)",
    )


def _allow_drift(
    rows: Array,
    solved: kernel.DeviationSolution,
    weighted: bool,
    noise_deg: float | None,
    drift_deg: float | None,
) -> ReferenceDrift:
    """With what a drift of the reference adds: as much as is stated, or as may be."""
    used = solved.weights > 0 if weighted else np.ones(len(rows), dtype=bool)
    if drift_deg is None:
        return average_over_drift(rows[used], solved.residuals[used], solved.covariance, noise_deg)
    if not drift_deg >= 0.0:
        raise AgonicError(f"drift_deg is {drift_deg}; give the drift over the swing, 0 for none")
    return ReferenceDrift(add_drift(rows[used], solved.covariance, drift_deg), 0.0)
