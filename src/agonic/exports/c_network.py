"""The C header of a network: `write_c` writes it, base, domain guard and all.

    field = base(raw) + g(x) · clip(middle + half · V [tanhf(U [x, 1]), 1]),   float32

g is 1 near the readings it was trained on and 0 from twice that distance, where the base is all
that is left; steps of a chain before and after it are a bias and a matrix each.
"""

from __future__ import annotations

from agonic.calibration.base import Calibration
from agonic.calibration.inputs import signals
from agonic.calibration.network import Network
from agonic.exports.banner import format_float32, write_banner
from agonic.exports.c_network_parts import Parts, split_parts
from agonic.exports.c_network_selftest import Known, make_known_readings
from agonic.exports.c_network_tables import (
    write_affine_table,
    write_base_table,
    write_guard_table,
    write_second_table,
)
from agonic.exports.firmware.c_text import (
    fill_template,
    write_array,
    write_comment,
    write_flash,
    write_literal,
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
            "GUARD": name.upper(),
            "about": write_comment(
                (*write_banner(calibration, _describe(parts)), *_sizes(parts, known))
            ),
            "flash": write_flash(),
            "formula": f"{_formula(parts)}.",
            "unit_out": calibration.unit_out,
            "inputs": str(shape.inputs),
            "each": str(shape.inputs + 1),
            "hidden": str(shape.widths[1]),
            "last": str(shape.widths[-2]),
            "width": str(shape.widths[-2] + 1),
            "second_table": write_second_table(network, name),
            "first": f"    float first[{shape.widths[1]}];\n" if network.second is not None else "",
            "nodes": _nodes(network, name),
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
            "read": _read(parts, name),
            "combine": _combine(parts, name),
            "write": _write(parts, name),
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
            found += [_beside(parts, one) for one in signals((name,))]
    return found


def _beside(parts: Parts, signal: str) -> str:
    return f"beside[{parts.beside.index(signal)}]"


def _affine_code(name: str, into: str, out: str) -> str:
    """out = matrix (into − bias), in place where they are the same."""
    left = ", ".join(f"{into}[{k}] - {name}[0][{k}]" for k in range(3))
    return (
        "    {\n"
        f"        const float d[3] = {{{left}}};\n"
        "        for (i = 0; i < 3; i++) {\n"
        f"            const float *row = {name}[i + 1];\n"
        f"            {out}[i] = row[0] * d[0] + row[1] * d[1] + row[2] * d[2];\n"
        "        }\n"
        "    }\n"
    )


def _nodes(network: Network, name: str) -> str:
    """The C from the inputs x through the hidden nodes, each of which adds its part to `added`."""
    widths = network.shape.widths
    add = (
        f"        for (i = 0; i < {widths[-1]}; i++) {{\n"
        f"            added[i] += AGONIC_READ({name}_V[i][k]) * sum;\n"
        "        }\n"
    )
    if network.second is None:
        return _layer(f"{name}_U", "x", widths[0], widths[1], add)
    first = _layer(f"{name}_U", "x", widths[0], widths[1], "        first[k] = sum;\n")
    return first + _layer(f"{name}_W", "first", widths[1], widths[2], add)


def _layer(table: str, into: str, inputs: int, nodes: int, then: str) -> str:
    """The C of a hidden layer; `then` is what becomes of each node's `sum`."""
    return f"""\
    for (k = 0; k < {nodes}; k++) {{
        float sum = AGONIC_READ({table}[k][{inputs}]);
        for (i = 0; i < {inputs}; i++) {{
            sum += AGONIC_READ({table}[k][i]) * {into}[i];
        }}
        sum = tanhf(sum);
{then}    }}
"""


def _read(parts: Parts, name: str) -> str:
    """The C from the reading to the field by the base."""
    if parts.before is None:
        text = "    for (i = 0; i < 3; i++) {\n        reading[i] = raw[i];\n    }\n"
    else:
        text = _affine_code(f"{name}_before", "raw", "reading")
    if parts.base is None:
        return text
    p, count = parts.table.shape
    lines = [f"        float value[{count}];", "        float d[3];"]
    if parts.warm:
        at = _beside(parts, "temperature")
        lines += [
            f"        const float kept = fminf(fmaxf({at}, {name}_base_C[2]), {name}_base_C[3]);",
            f"        const float t = (kept - {name}_base_C[0]) / {name}_base_C[1];",
            f"        inside = {at} >= {name}_base_C[2] && {at} <= {name}_base_C[3];",
        ]
    if parts.base.signals:
        values = ", ".join(_beside(parts, signal) for signal in parts.base.signals)
        lines.append(f"        const float signal[{len(parts.base.signals)}] = {{{values}}};")
    lines += [
        f"        for (i = 0; i < {count}; i++) {{",
        f"            value[i] = AGONIC_READ({name}_base[{p - 1}][i]);",
    ]
    if p > 1:
        lines += [
            f"            for (k = {p - 2}; k >= 0; k--) {{",
            f"                value[i] = value[i] * t + AGONIC_READ({name}_base[k][i]);",
            "            }",
        ]
    lines += [
        "        }",
        "        for (i = 0; i < 3; i++) {",
        "            d[i] = reading[i] - value[i];",
    ]
    if parts.base.signals:
        s = len(parts.base.signals)
        lines += [
            f"            for (k = 0; k < {s}; k++) {{",
            f"                d[i] -= value[12 + {s} * i + k] * signal[k];",
            "            }",
        ]
    lines += [
        "        }",
        "        for (i = 0; i < 3; i++) {",
        "            const float *row = value + 3 + 3 * i;",
        "            out[i] = row[0] * d[0] + row[1] * d[1] + row[2] * d[2];",
        "        }",
    ]
    return text + "    {\n" + "\n".join(lines) + "\n    }\n"


def _combine(parts: Parts, name: str) -> str:
    """The C that finds the distance from the training, and bounds, guards and adds."""
    network = parts.network
    return f"""\
    {{
        float nearest = 0.0f;
        float s;
        for (k = 0; k < {len(network.centres)}; k++) {{
            float square = 0.0f;
            for (i = 0; i < {network.shape.inputs}; i++) {{
                const float d = x[i] - AGONIC_READ({name}_centres[k][i]);
                square += d * d;
            }}
            if (k == 0 || square < nearest) {{
                nearest = square;
            }}
        }}
        s = sqrtf(nearest) / {name}_reach - 1.0f;
        if (!(s < 1.0f)) {{ /* also where an input is not a number */
            s = 1.0f;
        }} else if (s < 0.0f) {{
            s = 0.0f;
        }}
{_adding(network, name)}        inside = inside && s <= 0.5f;
    }}
"""


def _adding(network: Network, name: str) -> str:
    """The C that makes the field of base and correction."""
    if network.base is None:
        return "        for (i = 0; i < 3; i++) {\n            out[i] = added[i];\n        }\n"
    lines = [
        "        if (s < 1.0f) {",
        "            float g = 1.0f - s * s * (3.0f - 2.0f * s);",
        "            float size = 0.0f;",
        f"            for (i = 0; i < {network.shape.outputs}; i++) {{",
        "                size += added[i] * added[i];",
        "            }",
        "            size = sqrtf(size);",
        f"            if (size > {name}_bound) {{",
        f"                g *= {name}_bound / size;",
        "            }",
    ]
    onto = "out[i] += g * added[i];"
    if network.target == "magnitude":
        lines += [
            "            size = sqrtf(out[0] * out[0] + out[1] * out[1] + out[2] * out[2]);",
            "            g *= size > 0.0f ? added[0] / size : 0.0f;",
        ]
        onto = "out[i] += g * out[i];"
    lines += [
        "            for (i = 0; i < 3; i++) {",
        f"                {onto}",
        "            }",
        "        }",
    ]
    return "\n".join(lines) + "\n"


def _write(parts: Parts, name: str) -> str:
    if parts.after is not None:
        return _affine_code(f"{name}_after", "out", "field")
    return "    for (i = 0; i < 3; i++) {\n        field[i] = out[i];\n    }\n"
