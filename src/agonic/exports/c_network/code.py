"""The C of a network, from a reading to the field: what the header has for code."""

from __future__ import annotations

from agonic.calibration.network import Network
from agonic.exports.c_network.parts import Parts


def name_beside(parts: Parts, signal: str) -> str:
    """Where the C finds a number that is given beside a reading."""
    return f"beside[{parts.beside.index(signal)}]"


def write_affine(name: str, into: str, out: str) -> str:
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


def write_nodes(network: Network, name: str) -> str:
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


def write_read(parts: Parts, name: str) -> str:
    """The C from the reading to the field by the base."""
    if parts.before is None:
        text = "    for (i = 0; i < 3; i++) {\n        reading[i] = raw[i];\n    }\n"
    else:
        text = write_affine(f"{name}_before", "raw", "reading")
    if parts.base is None:
        return text
    p, count = parts.table.shape
    lines = [f"        float value[{count}];", "        float d[3];"]
    if parts.warm:
        at = name_beside(parts, "temperature")
        lines += [
            f"        const float kept = fminf(fmaxf({at}, {name}_base_C[2]), {name}_base_C[3]);",
            f"        const float t = (kept - {name}_base_C[0]) / {name}_base_C[1];",
            f"        inside = {at} >= {name}_base_C[2] && {at} <= {name}_base_C[3];",
        ]
    if parts.base.signals:
        values = ", ".join(name_beside(parts, signal) for signal in parts.base.signals)
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


def write_combine(parts: Parts, name: str) -> str:
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


def write_field(parts: Parts, name: str) -> str:
    """The C from what the network gives to the field, by the steps after it."""
    if parts.after is not None:
        return write_affine(f"{name}_after", "out", "field")
    return "    for (i = 0; i < 3; i++) {\n        field[i] = out[i];\n    }\n"
