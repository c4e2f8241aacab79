"""`fit_thermal`: bias and matrix over temperature, from turned stations or a known field."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError, CoverageError
from agonic.health import Finding, figure, sort_findings
from agonic.provenance import Provenance
from agonic.reference import Reference
from agonic.samples import Samples
from agonic.thermal.fit import each_temperature, evidence
from agonic.thermal.fit.calibration import make_chamber_calibration
from agonic.thermal.fit.evidence import compute_spread
from agonic.thermal.fit.known_field import fit_known_field
from agonic.thermal.fit.problem import ChamberReadings, Settings, select_readings
from agonic.thermal.fit.readings import (
    Facts,
    collect_facts,
    find_still_thermometers,
    judge_recordings,
    sum_readings,
)
from agonic.thermal.fit.result import Anomaly, Fixture, Positions, ThermalFit
from agonic.thermal.fit.solve import Solution, solve
from agonic.thermal.fit.station_faults import judge_faults
from agonic.thermal.maths.binned_sums import Binned
from agonic.thermal.maths.estimate import UNREST
from agonic.thermal.maths.fault_terms import PLAUSIBLE
from agonic.thermal.maths.stations import measure_turns

METHOD = ("nikolaev-2023", "huber-1981")
OF_TURNS, OF_CHANGES, OF_DRIFT = "mackay-1992", "patterson-thompson-1971", "hoeting-1999"
FEWEST_STATIONS = 3
"""With one or two, whatever their turns, the nine numbers are not determined."""
_FINEST_DEG = 0.001
_HARDLY_SHOWN = 2.0
"""Times the standard error: what is worth a word."""


def fit_thermal(
    samples: Samples, reference: Reference | None = None, **settings: Any
) -> ThermalFit:
    """Bias and matrix as polynomials in the sensor's temperature.

        field = W(T) (raw − b(T)),   W(T) = k0 + k1 x + k2 x² + …,   x = (T − centre)/half range

    From recordings at turned stations in a chamber whose field is constant: anomalous readings are
    dropped; the means of each station are taken per temperature, cooling and heating apart; all
    stations and temperatures are solved at once, weighted. The reference is the magnitude of the
    field, and where the orientations of the stations are known, its direction too: one unknown
    vector in the chamber, the orientations to be estimated with a prior on their errors. With a
    vector for each reading (`Reference.vector` in the axes m or b, as in a coil) no stations are
    needed.

    Parameters
    ----------
    samples : with `temperature` and `station`; with `time` for the term in dT/dt and for a drift
        of the chamber's field.
    reference : the chamber's magnitude. Without it the mean gain at the centre of the range is set
        to 1. Or the field vector at each reading.
    settings : those that follow, and no others.
    bin_width_C : of the temperature bins, 0.5 by default.
    degree : of the polynomials, 3 by default, or "auto": the smallest after which the variance of
        the residuals stops falling markedly.
    stations : "unknown" (the magnitude alone), "known" for the standard twelve by number, a
        rotation from the box to the chamber for each number, or "found": a station has one
        direction of the field at all temperatures, which the readings show.
    fixture_sd_deg : how well the stations stand as described, 1° by default; the readings say
        whether it is better or worse, and that is used, unless `fixture_known`.
    rate : a term in dT/dt of the bias: True, False, or "auto" where the readings ask for it.
    drift : a steady change of the chamber's field: True, False, or "auto": averaged over being
        there and not, as the readings make it likely; so is one of the sensor's bias, unless False.
    soft_iron_sd : prior on what makes W differ from a multiple of the identity; it only matters
        where stations are missing.
    faults : look for what was not the same at all stations: an odd one, a step of the bias. What
        was found is named, and the fit is that beside it.
    unseen_change_sd : by how much of itself the field may have changed from each station to the
        next. The magnitude alone hardly shows that; its standard errors allow for it, and for what
        it does show. The status says what 0.3 % would do unseen.

    Returns a `ThermalFit`; `fit.ok` and `fit.status` say whether to use it. Raises `LogError`
    without temperature or station, `CoverageError` where nothing can be determined.

    Source: Nikolaev et al. 2023, sections 2 and 3; the joint estimate and the known orientations
    are maximum likelihood with Huber's (1981) covariance, the width of the prior of the fixture
    MacKay's (1992); slow changes of the chamber's field are a Gaussian process found by restricted
    likelihood (Patterson & Thompson 1971), a steady one is averaged over being there or not
    (Hoeting et al. 1999).

    Examples
    --------
    >>> from agonic.thermal.maths.stations import list_standard_rotations
    >>> t = np.concatenate([np.linspace(50.0, -10.0, 300), np.linspace(-10.0, 50.0, 300)])
    >>> drifting = np.outer((t - 20.0) / 30.0, [2000.0, -500.0, 800.0])
    >>> seen = np.swapaxes(list_standard_rotations(), 1, 2) @ [20_000.0, 0.0, 43_000.0]
    >>> noise = 100.0 * np.random.default_rng(0).normal(size=(12, 600, 3))
    >>> samples = Samples(field=(seen[:, None] + drifting + noise).reshape(-1, 3),
    ...                   temperature=np.tile(t, 12), station=np.repeat(np.arange(1, 13), 600))
    >>> fit = fit_thermal(samples, Reference.constant(47_423.6), degree=1, stations="known")
    >>> fit.calibration.bias[1].round(-2).tolist(), fit.verdict
    ([2000.0, -500.0, 800.0], 'good')
    """
    chosen = Settings(**settings)
    if reference is not None and reference.kind == "vector" and len(reference.values) > 1:
        return fit_known_field(samples, reference, chosen)
    sums, findings = sum_readings(samples, chosen.bin_width_C)
    return fit_binned(sums, collect_facts(samples), reference, found=findings, **settings)


def fit_binned(
    sums: Binned,
    facts: Facts,
    reference: Reference | None = None,
    *,
    found: tuple[Finding, ...] = (),
    **settings: Any,
) -> ThermalFit:
    """`fit_thermal` from sums that were added up piece by piece.

    Parameters
    ----------
    sums : `Binned`, of all stations. facts : whose readings they are. found : what the reader came
        across. The others as in `fit_thermal`; `bin_width_C` is that of the sums.
    """
    chosen = Settings(**{**settings, "bin_width_C": sums.width_C})
    if not sums.stations:
        raise AgonicError("no readings were added; add the recordings of the stations first")
    if len(sums.stations) < FEWEST_STATIONS:
        raise CoverageError(
            f"{len(sums.stations)} of twelve stations cannot determine nine numbers",
            turns="record the others",
        )
    left_out = find_still_thermometers(sums)
    readings = select_readings(sums, left_out, reference, facts.unit)
    result = solve(readings, chosen)
    largest = max(seen.largest for seen in sums.stations.values())
    provenance = Provenance(
        inputs=facts.inputs,
        settings=_record_settings(chosen, reference, result, readings),
        method=_list_methods(result),
    )
    calibration, unwatched = (
        make_chamber_calibration(each, result.problem, readings, facts, largest, provenance)
        for each in (result.estimate, result.unwatched)
    )
    fit = _assemble(calibration, result, readings, sums)
    findings = [
        *found,
        *judge_recordings(sums, left_out, chosen),
        *evidence.judge_fit(
            fit,
            readings,
            sums,
            result.orientations,
            fixture_sd_deg=float(np.degrees(result.problem.fixture_sd)),
            faulty=bool(result.faults.found),
        ),
        *judge_faults(result, readings),
    ]
    fit = replace(fit, findings=sort_findings(findings))
    if fit.verdict == "refused":
        return fit
    return replace(fit, remarks=_make_remarks(fit, unwatched, reference))


def _record_settings(
    settings: Settings, reference: Reference | None, result: Solution, readings: ChamberReadings
) -> dict[str, Any]:
    """What was chosen, for the provenance."""
    words = "none: mean gain at the centre of the range set to 1"
    if reference is not None:
        words = f"{readings.scale.magnitude:g} nT ({reference.source})"
    kind = _name_kind(result)
    return {"fit": "thermal", "reference_kind": kind, "reference": words, **settings.recorded()}


def _list_methods(result: Solution) -> tuple[str, ...]:
    """The sources of what was used."""
    of = result.problem
    used = {
        OF_TURNS: of.rot_nb is not None and not of.fixture_known,
        OF_CHANGES: of.course is not None,
        OF_DRIFT: of.pace is not None and not of.drifting,
    }
    return (*METHOD, *(key for key, there in used.items() if there))


def _assemble(
    calibration: Thermal, result: Solution, readings: ChamberReadings, sums: Binned
) -> ThermalFit:
    """The fit with everything but its findings."""
    estimate, scale = result.estimate, readings.scale
    gain, unit = _find_gain(result), scale.magnitude or calibration.magnitude or scale.size
    factor = scale.size if scale.magnitude is None else scale.magnitude
    divisor = gain if scale.magnitude is None else 1.0
    bins = each_temperature.tabulate_bins(result.separate, readings, factor / scale.size, divisor)
    drift = estimate.drift * unit if result.drifts else None
    ageing = estimate.ageing * scale.size if result.aged else None
    return ThermalFit(
        calibration=calibration,
        reference_kind=_name_kind(result),
        n=int(readings.cells.n.sum()),
        residuals=estimate.residuals * scale.size,
        weights=estimate.weights,
        temperature=readings.cells.temperature,
        station=readings.cells.number,
        heating=readings.cells.heating,
        noise=float(np.sqrt(np.trace(readings.noise) / 3)),
        excess=float(np.sqrt(estimate.excess)) * scale.size,
        correlation=estimate.correlation,
        condition=estimate.condition,
        iterations=estimate.iterations,
        converged=estimate.converged,
        bins=bins,
        variances=each_temperature.compute_variances(result.separate, readings),
        hysteresis=each_temperature.compute_hysteresis(bins),
        spread=compute_spread(readings.cells, calibration),
        fixture=_describe_fixture(result, readings, unit),
        positions=_describe_positions(result, readings),
        drift=drift,
        drift_sd=None if drift is None else np.sqrt(np.diag(estimate.drift_covariance)) * unit,
        ageing=ageing,
        ageing_sd=None
        if ageing is None
        else np.sqrt(np.diag(estimate.ageing_covariance)) * scale.size,
        field_sd=estimate.slow.sd * unit if estimate.slow.gain > UNREST else 0.0,
        anomalies=_collect_anomalies(sums),
        tests=result.tests,
    )


def _find_gain(result: Solution) -> float:
    p = result.problem.degree + 1
    return float(result.estimate.coefficients[[3 * p, 4 * p, 5 * p]].mean())


def _name_kind(result: Solution) -> str:
    """What taught the fit."""
    if result.problem.rot_nb is None:
        return "magnitude"
    return "turns" if result.problem.turns_known else "positions"


def _describe_positions(result: Solution, readings: ChamberReadings) -> Positions | None:
    estimate = result.estimate
    if _name_kind(result) != "positions" or estimate.poses is None:
        return None
    assert estimate.directions_covariance is not None
    seen = estimate.poses.directions
    angles, sds = np.degrees(measure_turns(seen, estimate.directions_covariance)).tolist()
    direction, turn, sd = (
        dict(zip(readings.numbers, of, strict=True)) for of in (seen, angles, sds)
    )
    return Positions(direction=direction, turn_deg=turn, turn_sd_deg=sd)


def _describe_fixture(result: Solution, readings: ChamberReadings, unit: float) -> Fixture | None:
    estimate = result.estimate
    if estimate.poses is None or estimate.turned is None or not result.problem.turns_known:
        return None
    angles = np.degrees(estimate.turned).tolist()
    return Fixture(
        mounting=Rotation.from_matrix(estimate.poses.mount),
        field_n=estimate.poses.field * unit,
        turned_deg=dict(zip(readings.numbers, angles, strict=True)),
        sd_deg=float(np.degrees(estimate.fixture_sd)),
    )


def _collect_anomalies(sums: Binned) -> tuple[Anomaly, ...]:
    """Readings left out by station."""
    by: dict[int, list[Array]] = {}
    for left in sums.anomalies:
        by.setdefault(left.station, []).append(left.times)
    return tuple(
        Anomaly(station=number, count=sum(map(len, times)), times=np.concatenate(times))
        for number, times in sorted(by.items())
    )


HARDLY_SHOWN = (
    "a field that changed by {share} between stations would hardly show by the magnitude alone, "
    "and put the bias off by {doubt}: record the first stations again at the end, or describe the "
    "turns",
    "a bias that changed by {share} of the field between stations would hardly show with turns "
    "known no better, and put the bias off by {doubt}: record the first stations again at the end",
)
"""What the readings hardly show: by the magnitude alone, and with described turns."""


def _make_remarks(
    fit: ThermalFit, unwatched: Thermal, reference: Reference | None
) -> tuple[str, ...]:
    """How good the result is, in words; `unwatched` is as sure as it is where nobody saw that the
    field was the same at all stations.
    """
    calibration = fit.calibration
    low, high = calibration.range_C
    bias, matrix = evidence.find_worst_sd(calibration)
    said = [
        f"standard error: bias {figure(bias)} {calibration.unit_in}, matrix {figure(matrix)} "
        f"{calibration.unit_out} of field (at the worst temperature from {low:.0f} to "
        f"{high:.0f} °C)",
    ]
    doubt, _ = evidence.find_worst_sd(unwatched)
    if doubt > _HARDLY_SHOWN * bias:
        said.append(
            HARDLY_SHOWN[fit.fixture is not None].format(
                share=f"{100 * PLAUSIBLE:g} %", doubt=f"{figure(doubt)} {calibration.unit_in}"
            )
        )
    if fit.fixture is not None:
        sd_deg = fit.fixture.sd_deg
        words = f"to {figure(sd_deg)}°" if sd_deg > _FINEST_DEG else f"to {_FINEST_DEG}° or better"
        said.append(f"the stations stood as described {words}")
    if fit.positions is not None:
        known = f"to {figure(max(fit.positions.turn_sd_deg.values()))}°"
        said.append(f"the turns of the stations were found from the readings, {known}")
    if calibration.rate is not None:
        said += [test.sentence for test in fit.tests if test.larger == "rate"]
    if reference is None and calibration.magnitude is not None:
        said.append(
            "no reference magnitude was given, so the mean gain at "
            f"{calibration.centre_C:.0f} °C is set to 1 (magnitude "
            f"{figure(calibration.magnitude, 5)} {calibration.unit_in})"
        )
    return tuple(said)
