"""The header and source of the firmware, put together from templates as the plan needs them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from agonic.calibration.interference import signals
from agonic.io.export import banner
from agonic.io.firmware.ctext import braced, comment, filled, literal, whole
from agonic.io.firmware.grid import UNIT, DeclinationGrid
from agonic.io.firmware.plan import Plan
from agonic.io.firmware.prediction import FAR, GRAVITY_M_S2, GRAVITY_SHARE, weakest
from agonic.units import RAW
from agonic.version import __version__

INPUTS = {
    "angles": "    float roll_deg;  /* {order} */\n    float pitch_deg;",
    "acceleration": (
        "    float acceleration[3]; /* specific force, m/s^2: forward, right, down; at rest and\n"
        "                              level the last is -9.8 */"
    ),
    "level": "",
    "current_A": "    float current_A;",
    "throttle": "    float throttle;  /* 0 to 1 */",
    "second": (
        "    float second[{GUARD}_COMPASSES][3]; /* readings of the magnetometer mixed with each */"
    ),
    "grid": "    float latitude_deg;\n    float longitude_deg; /* east positive */",
}
ORDERS = {
    "roll-pitch": "aerospace: heading, then pitch, then roll",
    "pitch-roll": "of an inclinometer: heading, then roll, then pitch",
}


def header(plan: Plan, name: str) -> str:
    """The text of the header."""
    return filled("header.h.in", _common(plan, name))


def source(plan: Plan, name: str) -> str:
    """The text of the source."""
    values = _common(plan, name) | _tables(plan) | _limits(plan)
    return "\n".join(filled(f"{part}.c.in", values) for part in parts(plan))


def parts(plan: Plan) -> Iterator[str]:
    """The templates of the source, in order."""
    yield "start"
    yield "field_sources" if plan.sources else "field"
    if plan.tilt == "angles":
        yield f"tilt_{plan.order.replace('-', '_')}"
    else:
        yield f"tilt_{plan.tilt}"
    if plan.heeled:
        yield f"heel_{plan.tilt}"
    yield (
        "deviation_none"
        if plan.deviations is None
        else ("deviation_heel" if plan.heeled else "deviation")
    )
    yield f"declination_{'grid' if isinstance(plan.declination, DeclinationGrid) else 'constant'}"
    yield "heading"


def about(plan: Plan) -> list[str]:
    """What the file is, and where each calibration came from."""
    lines = [f"From the readings of magnetometers to true heading, float32; agonic {__version__}"]
    for compass, card in zip(plan.setup.compasses, plan.cards, strict=True):
        formula = "field = matrix (raw - bias), float32"
        if compass.calibration.needs:
            formula = "field = matrix (raw - bias - added signals), float32"
        lines += ["", *banner(compass.calibration, formula)]
        if card is not None:
            state = f", {card.power_state}" if card.power_state else ""
            lines.append(f"Deviation: {card.equation}{state}")
        if compass.latency_s:
            lines.append(
                f"Readings are {1e3 * compass.latency_s:.0f} ms late: give the tilt of that long "
                "before they arrive"
            )
    return [*lines, "", f"Declination: {declination_source(plan)}"]


def declination_source(plan: Plan) -> str:
    """Whose declination it is, in words."""
    if isinstance(plan.declination, DeclinationGrid):
        return plan.declination.source
    return f"{plan.declination:g} deg everywhere"


def _common(plan: Plan, name: str) -> dict[str, str]:
    first = plan.calibrations[0]
    guard = name.upper()
    needed = ["raw", plan.tilt, *plan.sources]
    if isinstance(plan.declination, DeclinationGrid):
        needed.append("grid")
    fields = {
        "raw": f"    float raw[{guard}_COMPASSES][3];  /* readings, a row a magnetometer */",
        **INPUTS,
    }
    order = ORDERS[plan.setup.tilt_order]
    inputs = [fields[key].format(order=order, GUARD=guard) for key in needed if fields[key]]
    sensors = [
        f"{k}: {c.sensor}, readings in {'counts' if c.unit_in == RAW else c.unit_in}, "
        f"{'sensor' if c.frame_in == 'm' else 'body'} axes"
        for k, c in enumerate(plan.calibrations)
    ]
    return {
        "name": name,
        "GUARD": guard,
        "about": comment(about(plan)),
        "compasses": str(len(plan.calibrations)),
        "sensors": comment(sensors),
        "inputs": "\n".join(inputs),
        "unit_out": first.unit_out,
        "largest_tilt": f"{plan.setup.tilt_limit_deg:g}",
    }


def _tables(plan: Plan) -> dict[str, str]:
    names = signals(plan.sources)
    signal_values = ",\n".join(f"        {_signal(name)}" for name in names)
    values = {
        "steepest": literal(plan.steepest),
        "bias": braced(plan.bias),
        "matrix": braced(plan.matrix),
        "signals": str(len(names)),
        "signal_names": ", ".join(names),
        "signal_values": signal_values,
        "added": braced(plan.coefficients),
    }
    table = plan.deviations
    if table is not None:
        values["deviation"] = braced(table if plan.heeled else table[:, :5])
    grid = plan.declination
    if not isinstance(grid, DeclinationGrid):
        return values | {"declination": literal(grid)}
    rows, columns = grid.north.shape
    return values | {
        "rows": str(rows),
        "columns": str(columns),
        "south": literal(grid.south),
        "west": literal(grid.west),
        "latitude_step": literal(grid.latitude_step),
        "longitude_step": literal(grid.longitude_step),
        "unit": f"{UNIT:g}",
        "table": braced(np.stack([grid.north, grid.east]) / UNIT, write=whole),
    }


def _limits(plan: Plan) -> dict[str, str]:
    """Beyond what the status says that a heading is not to be trusted."""
    level = plan.tilt == "level"
    return {
        "weakest": literal(weakest(plan)),
        "strength_limit": literal(max(plan.setup.magnitude_limit, 1e-12)),
        "dip": literal(np.degrees(plan.dip or 0.0)),
        "dip_limit": literal(FAR if plan.dip is None else max(plan.setup.dip_limit_deg, 1e-12)),
        "strength_words": "horizontal part" if level else "magnitude",
        "strength": "across" if level else "out->magnitude",
        "expected": braced([size or 0.0 for size in plan.expected]),
        "gravity": literal(GRAVITY_M_S2),
        "accelerated": literal(GRAVITY_SHARE),
    }


def _signal(name: str) -> str:
    """Where the C finds a signal."""
    if name.startswith("second_"):
        return f"in->second[which][{'xyz'.index(name[-1])}]"
    return f"in->{name}"
