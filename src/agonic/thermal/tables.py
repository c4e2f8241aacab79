"""Tables of a calibration over temperature."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import repeat
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import FREE_PARAMETERS, PARAMETERS
from agonic.calibration.decomposition import decompose_at, expand_in_temperature
from agonic.calibration.thermal import Thermal
from agonic.readable import make_record
from agonic.report.digits import (
    count,
    each_with_sd,
    group_digits,
    quantity,
    show_sign,
    with_sd_in_powers,
    write_minus,
)
from agonic.report.labels import unit_label
from agonic.report.markup import Markup, element, row, table
from agonic.report.section import Block, Table, tabulate
from agonic.report.tables import NOTHING, mark
from agonic.report.verdict import MEANINGS
from agonic.thermal import figures
from agonic.thermal.campaign.description import join_numbers
from agonic.thermal.checks.boards import Board, list_boards
from agonic.thermal.common_mode import ChamberField
from agonic.thermal.fit.evidence import find_worst_sd
from agonic.thermal.fit.result import Anomaly, Hysteresis, Spread, ThermalFit
from agonic.thermal.result import CalibratedCampaign, CalibratedSensor, HeldOut

_MOST_TIMES = 5


def list_sensors(result: CalibratedCampaign) -> Table:
    """A row for every sensor, with a link to its part of the page."""
    numbers = {one.name: k for k, one in enumerate(result.sensors, start=1)}

    def ask(say: Callable[[ThermalFit], str]) -> Callable[[CalibratedSensor], str]:
        return lambda sensor: NOTHING if sensor.fit is None else say(sensor.fit)

    def known(value: float, fit: ThermalFit) -> str:
        return quantity(value, unit_label(fit.calibration.unit_in), 2)

    columns = {
        "Sensor": lambda one: element("a", one.name, href=f"#sensor-{numbers[one.name]}"),
        "Verdict": lambda one: mark(one.verdict, MEANINGS[one.verdict][0]),
        "Readings": ask(lambda fit: group_digits(fit.n)),
        "Bias standard error": ask(lambda fit: known(find_worst_sd(fit.calibration)[0], fit)),
        "Spread of |B|": ask(format_spread),
        "Noise": ask(lambda fit: known(fit.noise, fit)),
    }
    return tabulate(result.sensors, columns, "sensors")


def format_spread(fit: ThermalFit) -> str:
    """The largest standard deviation of the magnitude at a station, before and after."""
    if fit.spread is None:
        return NOTHING
    unit = unit_label(fit.calibration.unit_out)
    before, after = (float(v[:, 3].max()) for v in (fit.spread.before, fit.spread.after))
    return f"{quantity(before, unit)} → {quantity(after, unit)}"


def list_ratios(
    sensors: Sequence[CalibratedSensor], beside: Mapping[str, Sequence[float]], words: str
) -> Markup:
    """The published table: the largest standard deviation of the stations before over after.

    Source: Nikolaev et al. 2023, table.
    """
    tested = any(sensor.held_out is not None for sensor in sensors)
    rows: list[Markup] = []
    for sensor in sensors:
        if sensor.fit is None or sensor.fit.spread is None:
            continue
        cells = [f"{ratio:.2f}" for ratio in sensor.fit.spread.improvement]
        if tested:
            unseen = sensor.held_out
            cells.append(NOTHING if unseen is None else f"{unseen.spread.improvement[3]:.2f}")
        rows.append(row([sensor.name, *cells]))
        if sensor.name in beside:
            other = [f"{float(ratio):.2f}" for ratio in beside[sensor.name]]
            blank = [""] * (len(cells) - len(other))
            rows.append(row([words, *other, *blank], class_="beside"))
    head = ["Sensor", *figures.COMPONENTS, *(["|B|, stations left out"] if tested else [])]
    return table(head, rows, class_="ratios")


def list_shares(found: ChamberField) -> Table:
    """What the changes at a station consist of, for every sensor."""

    def show(sd: float) -> str:
        return quantity(sd, "nT", 2) if sd >= 0.05 else "none"

    columns = {
        "Sensor": lambda share: share.name,
        "Changes in all": lambda share: show(share.total_sd),
        "Chamber’s field": lambda _: show(found.common_sd),
        "Noise of the readings": lambda share: show(share.noise_sd),
        "Its own": lambda share: show(share.own_sd),
    }
    return tabulate(found.shares, columns, "parts")


BOARDS: dict[str, Callable[[Board], str]] = {
    "Board": lambda board: board.name,
    "Stations": lambda board: join_numbers(board.stations),
    "Readings": lambda board: group_digits(board.readings),
    "Left out": lambda board: group_digits(board.rejected),
    "Missing": lambda board: group_digits(board.missing),
    "Gaps": lambda board: str(sum(board.gaps.values())),
    "Longest": lambda board: quantity(board.longest_s, "s") if board.gaps else NOTHING,
    "Restarts": lambda board: str(sum(board.restarts.values())),
}
"""How the recordings of each board were kept up."""


def list_alternatives(fit: ThermalFit) -> Table:
    """What is left of unseen readings, by the fit and with what it does not have."""
    rows = [["as fitted", quantity(fit.unseen_rms or 0.0, "nT", 3), ""]]
    for name, left in fit.alternatives.items():
        change = 100.0 * (left / (fit.unseen_rms or left) - 1.0)
        rows.append([f"with {name}", quantity(left, "nT", 3), write_minus(f"{change:+.0f} %")])
    return Table(["Model", "Left of unseen blocks, on an axis", "Change"], rows, style="parts")


def list_numbers(calibration: Thermal) -> Table:
    """Bias, matrix, scale factors and angles at both ends and in the middle of the range."""
    levels = np.linspace(*calibration.range_C, 3)
    curves = (
        *figures.evaluate_coefficients(calibration, levels),
        *figures.evaluate_decomposition(calibration, levels),
    )
    rows = [[curve.label, *each_with_sd(curve.value, curve.sd)] for curve in curves]
    return Table(["Number", *(write_minus(f"at {level:.1f} °C") for level in levels)], rows)


def list_powers(calibration: Thermal) -> Table:
    """k0, k1, … of bias and matrix in powers of the temperature in °C, as they are published."""
    values, sd = expand_in_temperature(calibration)
    sds = repeat(None) if sd is None else sd
    rows = [
        [name.replace("_", " "), *each_with_sd(of, known, with_sd_in_powers)]
        for name, of, known in zip(name_nine(calibration), values, sds, strict=False)
    ]
    return Table(["Number", *(f"k{k}" for k in range(calibration.degree + 1))], rows)


def name_nine(calibration: Thermal) -> tuple[str, ...]:
    """The names of bias and matrix, nine of them or twelve."""
    return FREE_PARAMETERS if calibration.gauge == "free" else PARAMETERS


def list_stations(spread: Spread, held_out: HeldOut | None, unit: str) -> Table:
    """The numbers behind the bars, for |B|, and how far its magnitude is off."""
    head = ["Station", "|B| varies before", "after", *(["left out of the fit"] if held_out else [])]
    if held_out is not None:
        head += ["Off the chamber’s magnitude", "left out of the fit"]
    rows = []
    for k, number in enumerate(spread.stations):
        cells = [
            f"{number}",
            *(quantity(float(v[k, 3]), unit) for v in (spread.before, spread.after)),
        ]
        if held_out is not None:
            cells += _format_held_out(held_out, number, unit)
        rows.append(cells)
    return Table(head, rows, style="parts")


def _format_held_out(held_out: HeldOut, number: int, unit: str) -> list[str]:
    if number not in held_out.spread.stations:
        return [NOTHING] * 3
    k = held_out.spread.stations.index(number)
    values = (held_out.spread.after[k, 3], held_out.seen_rms[k], held_out.magnitude_rms[k])
    return [quantity(float(value), unit) for value in values]


def list_hysteresis(found: Hysteresis, calibration: Thermal) -> Table:
    """Cooling less heating of every coefficient."""
    unit = unit_label(calibration.unit_in)
    head = ["Cooling less heating", "Mean over temperature", "Largest, smoothed over 5 °C"]
    known = map(show_sign, each_with_sd(found.difference, found.sd))
    largest = (quantity(value, "", 2) for value in found.largest.tolist())
    names = (
        name.replace("_", " ") + (f", {unit}" if k < 3 else "") for k, name in enumerate(PARAMETERS)
    )
    return Table(head, [*zip(names, known, largest, strict=True)])


def describe_lag(calibration: Thermal) -> str:
    """The term in dT/dt in words; "" where there is none."""
    if calibration.rate is None:
        return ""
    unit = unit_label(calibration.unit_in)
    values = ", ".join(
        f"{axis} {group_digits(float(value) / 60.0, 1)}"
        for axis, value in zip("xyz", calibration.rate, strict=True)
    )
    return (
        f"While the temperature changes the bias is off by {values} {unit} per °C/min; the "
        "calibration takes that into account."
    )


def list_anomalies(left_out: Sequence[Anomaly]) -> list[Block]:
    """Readings that were left out, by station, and when."""
    if not left_out:
        return ["No reading were outliers against the running median."]
    total = sum(anomaly.count for anomaly in left_out)
    begun = min((float(a.times.min()) for a in left_out if np.isfinite(a.times).all()), default=0.0)
    said = (
        f"{count(total, 'reading')} were outliers against the running median of "
        f"{'their' if total > 1 else 'its'} station and {'were' if total > 1 else 'was'} left out."
    )
    rows = [
        [f"{a.station}", group_digits(a.count), _format_times(a.times - begun)] for a in left_out
    ]
    head = ["Station", "Left out", "Hours after the first of all"]
    return [said, Table(head, rows, style="anomalies")]


def _format_times(since_s: Array) -> str:
    if not np.isfinite(since_s).all():
        return NOTHING
    shown = ", ".join(f"{t / 3600:.2f}" for t in since_s[:_MOST_TIMES])
    more = len(since_s) - _MOST_TIMES
    return f"{shown} and {more} more" if more > 0 else shown


def list_campaign_values(result: CalibratedCampaign) -> dict[str, Any]:
    """What holds for all sensors."""
    chamber = result.chamber_field
    return {
        "turns": result.turns,
        "reason": result.reason,
        "stations": result.campaign.stations,
        "rows": result.campaign.rows,
        "positions": result.positions
        and {
            str(number): {
                "turn_deg": turn,
                "sd_deg": result.positions.turn_sd_deg[number],
                "field_direction": result.positions.direction[number],
            }
            for number, turn in result.positions.turn_deg.items()
        },
        "boards": [board._asdict() for board in list_boards(result.campaign)],
        "chamber_field": chamber
        and {
            "sd_nT": chamber.common_sd,
            "axes": chamber.axes,
            "sensors": {
                share.name: {"noise_nT": share.noise_sd, "own_nT": share.own_sd}
                for share in chamber.shares
            },
        },
    }


def list_sensor_values(sensor: CalibratedSensor, files: Sequence[str]) -> dict[str, Any]:
    """One sensor; a refused one has no numbers."""
    said = {"sensor": sensor.name, "files": files}
    if sensor.fit is None:
        return said
    unseen = sensor.held_out
    tested = unseen and {
        "stations": unseen.spread.stations,
        "improvement": unseen.spread.improvement,
        "magnitude_rms_nT": unseen.magnitude_rms,
        "seen_rms_nT": unseen.seen_rms,
    }
    return {**said, **_list_fit_values(sensor.fit), "held_out": tested}


def _list_powers(calibration: Thermal) -> list[dict[str, Any]]:
    """k0, k1, … of each number, and their standard errors."""
    values, sd = expand_in_temperature(calibration)
    return [{"k": row, "sd": sd if sd is None else sd[at]} for at, row in enumerate(values)]


def _list_fit_values(fit: ThermalFit) -> dict[str, Any]:
    calibration, hysteresis = fit.calibration, fit.hysteresis
    levels = np.linspace(*calibration.range_C, 7)
    sd = calibration.sd_at(levels)
    return {
        "method": "thermal",
        **make_record(fit),
        "degree": calibration.degree,
        "range_C": list(calibration.range_C),
        "at": {
            "temperature_C": levels,
            "bias_nT": calibration.bias_at(levels),
            "bias_sd_nT": sd[:, :3],
            "matrix": calibration.matrix_at(levels),
            "matrix_sd": sd[:, 3:],
            **decompose_at(calibration, levels)._asdict(),
        },
        "powers_of_temperature_C": dict(
            zip(name_nine(calibration), _list_powers(calibration), strict=True)
        ),
        "rate_nT_per_C_s": calibration.rate,
        "improvement": fit.spread and fit.spread.improvement,
        "hysteresis": hysteresis and {"difference": hysteresis.difference, "sd": hysteresis.sd},
        "fixture_deg": fit.fixture and fit.fixture.turned_deg,
        "anomalies": {str(a.station): a.count for a in fit.anomalies},
        "equation": calibration.equation,
    }
