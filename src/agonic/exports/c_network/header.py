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
from agonic.calibration.inputs import signals
from agonic.calibration.network import Network
from agonic.exports.banner import format_float32, write_banner
from agonic.exports.c_network.parts import Known, Parts, make_known_readings, split_parts
from agonic.exports.firmware.c_text import (
    fill_template,
    write_array,
    write_comment,
    write_literal,
)


def name_beside(parts: Parts, signal: str) -> str:
    """Where the C finds a number that is given beside a reading."""
    return f"beside[{parts.beside.index(signal)}]"


def _fill(part: str, **values: object) -> str:
    """The template of a part of the header, filled."""
    written = {name: str(value) for name, value in values.items()}
    return fill_template(f"headers/network_{part}.h.in", written)


def write_nodes(network: Network, name: str) -> str:
    """The C from the inputs x through the hidden nodes, each of which adds its part to `added`."""
    widths = network.shape.widths
    add = _fill("add", name=name, outputs=widths[-1])
    layers = [(f"{name}_U", "x", "        first[k] = sum;\n"), (f"{name}_W", "first", add)]
    if network.second is None:
        layers = [(f"{name}_U", "x", add)]
    return "".join(
        _fill("layer", table=table, into=into, inputs=inputs, nodes=nodes, then=then)
        for (table, into, then), (inputs, nodes) in zip(layers, pairwise(widths), strict=False)
    )


def write_read(parts: Parts, name: str) -> str:
    """The C from the reading to the field by the base."""
    if parts.before is None:
        text = _fill("same", into="raw", out="reading")
    else:
        text = _fill("affine", name=f"{name}_before", into="raw", out="reading")
    if parts.base is None:
        return text
    powers, count = parts.table.shape
    names = parts.base.signals
    values = {
        "name": name,
        "count": count,
        "last": powers - 1,
        "at": name_beside(parts, "temperature") if parts.warm else "",
        "signals": len(names),
    }
    given = ", ".join(name_beside(parts, signal) for signal in names)
    there = {"warm": parts.warm, "powers": powers > 1, "sources": bool(names)}
    more = {word: _fill(word, **values) if some else "" for word, some in there.items()}
    signal = f"        const float signal[{len(names)}] = {{{given}}};\n" if names else ""
    return text + _fill("base", **(values | more | {"signals": signal}))


def write_combine(parts: Parts, name: str) -> str:
    """The C that finds the distance from the training, and bounds, guards and adds."""
    network = parts.network
    kind = "alone" if network.base is None else network.target
    values = {"name": name, "centres": len(network.centres), "inputs": network.shape.inputs}
    return _fill("guard", adding=_fill(kind, **values), **values)


def write_field(parts: Parts, name: str) -> str:
    """The C from what the network gives to the field, by the steps after it."""
    if parts.after is not None:
        return _fill("affine", name=f"{name}_after", into="out", out="field")
    return _fill("same", into="out", out="field")


def write_affine_table(step: Affine | None, name: str, words: str) -> str:
    """A step of a chain beside the network; nothing where there is none."""
    if step is None:
        return ""
    numbers = write_array(np.vstack([step.bias, step.matrix]))
    return _fill("affine_table", words=words, name=name, numbers=numbers)


def write_base_table(parts: Parts, name: str) -> str:
    """What the network adds to; nothing where it stands alone."""
    if parts.base is None:
        return ""
    (rows, columns), names = parts.table.shape, ", ".join(parts.base.signals)
    more = f", and what a unit of {names} adds to each axis" if names else ""
    table = write_array(parts.table)
    text = _fill("base_table", name=name, more=more, rows=rows, columns=columns, table=table)
    if not parts.warm:
        return text
    scale = [parts.base.centre_C, parts.base.half_range_C, *parts.base.clamp_C]
    return text + _fill("base_C", name=name, scale=write_array(scale))


def write_second_table(network: Network, name: str) -> str:
    """The weights of a second hidden layer; nothing where there is none."""
    if network.second is None:
        return ""
    (rows, columns), table = network.second.shape, write_array(network.second)
    return _fill("second_table", name=name, rows=rows, columns=columns, table=table)


def write_guard_table(parts: Parts, name: str) -> str:
    """Where it was trained."""
    network = parts.network
    text = _fill(
        "guard_table",
        name=name,
        rows=len(network.centres),
        inputs=network.shape.inputs,
        centres=write_array(network.centres),
        reach=write_literal(network.reach),
    )
    if network.bound is None:
        return text
    return text + _fill(
        "bound", name=name, unit=network.unit_out, bound=write_literal(network.bound)
    )


def make_network_header(calibration: Calibration, name: str) -> tuple[str, tuple[str, ...]]:
    """The text of the header, and warnings."""
    parts = split_parts(calibration)
    known = make_known_readings(parts)
    network, shape = parts.network, parts.network.shape
    beside = len(parts.beside)
    text = fill_template(
        "headers/network.h.in",
        {
            "name": name,
            "about": write_comment(
                (*write_banner(calibration, _describe(parts)), *_sizes(parts, known))
            ),
            "formula": f"{_formula(parts)}.",
            "unit_out": calibration.unit_out,
            "inputs": str(shape.inputs),
            "each": str(shape.inputs + 1),
            "hidden": str(shape.widths[1]),
            "last": str(shape.widths[-2]),
            "width": str(shape.widths[-2] + 1),
            "second_table": write_second_table(network, name),
            "first": f"    float first[{shape.widths[1]}];\n" if network.second is not None else "",
            "nodes": write_nodes(network, name),
            "outputs": str(shape.outputs),
            "input_names": ", ".join(signals(network.inputs)),
            "input_scale": write_array([network.input_middle, network.input_half]),
            "input_values": ", ".join(_input_values(parts)),
            "U": write_array(network.hidden),
            "V": write_array(network.output),
            "output_middle": write_array(network.output_middle),
            "output_half": write_literal(network.output_half),
            "before_table": write_affine_table(
                parts.before, f"{name}_before", "Before the network"
            ),
            "after_table": write_affine_table(parts.after, f"{name}_after", "After the network"),
            "base_table": write_base_table(parts, name),
            "guard_table": write_guard_table(parts, name),
            "beside_argument": f"const float beside[{beside}], " if beside else "",
            "beside_words": f"   Beside a reading: {', '.join(parts.beside)}.\n" if beside else "",
            "beside_known": "row + 3, " if beside else "",
            "beside_column": "beside, " if beside else "",
            "returns": _returns(parts),
            "read": write_read(parts, name),
            "combine": write_combine(parts, name),
            "write": write_field(parts, name),
            "tests": str(len(known.rows)),
            "columns": str(known.rows.shape[1]),
            "known": write_array(known.rows, "    "),
            "tolerance": format_float32(known.tolerance),
        },
    )
    return text, _warnings(parts)


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
            found.append(write_literal(parts.network.held[name]))
        elif name == "field":
            found += [f"reading[{axis}]" for axis in range(3)]
        else:
            found += [name_beside(parts, one) for one in signals((name,))]
    return found
