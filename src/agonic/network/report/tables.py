"""Tables about a network: hidden nodes, base against network, weights, what it is."""

from __future__ import annotations

from itertools import repeat

import numpy as np

from agonic.calibration.affine import Affine
from agonic.calibration.network import Network
from agonic.calibration.sources import signals
from agonic.maths.equation.network import split
from agonic.network.fit import Comparison, NetworkChoice
from agonic.report.digits import count, group_digits, percent, quantity, with_sd, write_minus
from agonic.report.markup import Markup, markup, table
from agonic.report.section import Block, Table
from agonic.report.tables import NOTHING

MAGNITUDE_ONLY = (
    "Its reference was the magnitude of the field alone. A magnitude cannot show by how much the "
    "field is turned, where the turn varies with its direction: only the length is corrected, "
    "along the field that the base gives, and direction errors of the base stay as they are."
)


def compare_errors(comparison: Comparison, target: str) -> list[Block]:
    """Base and network on the same unseen readings, in nT, and which won by how much."""
    named = {"base": comparison.base, "network": comparison.network}
    rows = [
        [name, quantity(errors.rms, "nT"), quantity(errors.maximum, "nT")]
        for name, errors in named.items()
        if errors is not None
    ]
    of = "rms error on an axis" if target == "vector" else "rms error of the magnitude"
    shown = Table(["Unseen readings", of, "largest"], rows, "nodes")
    if comparison.base is None:
        return [shown]
    by = comparison.directions
    worse = int(np.count_nonzero(by[:, 1] > by[:, 0])) if len(by) else 0
    said = (
        f"{comparison.sentence[:1].upper()}{comparison.sentence[1:]}: "
        f"{percent(comparison.ratio)} of the error of the base is left, a difference of "
        f"{group_digits(comparison.certainty, 1)} of its standard errors over the blocks. In "
        f"{count(worse, 'direction')} of {len(by)} the network is not better."
    )
    return [shown, said]


def list_nodes(choice: NetworkChoice) -> Table:
    """R, largest and rms error by hidden nodes, of all readings and of unseen ones."""
    chosen = choice.fit.calibration.shape.hidden
    rows = []
    for row in choice.table:
        cells = [f"{row.hidden}"]
        for of in ("", "unseen_"):
            errors = (getattr(row, f"{of}{name}") for name in ("maximum", "rms"))
            regression = getattr(row, f"{of}regression")
            cells += [f"{regression:.5f}", *(group_digits(error, 2) for error in errors)]
        rows.append([*cells, "chosen" if row.hidden == chosen else ""])
    if choice.base_rms is not None and choice.base_maximum is not None:
        both = [group_digits(choice.base_maximum, 2), group_digits(choice.base_rms, 2)]
        rows.append(["base", *[NOTHING] * 4, *both, ""])
    head = ["Nodes", "R", "largest, nT", "rms, nT", "unseen R", "unseen largest", "unseen rms", ""]
    return Table(head, rows, "nodes")


def list_weights(network: Network) -> Markup:
    """Every weight with its standard error: from the inputs to the nodes, and on to the outputs."""
    layers, sd = network.layers, network.sd
    sds = [None] * len(layers) if sd is None else split(sd, network.shape)
    names = [[f"node {k + 1}" for k in range(width)] for width in network.shape.widths[1:-1]]
    if len(names) > 1:
        names[1] = [f"second {name}" for name in names[1]]
    ends = ["output x", "output y", "output z"] if network.shape.outputs == 3 else ["output along"]
    into, out = [list(signals(network.inputs)), *names], [*names, ends]
    tables = [
        table(
            [letter, *columns, "constant"],
            [
                [name, *map(with_sd, values[j].tolist(), repeat(None) if own is None else own[j])]
                for j, name in enumerate(rows)
            ],
            class_="weights",
        )
        for letter, columns, rows, values, own in zip(
            "UWV" if len(layers) == 3 else "UV", into, out, layers, sds, strict=True
        )
    ]
    return markup(*tables)


def describe_properties(network: Network) -> dict[str, str | list[str]]:
    """What the network takes, gives, and where it holds."""
    base = network.base
    below = "none: the network gives the whole field"
    if base is not None:
        below = f"{base.kind}, {base.equation}"
    size = network.input_half
    ranges = [
        f"{name}: {group_digits(m - h, _decimals(h))} … {group_digits(m + h, _decimals(h))}"
        for name, m, h in zip(
            signals(network.inputs), network.input_middle.tolist(), size.tolist(), strict=True
        )
    ]
    bound = "none" if network.bound is None else quantity(network.bound, network.unit_out)
    reference = "vector" if network.target == "vector" else "magnitude, along the field only"
    return {
        "Network": f"{network.shape.said} (tanh), {network.shape.size} weights",
        "Base": below,
        "Reference": f"the {reference}",
        "Inputs trained on": ranges,
        "Held at": [f"{name} = {value:g}" for name, value in network.held.items()],
        "Longest correction": bound,
        "Domain": f"{count(len(network.centres), 'point')} cover it, to "
        f"{quantity(network.reach, '', 2)} of half the range of an input",
    }


def _decimals(half: float) -> int:
    return max(0, 2 - int(np.floor(np.log10(half)))) if half < 100 else 0


def list_base_numbers(base: Affine) -> Markup:
    """Bias and matrix of an affine base, with standard errors where they are known."""
    sds = repeat(None) if base.sd is None else base.sd.tolist()
    rows = [[f"bias, {base.unit_in}", *map(with_sd, base.bias.tolist(), sds)]]
    rows += [
        [f"matrix, {axis}", *(write_minus(f"{v:.6f}") for v in base.matrix[k])]
        for k, axis in enumerate("xyz")
    ]
    return table(["Base", "x", "y", "z"], rows, class_="weights")
