"""The C of a network, from a reading to the field: what the header has for code."""

from __future__ import annotations

from agonic.calibration.network import Network
from agonic.exports.c_network.parts import Parts
from agonic.exports.firmware.c_text import fill_template


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
    powers, count = parts.table.shape
    names = parts.base.signals
    values = {
        "name": name,
        "count": str(count),
        "last": str(powers - 1),
        "at": name_beside(parts, "temperature") if parts.warm else "",
        "signals": str(len(names)),
    }

    def part(word: str, there: bool) -> str:
        return fill_template(f"headers/network_{word}.h.in", values) if there else ""

    given = ", ".join(name_beside(parts, signal) for signal in names)
    more = {
        "warm": part("warm", parts.warm),
        "powers": part("powers", powers > 1),
        "sources": part("sources", bool(names)),
        "signals": f"        const float signal[{len(names)}] = {{{given}}};\n" if names else "",
    }
    return text + fill_template("headers/network_base.h.in", values | more)


def write_combine(parts: Parts, name: str) -> str:
    """The C that finds the distance from the training, and bounds, guards and adds."""
    network = parts.network
    kind = "alone" if network.base is None else network.target
    values = {
        "name": name,
        "centres": str(len(network.centres)),
        "inputs": str(network.shape.inputs),
    }
    values["adding"] = fill_template(f"headers/network_{kind}.h.in", values)
    return fill_template("headers/network_guard.h.in", values)


def write_field(parts: Parts, name: str) -> str:
    """The C from what the network gives to the field, by the steps after it."""
    if parts.after is not None:
        return write_affine(f"{name}_after", "out", "field")
    return "    for (i = 0; i < 3; i++) {\n        field[i] = out[i];\n    }\n"
