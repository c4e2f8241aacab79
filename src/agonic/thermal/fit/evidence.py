"""What a fit gives away: what is undetermined, turns that do not fit, a field that moved."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import PARAMETERS
from agonic.calibration.thermal import Thermal
from agonic.health import Finding, figure
from agonic.maths.equation import polynomial
from agonic.thermal.campaign.description import Told, name_stations
from agonic.thermal.fit.problem import ChamberReadings, find_narrow_range
from agonic.thermal.fit.result import Spread, ThermalFit
from agonic.thermal.fit.solve import Orientations
from agonic.thermal.maths.binned_sums import Binned, Cells
from agonic.units import RAW

UNKNOWN = 0.005  # of the field: a coefficient with a larger standard error is not determined
REFUSED = 0.05
ODD_DEG = 3.0
ODD_SD = 4.0  # of what the fixture is described to: one of twelve stations by chance in 0.4 %
DRIFT_DOUBTFUL = 1e-3
EXCESS_DOUBTFUL = 5e-3
ANOMALIES_DOUBTFUL = 0.05
HYSTERESIS_DOUBTFUL = 2e-3


def judge_fit(
    fit: ThermalFit,
    readings: ChamberReadings,
    sums: Binned,
    orientations: Orientations | None,
    *,
    fixture_sd_deg: float,
    faulty: bool = False,
) -> list[Finding]:
    """What the fit says: what is not determined, turns, drift, scatter, hysteresis, anomalies.

    `fixture_sd_deg` is how well the stations were said to stand, `faulty` whether the sensor was
    not the same at all stations.
    """
    found = [
        _judge_undetermined(fit, faulty),
        *find_narrow_range(readings.scale.low_C, readings.scale.high_C, "cool and heat"),
        _judge_orientations(orientations),
        _judge_odd(fit, fixture_sd_deg),
        *_judge_trends(fit),
        _judge_scatter(fit),
        _judge_hysteresis(fit),
        _judge_anomalies(fit, sums),
    ]
    return [finding for finding in found if finding is not None]


def compute_relative_sd(calibration: Thermal) -> Array:
    """Standard errors of the nine at the worst temperature of the range, over the field, (9,)."""
    assert calibration.magnitude is not None
    relative = _find_largest_sd(calibration) / calibration.mean_gain
    relative[:3] *= calibration.mean_gain**2 / calibration.magnitude
    return np.asarray(relative)


def find_worst_sd(calibration: Thermal) -> tuple[float, float]:
    """The largest standard errors over the range: of the bias, and of matrix times field."""
    if calibration.covariance is None:
        return np.nan, np.nan
    sd = _find_largest_sd(calibration)
    field = (calibration.magnitude or np.nan) / calibration.mean_gain
    return float(sd[:3].max()), float(sd[3:].max()) * field


def _find_largest_sd(calibration: Thermal) -> Array:
    return np.asarray(calibration.sd_at(np.linspace(*calibration.range_C, 25)).max(axis=0))


_SCATTER_FIRST = (
    "first find what makes the readings scatter beyond their noise (field changes): a field that "
    "changed or an error of the model, which more stations do not remove"
)


def _judge_undetermined(fit: ThermalFit, faulty: bool) -> Finding | None:
    relative = compute_relative_sd(fit.calibration)
    poor = [name for name, sd in zip(PARAMETERS, relative, strict=True) if sd > UNKNOWN]
    if not poor:
        return None
    determined = [name for name in PARAMETERS if name not in poor]
    worst = float(relative.max())
    known = f"{', '.join(poor)} {'are' if len(poor) > 1 else 'is'}"
    left = f"; {', '.join(determined)} remain{'s' if len(determined) == 1 else ''} determined"
    if not determined:
        known, left = "none of the nine numbers is determined: they are", ""
    return Finding(
        "undetermined",
        "refuse" if worst > REFUSED else "check",
        f"{known} known to {figure(100 * worst)} % of the field only{left}",
        _name_remedy(fit, faulty),
    )


def _name_remedy(fit: ThermalFit, faulty: bool) -> str:
    """What would determine the rest."""
    if faulty:
        return "first correct what was not the same at all stations; the standard error contains it"
    if _measure_scatter(fit) > EXCESS_DOUBTFUL:
        return _SCATTER_FIRST
    return "record the missing stations, or describe how the stations stood (stations='known')"


def _measure_scatter(fit: ThermalFit) -> float:
    """What the means of bins scatter by beyond their noise, over the field."""
    magnitude = fit.calibration.magnitude or np.inf
    return float(max(fit.excess * fit.calibration.mean_gain, fit.field_sd) / magnitude)


def _judge_orientations(orientations: Orientations | None) -> Finding | None:
    """Described turns that the readings contradict."""
    if orientations is None or orientations.agree:
        return None
    told = OTHER_TURNS[len(orientations.mistaken)]
    message = told.message.format(
        stations=name_stations(orientations.mistaken),
        left=figure(orientations.left_deg),
        rms=figure(orientations.rms_deg),
    )
    return Finding(told.name, "check", f"{message}; only the magnitude was used", told.action)


OTHER_TURNS = (
    Told(
        "turns",
        "the readings do not fit the described turns of the stations: {rms}° are left",
        "check how the box stood at each station",
    ),
    Told(
        "fixture",
        "{stations} did not stand as described: without it the directions fit the turns to "
        "{left}°, with it only to {rms}°",
        "check how the box stood there, and describe it or leave the station out",
    ),
    Told(
        "swapped stations",
        "{stations} look exchanged in the description: with them exchanged the directions fit the "
        "turns to {left}°, as described only to {rms}°",
        "exchange them in the description and fit again",
    ),
)
"""What is said of turns that the readings contradict, by how many stations explain it."""


def _judge_odd(fit: ThermalFit, fixture_sd_deg: float) -> Finding | None:
    """Stations that stood elsewhere than described."""
    if fit.fixture is None:
        return None
    limit = max(ODD_DEG, ODD_SD * fixture_sd_deg)
    odd = {n: angle for n, angle in fit.fixture.turned_deg.items() if angle > limit}
    if not odd:
        return None
    return Finding(
        "fixture",
        "check",
        f"{name_stations(odd)} stood up to {max(odd.values()):.1f}° from where described; that "
        "was allowed for",
        "seat the box against the stops of the fixture",
    )


def _judge_trends(fit: ThermalFit) -> list[Finding]:
    """A field, or a bias, that changed steadily."""
    c = fit.calibration
    if c.magnitude is None:
        return []
    along = " along itself" if fit.drift is not None and len(fit.drift) == 1 else ""
    found = []
    for steady, change, gain, unit in (
        (TRENDS["drift"], fit.drift, 1.0, f"{c.unit_out}{along}"),
        (TRENDS["ageing"], fit.ageing, c.mean_gain, c.unit_in),
    ):
        if change is not None:
            size = float(np.linalg.norm(change))
            large = size * gain > DRIFT_DOUBTFUL * c.magnitude
            message = steady.message.format(amount=f"{figure(size)} {unit}")
            found.append(Finding(steady.name, "check" if large else "note", message, steady.action))
    return found


TRENDS = {
    "drift": Told(
        "field drifted",
        "the chamber's field changed by {amount} from the first reading to the last; that was "
        "allowed for",
        "keep iron, vehicles and currents away from the chamber",
    ),
    "ageing": Told(
        "ageing",
        "the bias changed by {amount} from the first reading to the last, in the axes of the "
        "sensor; that was allowed for, and the calibration is that of the middle",
        "let the sensor age at its highest temperature first, and calibrate again",
    ),
}
"""What is said of a field, or a bias, that changed steadily."""


def _judge_scatter(fit: ThermalFit) -> Finding | None:
    """A field that changed slowly, or means of bins that scatter beyond the noise."""
    c, limit = fit.calibration, EXCESS_DOUBTFUL
    if c.magnitude is None or fit.excess == fit.field_sd == 0.0:
        return None
    size = fit.excess * c.mean_gain
    said = (
        f"the means of bins scatter by {figure(fit.excess)} {c.unit_in} beyond the noise of the "
        "readings: the chamber's field changed, or the polynomial does not hold"
    )
    move = "look at the residuals against time"
    if fit.field_sd > 0.0:
        # by the magnitude alone a sensor that changed looks like a field that does
        limit *= 0.5 if fit.fixture is None else 1.0
        size = fit.field_sd
        said = (
            f"the chamber's field changed slowly, by {figure(size)} {c.unit_out} (one standard "
            "deviation), which was allowed for and limits the accuracy"
        )
        move = "keep vehicles and currents away"
    move += "; compare the sensors of the campaign"
    return Finding("field changes", "check" if size > limit * c.magnitude else "note", said, move)


def _judge_hysteresis(fit: ThermalFit) -> Finding | None:
    h = fit.hysteresis
    magnitude = fit.calibration.magnitude
    if h is None or magnitude is None or fit.drift is not None:
        return None
    gain = fit.calibration.mean_gain
    sizes = np.concatenate([np.full(3, gain), np.full(6, magnitude / gain)])
    surely = np.abs(h.difference) > 5 * h.sd * max(fit.correlation, 1.0) ** 0.5
    size = np.where(surely, np.abs(h.difference) * sizes, 0.0)
    if not (size > max(1e-4 * magnitude, 1.5 * fit.field_sd)).any():
        return None
    worst = int(np.argmax(size))
    handled = fit.calibration.rate is not None
    name = PARAMETERS[worst].replace("_", " ")
    return Finding(
        "hysteresis",
        "note" if handled or size[worst] < HYSTERESIS_DOUBTFUL * magnitude else "check",
        f"{name} differs by {figure(float(size[worst]))} nT of field between "
        f"cooling and heating{', which the term in dT/dt describes' if handled else ''}",
        "" if handled else "cool and heat more slowly, or fit with rate=True",
    )


def _judge_anomalies(fit: ThermalFit, sums: Binned) -> Finding | None:
    count = sum(anomaly.count for anomaly in fit.anomalies)
    if not count:
        return None
    share = count / (count + len(sums))
    return Finding(
        "anomalies",
        "check" if share > ANOMALIES_DOUBTFUL else "note",
        f"{count} reading{'s' * (count > 1)} ({figure(100 * share)} %) were outliers against the "
        f"running median and {'were' if count > 1 else 'was'} left out, at "
        f"{name_stations(anomaly.station for anomaly in fit.anomalies)}",
        "look for disturbances at those times" if share > ANOMALIES_DOUBTFUL else "",
    )


def compute_spread(cells: Cells, calibration: Thermal) -> Spread:
    """Standard deviations over all readings of each station, from the sums of its cells.

    Within a cell the correction is linear in reading and temperature,

        u − ū = W (raw − mean) + g (T − mean),   g = W′ (raw − b) − W b′,

    so the variance follows from the cell's covariances; raw counts are multiplied by the mean gain
    so that before and after have one unit.
    """
    gain = 1.0
    if calibration.unit_in == RAW and calibration.unit_out != RAW:
        gain = calibration.mean_gain
    mean, within = _correct_cells(cells, calibration)
    stations = np.unique(cells.number)
    before, after = [], []
    for number in stations:
        rows = cells.number == number
        count = cells.n[rows]
        before.append(gain * _sum_up(count, cells.mean[rows], cells.covariance[rows]))
        after.append(_sum_up(count, mean[rows], within[rows]))
    return Spread(stations=tuple(stations.tolist()), before=np.array(before), after=np.array(after))


def _correct_cells(cells: Cells, calibration: Thermal) -> tuple[Array, Array]:
    """Mean (m, 3) and covariance (m, 3, 3) of the corrected readings of each cell."""
    x = polynomial.scale(cells.temperature, calibration.centre_C, calibration.half_range_C)
    over = cells.variance / calibration.half_range_C**2
    phi = polynomial.mean_powers(x, over, calibration.degree)
    slope = polynomial.derivative(x, calibration.degree) / calibration.half_range_C
    bias, matrix = phi @ calibration.bias, np.tensordot(phi, calibration.matrix, axes=1)
    if calibration.rate is not None:
        bias = bias + cells.rate[:, None] * calibration.rate
    left = cells.mean - bias
    mean = np.einsum("mij,mj->mi", matrix, left)
    turning = np.tensordot(slope, calibration.matrix, axes=1)
    g = np.einsum("mij,mj->mi", turning, left)
    g -= np.einsum("mij,mj->mi", matrix, slope @ calibration.bias)
    cross = np.einsum("mij,mj,mk->mik", matrix, cells.shared, g)
    within = matrix @ cells.covariance @ np.swapaxes(matrix, 1, 2)
    within = within + cross + np.swapaxes(cross, 1, 2)
    within = within + cells.variance[:, None, None] * g[:, :, None] * g[:, None, :]
    return mean, within


def _sum_up(count: Array, mean: Array, within: Array) -> Array:
    """Standard deviation of x, y, z and of the magnitude over all cells of a station, (4,)."""
    size = np.linalg.norm(mean, axis=1)
    unit = mean / np.maximum(size, 1e-300)[:, None]
    along = np.einsum("mi,mij,mj->m", unit, within, unit)
    across = np.einsum("mii->m", within) - along
    values = np.column_stack([mean, size + across / (2 * np.maximum(size, 1e-300))])
    variance = np.column_stack([np.einsum("mii->mi", within), along])
    middle = np.average(values, axis=0, weights=count)
    total = np.average(variance + (values - middle) ** 2, axis=0, weights=count)
    return np.asarray(np.sqrt(np.maximum(total, 0.0)))
