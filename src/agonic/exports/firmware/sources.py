"""The header and source of the firmware, put together from templates as the plan needs them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from agonic.calibration.affine import Affine
from agonic.calibration.sources import Source, parse_source, signals
from agonic.exports.banner import write_banner
from agonic.exports.firmware.c_text import (
    fill_template,
    list_followed,
    write_array,
    write_comment,
    write_integer,
    write_literal,
)
from agonic.exports.firmware.error_bound import compute_error_bound_deg
from agonic.exports.firmware.grid import UNIT_NT, DeclinationGrid
from agonic.exports.firmware.plan import Plan
from agonic.exports.firmware.prediction import (
    CHOICE_SHARE,
    GRAVITY_SHARE,
    MAX_DISTANCE,
    find_weakest,
)
from agonic.exports.temperature import RATE
from agonic.units import RAW, STANDARD_GRAVITY_M_S2
from agonic.version import __version__


class Target(NamedTuple):
    """Bytes of stack for one compass and for several, instructions a compass with angles and else.

    Of the frames that GCC states, along the deepest calls, and of the longest call in an emulator
    over inputs that are none too; `tests/exports/test_cost.py` holds both for every kind of setup.
    """

    one: int
    several: int
    by_angles: int
    otherwise: int


TARGETS = {
    "Cortex-M0+": Target(160, 288, 200_000, 45_000),
    "Cortex-M4F": Target(136, 248, 12_000, 1400),
    "RISC-V": Target(192, 336, 190_000, 40_000),
    "AVR": Target(152, 216, 80_000, 50_000),
}
"""Sine and cosine of an angle that is no attitude (10⁹ degrees) take the longest."""


def list_costs(plan: Plan) -> list[str]:
    """A row for each target."""
    count, names = len(plan.calibrations), len(signals(plan.sources))
    held = names + (12 + 3 * names if plan.warm else 0)
    rows = []
    for name, target in TARGETS.items():
        stack = (target.one if count == 1 else target.several) + 4 * held
        each = target.by_angles if plan.tilt == "angles" else target.otherwise
        rows.append(f"{name:<12}{stack:>6}{count * each:>12}")
    return rows


DECLARED = {
    "throttle": "throttle;  /* 0 to 1 */",
    "second": "second[{}_COMPASSES][3]; /* readings of the magnetometer mixed with each */",
    RATE: "temperature_rate_C_s[{}_COMPASSES]; /* its change, degrees C a second */",
}
"""How the input declares a column that is no plain number, {} the name in capitals."""
ORDERS = {
    "roll-pitch": "aerospace: heading, then pitch, then roll",
    "pitch-roll": "of an inclinometer: heading, then roll, then pitch",
}


def write_header(plan: Plan, name: str) -> str:
    """The text of the header."""
    return fill_template("header.h.in", _common(plan, name))


def write_source(plan: Plan, name: str) -> str:
    """The text of the source."""
    values = _common(plan, name) | _tables(plan) | _limits(plan)
    return "\n".join(fill_template(f"{part}.c.in", values) for part in write_parts(plan))


def write_parts(plan: Plan) -> Iterator[str]:
    """The templates of the source, in order."""
    yield "start"
    yield "field_warm" if plan.warm else "field"
    if plan.accelerometer is not None:
        yield "force_calibrated"
    if plan.tilt == "angles":
        yield f"tilt_{plan.order.replace('-', '_')}"
    else:
        yield f"tilt_{plan.tilt}"
    if plan.watched:
        yield "down"
    if plan.heeled:
        yield f"heel_{plan.tilt}"
    yield (
        "deviation_none"
        if plan.deviations is None
        else ("deviation_heel" if plan.heeled else "deviation")
    )
    yield f"declination_{'grid' if isinstance(plan.declination, DeclinationGrid) else 'constant'}"
    yield "heading"
    if plan.time_constants:
        yield "follow"


def write_about(plan: Plan) -> list[str]:
    """What the file is, and where each calibration came from."""
    lines = [f"From the readings of magnetometers to true heading, float32; agonic {__version__}"]
    for compass, card in zip(plan.setup.compasses, plan.cards, strict=True):
        formula = "field = matrix (raw - bias), float32"
        if set(compass.calibration.needs) - {"temperature"}:
            formula = "field = matrix (raw - bias - added signals), float32"
        if "temperature" in compass.calibration.needs:
            formula += ", each a polynomial of temperature"
        lines += ["", *write_banner(compass.calibration, formula)]
        if card is not None:
            state = f", {card.power_state}" if card.power_state else ""
            lines.append(f"Deviation: {card.equation}{state}")
        if compass.latency_s:
            lines.append(
                f"Readings are {1e3 * compass.latency_s:.0f} ms late: give the tilt of that long "
                "before they arrive"
            )
    east = plan.declination
    whose = east.source if isinstance(east, DeclinationGrid) else f"{east:g} deg everywhere"
    return [*lines, "", f"Declination: {whose}"]


def _common(plan: Plan, name: str) -> dict[str, Any]:
    tilt = plan.tilt if plan.accelerometer is None else "readings"
    inputs = [DECLARED.get(column, f"{column};").format(name.upper()) for column in plan.columns]
    sensors = [_sensor(k, c) for k, c in enumerate(plan.calibrations)]
    bound = compute_error_bound_deg(plan)
    return {
        "name": name,
        "about": write_comment(write_about(plan)),
        "compasses": len(plan.calibrations),
        "sensors": write_comment(sensors),
        **{kind: kind == tilt for kind in ("angles", "acceleration", "readings")},
        "order": ORDERS[plan.setup.tilt_order],
        "inputs": [{"declared": text} for text in inputs],
        "warm": plan.warm,
        "grid": isinstance(plan.declination, DeclinationGrid),
        **list_followed(plan.time_constants),
        "unit_out": plan.calibrations[0].unit_out,
        "watched": plan.watched,
        "bound": "" if bound is None else f"{bound:.2e}",
        "cost": [{"row": row} for row in list_costs(plan)],
        "largest_tilt": f"{plan.setup.tilt_limit_deg:g}",
    }


def _tables(plan: Plan) -> dict[str, Any]:
    names = signals(plan.sources)
    values: dict[str, Any] = {
        "steepest": plan.steepest,
        "first_status": "temperature_status(which, in)" if plan.warm else "0",
        "signals": len(names),
        "signal_names": ", ".join(names),
        "signal_values": ",\n".join(f"        {_signal(name)}" for name in names),
    }
    table = plan.powers
    if plan.warm:
        _, powers, numbers = table.shape
        values |= {"powers": powers, "numbers": numbers, "polynomials": table}
        values |= {"ranges": plan.temperatures}
    else:
        matrix, added = table[:, 0, 3:12], table[:, 0, 12:]
        values |= {"bias": table[:, 0, :3], "matrix": matrix.reshape(-1, 3, 3)}
        values |= {"added": added.reshape(len(table), 3, len(names))}
    if plan.accelerometer is None:
        values["force"] = "    const float *a = in->acceleration;"
    else:
        values["force"] = "    float a[3];\n    specific_force(in, a);"
        values["force_bias"] = plan.accelerometer.bias
        values["force_matrix"] = plan.accelerometer.matrix
    cards = plan.deviations
    if cards is not None:
        values["deviation"] = cards if plan.heeled else cards[:, :5]
    grid = plan.declination
    if not isinstance(grid, DeclinationGrid):
        return values | {"declination": grid}
    rows, columns = grid.north.shape
    return values | {
        "rows": rows,
        "columns": columns,
        "south": float(grid.south),
        "west": float(grid.west),
        "latitude_step": float(grid.latitude_step),
        "longitude_step": float(grid.longitude_step),
        "unit": f"{UNIT_NT:g}",
        "table": write_array(np.stack([grid.north, grid.east]) / UNIT_NT, write=write_integer),
    }


def _limits(plan: Plan) -> dict[str, Any]:
    """Beyond what the status says that a heading is not to be trusted."""
    level = plan.tilt == "level"
    return {
        "weakest": find_weakest(plan),
        "less": CHOICE_SHARE,
        "strength_limit": float(max(plan.setup.magnitude_limit, 1e-12)),
        "dip": float(np.degrees(plan.dip or 0.0)),
        "dip_limit": MAX_DISTANCE
        if plan.dip is None
        else float(max(plan.setup.dip_limit_deg, 1e-12)),
        "strength_words": "horizontal part" if level else "magnitude",
        "strength": "across" if level else "out->magnitude",
        "expected": [size or 0.0 for size in plan.expected],
        "gravity": STANDARD_GRAVITY_M_S2,
        "accelerated": GRAVITY_SHARE,
    }


def _signal(name: str) -> str:
    """Where the C finds a signal."""
    if name.startswith("second_"):
        return f"in->second[which][{'xyz'.index(name[-1])}]"
    if name == RATE:
        return "in->temperature_rate_C_s[which]"
    source = parse_source(name)
    return " + ".join(_write_term(f"in->{column}", source) for column in source.columns)


def _write_term(x: str, source: Source) -> str:
    """A column in the form in which it counts."""
    value = write_literal(source.value)
    if source.form == "^":
        return f"powf(fabsf({x}), {value})"
    return f"({x} > {value} ? 1.0f : 0.0f)" if source.form == ">" else x


def _sensor(k: int, calibration: Affine) -> str:
    """A magnetometer of the header's list."""
    unit = "counts" if calibration.unit_in == RAW else calibration.unit_in
    axes = "sensor" if calibration.frame_in == "m" else "body"
    beside = getattr(calibration, "second_sensor", None)
    mixed = f", mixed with {beside}" if beside else ""
    return f"{k}: {calibration.sensor}, readings in {unit}, {axes} axes{mixed}"
