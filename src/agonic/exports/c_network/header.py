"""The C header of a network: `write_c` writes it, base, domain guard and all.

    field = base(raw) + g(x) · clip(middle + half · V [tanhf(U [x, 1]), 1]),   float32

g is 1 near the readings it was trained on and 0 from twice that distance, where the base is all
that is left; steps of a chain before and after it are a bias and a matrix each.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from agonic.calibration.affine import Affine
from agonic.calibration.base import Calibration
from agonic.calibration.network import Network
from agonic.calibration.sources import signals
from agonic.exports.banner import format_float32, write_banner
from agonic.exports.c_network.parts import Known, Parts, make_known_readings, split_parts
from agonic.exports.firmware import c_text as c


def make_network_header(calibration: Calibration, name: str) -> tuple[str, tuple[str, ...]]:
    """The text of the header, and warnings."""
    parts = split_parts(calibration)
    known = make_known_readings(parts)
    network, shape = parts.network, parts.network.shape
    said = (*write_banner(calibration, _describe(parts)), *_sizes(parts, known))
    kind = "alone" if network.base is None else network.target
    values = {
        "name": name,
        "about": c.write_comment(said),
        "formula": f"{_formula(parts)}.",
        "returns": _returns(parts),
        "unit_out": calibration.unit_out,
        "network_unit": network.unit_out,
        "inputs": shape.inputs,
        "each": shape.inputs + 1,
        "hidden": shape.widths[1],
        "last": shape.widths[-2],
        "width": shape.widths[-2] + 1,
        "outputs": shape.outputs,
        "layers": _list_layers(network, name),
        "input_names": ", ".join(signals(network.inputs)),
        "input_scale": [network.input_middle, network.input_half],
        "input_values": ", ".join(_input_values(parts)),
        "U": network.hidden,
        "second": network.second is not None,
        "second_width": shape.widths[1] + 1,
        "W": network.second,
        "V": network.output,
        "output_middle": network.output_middle,
        "output_half": float(network.output_half),
        "points": len(network.centres),
        "centres": network.centres,
        "reach": float(network.reach),
        "bound": network.bound and float(network.bound),
        **{one: one == kind for one in ("alone", "magnitude", "vector")},
        "beside": len(parts.beside),
        "beside_names": ", ".join(parts.beside),
        **_base(parts),
        "before": _table(parts.before),
        "after": _table(parts.after),
        "reading": _step(f"{name}_before" if parts.before else "", "raw", "reading"),
        "write": _step(f"{name}_after" if parts.after else "", "out", "field"),
        "tests": len(known.rows),
        "columns": known.rows.shape[1],
        "known": c.write_array(known.rows, "    "),
        "tolerance": format_float32(known.tolerance),
    }
    return c.fill_template("headers/network.h.in", values), _warnings(parts)


def _list_layers(network: Network, name: str) -> list[dict[str, object]]:
    """From the inputs x through the hidden nodes, the last of which add their part to `added`."""
    tables = [(f"{name}_U", "x"), (f"{name}_W", "first")]
    widths = network.shape.widths[:-1]
    return [
        {
            "table": table,
            "into": into,
            "width": width,
            "nodes": nodes,
            "final": k == len(widths) - 2,
        }
        for k, ((table, into), (width, nodes)) in enumerate(
            zip(tables, pairwise(widths), strict=False)
        )
    ]


def _base(parts: Parts) -> dict[str, object]:
    """What the network adds to; nothing where it stands alone."""
    base = parts.base
    if base is None:
        return dict.fromkeys(("base", "warm"))
    return {
        "base": c.write_array(base.table),
        "powers": base.table.shape[0],
        "highest": base.table.shape[0] - 1,
        "count": base.table.shape[1],
        "sources": len(base.signals),
        "source_names": ", ".join(base.signals),
        "source_values": ", ".join(_name_beside(parts, signal) for signal in base.signals),
        "warm": parts.warm,
        "at": _name_beside(parts, "temperature") if parts.warm else "",
        "scale": [base.centre_C, base.half_range_C, *base.clamp_C],
    }


def _table(step: Affine | None) -> str:
    """A step of a chain beside the network; nothing where there is none."""
    return "" if step is None else c.write_array(np.vstack([step.bias, step.matrix]))


def _step(table: str, into: str, out: str) -> str:
    """The C that applies a step, or copies where there is none."""
    values = {"step": table, "into": into, "out": out}
    return c.fill_template("headers/network_step.h.in", values).rstrip()


def _name_beside(parts: Parts, signal: str) -> str:
    """Where the C finds a number that is given beside a reading."""
    return f"beside[{parts.beside.index(signal)}]"


def _formula(parts: Parts) -> str:
    """The equation of the network."""
    whole = "network(x)" if parts.network.base is None else "base(raw) + g(x) network(x)"
    along = " along the base" if parts.network.target == "magnitude" else ""
    return f"field = {whole}{along}"


def _describe(parts: Parts) -> str:
    """The equation, its size, and what holds beyond the training."""
    base = parts.network.base
    beyond = "" if base is None else "; where nothing was trained g is 0 and the base is left"
    return f"{_formula(parts)}, float32, {parts.network.shape.said} (tanhf){beyond}"


def _returns(parts: Parts) -> str:
    if parts.network.base is None:
        return "1, or 0 so far from what was trained that\n   the field is a guess."
    outside = "0 where half of the correction or more is\n   gone, far from what was trained"
    return f"1, or {outside}{', or the base is out of its temperatures' if parts.warm else ''}."


def _sizes(parts: Parts, known: Known) -> tuple[str, ...]:
    unit = parts.network.unit_out
    return (
        f"Size: {parts.constants} float constants, {4 * parts.constants} bytes; "
        f"{parts.network.shape.nodes} calls of tanhf a reading",
        f"Error of float32: up to {known.error:.2g} {unit} on {known.tried} readings like those "
        f"of the training; the self-test allows {format_float32(known.tolerance)} {unit}",
    )


def _warnings(parts: Parts) -> tuple[str, ...]:
    if parts.network.base is not None:
        return ()
    return (
        "the network has no base to fall back to: far from what it was trained on its field is a "
        "guess, where the C returns 0",
    )


def _input_values(parts: Parts) -> list[str]:
    """Where the C finds each input: a reading, something beside it, or a value that is held."""
    found = []
    for name in parts.network.inputs:
        if name in parts.network.held:
            found.append(c.write_literal(parts.network.held[name]))
        elif name == "field":
            found += [f"reading[{axis}]" for axis in range(3)]
        else:
            found += [_name_beside(parts, one) for one in signals((name,))]
    return found
