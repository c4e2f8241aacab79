"""The header and source of the firmware, put together from templates as the plan needs them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from agonic.calibration.affine import Affine
from agonic.calibration.inputs import signals
from agonic.calibration.sources import Source, parse_source
from agonic.exports.banner import write_banner
from agonic.exports.firmware.c_text import (
    fill_template,
    write_array,
    write_comment,
    write_following,
    write_following_header,
    write_integer,
    write_literal,
)
from agonic.exports.firmware.cost import write_cost
from agonic.exports.firmware.error_bound import compute_error_bound_deg
from agonic.exports.firmware.grid import UNIT, DeclinationGrid
from agonic.exports.firmware.plan import Plan
from agonic.exports.firmware.prediction import FAR, GRAVITY_SHARE, LESS, find_weakest
from agonic.exports.temperature import RATE
from agonic.units import RAW, STANDARD_GRAVITY_M_S2
from agonic.version import __version__

INPUTS = {
    "angles": "    float roll_deg;  /* {order} */\n    float pitch_deg;",
    "acceleration": (
        "    float acceleration[3]; /* specific force, m/s^2: forward, right, down; at rest and\n"
        "                              level the last is -9.8 */"
    ),
    "readings": (
        "    float acceleration[3]; /* readings of the accelerometer, m/s^2, in its own axes */"
    ),
    "level": "",
    "current_A": "    float current_A;",
    "throttle": "    float throttle;  /* 0 to 1 */",
    "second": (
        "    float second[{GUARD}_COMPASSES][3]; /* readings of the magnetometer mixed with each */"
    ),
    "temperature": "    float temperature_C[{GUARD}_COMPASSES]; /* of each magnetometer itself */",
    "temperature_rate": (
        "    float temperature_rate_C_s[{GUARD}_COMPASSES]; /* its change, degrees C a second */"
    ),
    "grid": "    float latitude_deg;\n    float longitude_deg; /* east positive */",
}
DOWN = """
/* Down in body axes, of length one, by the tilt. */
void {name}_down(const {name}_input *in, float down[3]);
"""
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
    parts = [fill_template(f"{part}.c.in", values) for part in write_parts(plan)]
    if plan.time_constants:
        parts.append(write_following(plan.time_constants, name))
    return "\n".join(parts)


def write_parts(plan: Plan) -> Iterator[str]:
    """The templates of the source, in order."""
    yield "start"
    yield "field_warm" if plan.warm else ("field_sources" if plan.sources else "field")
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
    return [*lines, "", f"Declination: {write_declination(plan)}"]


def write_declination(plan: Plan) -> str:
    """Whose declination it is, in words."""
    if isinstance(plan.declination, DeclinationGrid):
        return plan.declination.source
    return f"{plan.declination:g} deg everywhere"


def _common(plan: Plan, name: str) -> dict[str, str]:
    first = plan.calibrations[0]
    guard = name.upper()
    tilt = plan.tilt if plan.accelerometer is None else "readings"
    needed = ["raw", tilt, *plan.columns]
    if plan.warm:
        needed.append("temperature")
    if isinstance(plan.declination, DeclinationGrid):
        needed.append("grid")
    fields = {
        "raw": f"    float raw[{guard}_COMPASSES][3];  /* readings, a row a magnetometer */",
        **{column: f"    float {column};" for column in plan.columns},
        **INPUTS,
    }
    order = ORDERS[plan.setup.tilt_order]
    inputs = [fields[key].format(order=order, GUARD=guard) for key in needed if fields[key]]
    sensors = [_sensor(k, c) for k, c in enumerate(plan.calibrations)]
    return {
        "name": name,
        "about": write_comment(write_about(plan)),
        "compasses": str(len(plan.calibrations)),
        "sensors": write_comment(sensors),
        "inputs": "\n".join(inputs),
        "following": write_following_header(plan.time_constants, name),
        "unit_out": first.unit_out,
        "down": DOWN.format(name=name) if plan.watched else "",
        "accuracy": _write_accuracy(plan),
        "cost": write_cost(plan),
        "largest_tilt": f"{plan.setup.tilt_limit_deg:g}",
    }


def _write_accuracy(plan: Plan) -> str:
    """The comment on how far single precision may be off; nothing where no bound is known."""
    bound = compute_error_bound_deg(plan)
    if bound is None:
        return ""
    return (
        "/* Where the status is 0, true_deg is within\n"
        f"   {bound:.2e} degrees of exact arithmetic, whatever the input (an error analysis of\n"
        "   every operation with these numbers). */\n\n"
    )


def _tables(plan: Plan) -> dict[str, str]:
    values = {
        "steepest": write_literal(plan.steepest),
        "first_status": "temperature_status(which, in)" if plan.warm else "0",
        **(_warm(plan) if plan.warm else _constant(plan)),
        **_force(plan),
    }
    table = plan.deviations
    if table is not None:
        values["deviation"] = write_array(table if plan.heeled else table[:, :5])
    grid = plan.declination
    if not isinstance(grid, DeclinationGrid):
        return values | {"declination": write_literal(grid)}
    rows, columns = grid.north.shape
    return values | {
        "rows": str(rows),
        "columns": str(columns),
        "south": write_literal(grid.south),
        "west": write_literal(grid.west),
        "latitude_step": write_literal(grid.latitude_step),
        "longitude_step": write_literal(grid.longitude_step),
        "unit": f"{UNIT:g}",
        "table": write_array(np.stack([grid.north, grid.east]) / UNIT, write=write_integer),
    }


def _force(plan: Plan) -> dict[str, str]:
    """The specific force: as it is given, or by the calibration of the accelerometer."""
    if plan.accelerometer is None:
        return {"force": "    const float *a = in->acceleration;"}
    return {
        "force": "    float a[3];\n    specific_force(in, a);",
        "force_bias": write_array(plan.accelerometer.bias),
        "force_matrix": write_array(plan.accelerometer.matrix),
    }


def _constant(plan: Plan) -> dict[str, str]:
    """Calibrations that no temperature changes."""
    names = signals(plan.sources)
    return {
        "bias": write_array(plan.bias),
        "matrix": write_array(plan.matrix),
        "signals": str(len(names)),
        "signal_names": ", ".join(names),
        "signal_values": _values(names),
        "added": write_array(plan.coefficients),
    }


def _warm(plan: Plan) -> dict[str, str]:
    """Calibrations as polynomials of temperature; pieces without signals are empty."""
    names, table = signals(plan.sources), plan.powers
    pieces = {
        "define_signals": f"#define SIGNALS {len(names)}\n",
        "and_added": f", and what a unit of {', '.join(names)} adds to each axis,",
        "minus_added": " - added signals",
        "signal_values": f"    const float signal[SIGNALS] = {{\n{_values(names)}\n    }};\n",
        "take_signals": (
            "        for (k = 0; k < SIGNALS; k++) {\n"
            "            d[i] -= value[12 + i * SIGNALS + k] * signal[k];\n"
            "        }\n"
        ),
    }
    return {
        "powers": str(table.shape[1]),
        "numbers": str(table.shape[2]),
        "polynomials": write_array(table),
        "ranges": write_array(plan.temperatures),
        **(pieces if names else dict.fromkeys(pieces, "")),
    }


def _values(names: tuple[str, ...]) -> str:
    """The initialiser of the signals, a line each."""
    return ",\n".join(f"        {_signal(name)}" for name in names)


def _limits(plan: Plan) -> dict[str, str]:
    """Beyond what the status says that a heading is not to be trusted."""
    level = plan.tilt == "level"
    return {
        "weakest": write_literal(find_weakest(plan)),
        "less": write_literal(LESS),
        "strength_limit": write_literal(max(plan.setup.magnitude_limit, 1e-12)),
        "dip": write_literal(np.degrees(plan.dip or 0.0)),
        "dip_limit": write_literal(
            FAR if plan.dip is None else max(plan.setup.dip_limit_deg, 1e-12)
        ),
        "strength_words": "horizontal part" if level else "magnitude",
        "strength": "across" if level else "out->magnitude",
        "expected": write_array([size or 0.0 for size in plan.expected]),
        "gravity": write_literal(STANDARD_GRAVITY_M_S2),
        "accelerated": write_literal(GRAVITY_SHARE),
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
