"""What is said and shown of a network: how it was trained, and what it does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.base import Calibration, select_columns
from agonic.calibration.chain import Chain
from agonic.calibration.network import Network
from agonic.calibration.sources import signals
from agonic.maths.equation.network import split
from agonic.network.fit import Method, NetworkChoice, NetworkFit
from agonic.network.fit.solve import correlate
from agonic.network.report import figures
from agonic.readable import make_record
from agonic.report import tables as common
from agonic.report.digits import count, each_with_sd, group_digits, percent, quantity, write_minus
from agonic.report.document import Document
from agonic.report.fields import make_table
from agonic.report.figure import Figure
from agonic.report.markup import Markup, markup, table
from agonic.report.section import Block, Section, Table, aside
from agonic.report.tables import NOTHING
from agonic.report.verdict import sentence
from agonic.samples import Samples
from agonic.verification import Verification


def evaluate_fit(fit: NetworkFit, samples: Samples) -> tuple[Array, Array]:
    """The network's field and the known one, (n, o), nT, of the readings that took part."""
    network, used = fit.calibration, fit.weights > 0
    field, _ = network.evaluated(samples.field, select_columns(network, samples))
    if network.target == "magnitude":
        field = np.linalg.norm(field, axis=1, keepdims=True)
    return field[used], (field - fit.residuals)[used]


def correlate_axes(found: Array, known: Array) -> list[float]:
    """R of each axis, between the network's field and the known one, (n, o)."""
    return [correlate(a, b) for a, b in zip(found.T, known.T, strict=True)]


def draw_axes(found: Array, known: Array) -> list[Figure]:
    """The network's field over the known one, a figure an axis, as the paper draws it."""
    names = ("x", "y", "z") if known.shape[1] == 3 else ("the field",)
    pairs = zip(known.T, found.T, names, strict=True)
    return [figures.draw_regression(*pair) for pair in pairs]


KIND = "Calibration by a network"


def describe_network(
    fit: NetworkFit,
    samples: Samples,
    *,
    choice: NetworkChoice | None = None,
    methods: Sequence[Method] = (),
    title: str = "",
) -> Document:
    """A trained network, or its base where that is as good, with the table that it was chosen from
    and the methods of training that were compared, if there are any.
    """
    network = fit.calibration
    chosen = "the network" if fit.chosen is network else f"the base ({fit.chosen.kind})"
    fields = evaluate_fit(fit, samples)
    note = "All from the same random start, on all readings, without a prior on the weights."
    tried = compare(fit, methods, "Error after each epoch, by method", note) if methods else []
    return Document.judge(
        fit,
        schema="agonic/fit-network@1",
        kind=KIND,
        name=samples.name,
        title=title,
        method=f"network of {network.shape.said} by the {network.target}, {fit.n} readings",
        about=f"Chosen: {chosen}.",
        key_figures=_key_figures(fit),
        entries={"Chosen": f"{chosen}; {choice.sentence}" if choice else chosen},
        entries_title="",
        sections=[
            _compare(fit, samples),
            Section("Hidden nodes", _list_choice(choice) if choice else [], printed=True),
            Section("Training", [lambda: figures.draw_training(fit)]),
            Section("Methods of training", tried, printed=True),
            Section("Regression", [lambda: draw_axes(*fields)], style="pair"),
            caution(network),
            _guard(network, network, samples),
            *_numbers(network),
        ],
        values=_list_values(fit, samples, choice, methods)
        | {"regression_of_axes": correlate_axes(*fields)},
        calibration=fit.chosen,
        samples=samples,
        styles=("network.css",),
    )


def _list_values(
    fit: NetworkFit, samples: Samples, choice: NetworkChoice | None, methods: Sequence[Method]
) -> dict[str, Any]:
    network, comparison = fit.calibration, fit.comparison
    base = None if comparison is None else comparison.base
    return {
        "method": "network",
        "sensor": samples.name,
        **make_record(fit),
        "hidden": network.shape.hidden,
        "inputs": list(network.inputs),
        "target": network.target,
        "chosen": "network" if fit.chosen is network else "base",
        "calibration_kind": fit.chosen.kind,
        "unseen_rms_nT": None if comparison is None else comparison.network.rms,
        "unseen_base_rms_nT": None if base is None else base.rms,
        "bound_nT": network.bound,
        "table": [asdict(row) for row in choice.table] if choice else None,
        "methods": [make_record(method) for method in methods] or None,
    }


def describe_network_file(
    calibration: Calibration,
    network: Network,
    *,
    title: str = "",
    samples: Samples | None = None,
    verification: Verification | None = None,
) -> Document:
    """A calibration file that is a network, or has one as a step, and what it does to readings."""
    sections = []
    if samples is not None and verification is not None:
        sections = [
            Section("On the log", [common.checks(verification)]),
            _guard(calibration, network, samples),
        ]
    return Document(
        kind=KIND,
        name=calibration.sensor,
        title=title,
        sections=[*sections, caution(network), *_numbers(network)],
        calibration=calibration,
        samples=samples,
        styles=("network.css",),
    )


def caution(network: Network) -> Section:
    """What a network that knows the magnitude alone cannot correct."""
    said = (
        "Its reference was the magnitude of the field alone. A magnitude cannot show by how much "
        "the field is turned, where the turn varies with its direction: only the length is "
        "corrected, along the field that the base gives, and direction errors of the base stay as "
        "they are."
    )
    blocks = [] if network.target == "vector" else [said]
    return Section("What the magnitude does not determine", blocks)


def _key_figures(fit: NetworkFit) -> list[tuple[str, str, str]]:
    comparison, size = fit.comparison, fit.calibration.shape.size
    of = "rms on an axis" if fit.calibration.target == "vector" else "rms of the magnitude"
    errors = [("Residual", fit.rms, f"{of}, trained on")]
    if comparison is not None:
        errors = [("Unseen, network", comparison.network.rms, of)]
        if comparison.base is not None:
            errors.append(("Unseen, base", comparison.base.rms, of))
    return [
        *((name, quantity(value, "nT"), note) for name, value, note in errors),
        ("Trained in", count(fit.iterations, "epoch"), count(fit.n, "reading")),
        ("Weights determined", group_digits(fit.effective, 1), f"of {size}, by the evidence"),
    ]


def _compare(fit: NetworkFit, samples: Samples) -> Section:
    """Base and network on the same unseen readings, and which won by how much."""
    comparison = fit.comparison
    if comparison is None:
        return Section("", [])
    draw = partial(figures.draw_unseen_error, comparison, samples.time)
    rows = [
        [name, quantity(errors.rms, "nT"), quantity(errors.maximum, "nT")]
        for name, errors in (("base", comparison.base), ("network", comparison.network))
        if errors is not None
    ]
    of = "on an axis" if fit.calibration.target == "vector" else "of the magnitude"
    blocks: list[Block] = [Table(["Unseen readings", f"rms error {of}", "largest"], rows, "nodes")]
    if comparison.base is None:
        return Section("Unseen readings", [*blocks, draw])
    by = comparison.directions
    blocks.append(
        f"{sentence(comparison.sentence).removesuffix('.')}: {percent(comparison.ratio)} of the "
        f"error of the base is left, a difference of {group_digits(comparison.certainty, 1)} of "
        "its standard errors over the blocks. In "
        f"{count(int(np.count_nonzero(by[:, 1] > by[:, 0])), 'direction')} of {len(by)} the "
        "network is not better."
    )
    return Section("Base against network", [*blocks, draw])


def _list_choice(choice: NetworkChoice) -> list[Block]:
    """R, largest and rms error by hidden nodes, of all readings and of unseen ones."""
    chosen, rows = choice.fit.calibration.shape.hidden, []
    for row in choice.table:
        cells = [f"{row.hidden}"]
        for of in ("", "unseen_"):
            r, *errors = (getattr(row, f"{of}{n}") for n in ("regression", "maximum", "rms"))
            cells += [f"{r:.5f}", *(group_digits(error, 2) for error in errors)]
        rows.append([*cells, "chosen" if row.hidden == chosen else ""])
    if choice.base_rms is not None and choice.base_maximum is not None:
        both = [group_digits(choice.base_maximum, 2), group_digits(choice.base_rms, 2)]
        rows.append(["base", *[NOTHING] * 4, *both, ""])
    head = ["Nodes", "R", "largest, nT", "rms, nT", "unseen R", "unseen largest", "unseen rms", ""]
    said = (
        f"{sentence(choice.sentence)} Unseen: each of four blocks is judged by a network trained "
        "on the other three."
    )
    return [Table(head, rows, "nodes"), said]


def compare(fit: NetworkFit, methods: Sequence[Method], title: str, note: str) -> list[Block]:
    """Levenberg–Marquardt beside gradient descent: a table, and a figure with its title and
    note."""
    draw = partial(figures.draw_methods, fit, methods, title, note)
    return [make_table(methods, style="nodes"), draw]


def _guard(calibration: Calibration, network: Network, samples: Samples) -> Section:
    """How many readings are like those it was trained on, and what the others get."""
    raw = samples.field
    if isinstance(calibration, Chain):
        for step in calibration.steps[: calibration.steps.index(network)]:
            raw = step.correct(raw, **select_columns(step, samples))
    share = network.inside(raw, **select_columns(network, samples))
    of = f"{percent(float((share < 0.5).mean()))} of {count(len(share), 'reading')} lie so far from"
    said = (
        "half of its correction or more is taken back; far away the base alone corrects. "
        f"{percent(float((share > 0.999).mean()))} get all of it."
    )
    if network.base is None:
        said = "its field is a guess: there is no base to fall back to."
    drawn = figures.draw_guard(share, samples.time)
    return Section("Where it holds", [f"{of} what the network was trained on that {said}", drawn])


def _numbers(network: Network) -> list[Section]:
    """What the network takes, gives and where it holds; its base, and every weight."""
    base, bound, shown = network.base, network.bound, []
    middles = zip(
        signals(network.inputs),
        network.input_middle.tolist(),
        network.input_half.tolist(),
        strict=True,
    )
    reference = "vector" if network.target == "vector" else "magnitude, along the field only"
    properties = {
        "Network": f"{network.shape.said} (tanh), {network.shape.size} weights",
        "Base": f"{base.kind}, {base.equation}"
        if base is not None
        else "none: the network gives the whole field",
        "Reference": f"the {reference}",
        "Inputs trained on": [
            f"{name}: {group_digits(m - h, _decimals(h))} … {group_digits(m + h, _decimals(h))}"
            for name, m, h in middles
        ],
        "Held at": [f"{name} = {value:g}" for name, value in network.held.items()],
        "Longest correction": "none" if bound is None else quantity(bound, network.unit_out),
        "Domain": f"{count(len(network.centres), 'point')} cover it, to "
        f"{quantity(network.reach, '', 2)} of half the range of an input",
    }
    shown.append(common.definitions({k: v for k, v in properties.items() if v}))
    if isinstance(base, Affine):
        rows = [[f"bias, {base.unit_in}", *each_with_sd(base.bias, base.sd)]]
        rows += [
            [f"matrix, {axis}", *(write_minus(f"{v:.6f}") for v in line)]
            for axis, line in zip("xyz", base.matrix, strict=True)
        ]
        shown.append(table(["Base", "x", "y", "z"], rows, class_="weights"))
    said = "± is one standard error. Inputs and outputs are scaled to −1 … 1."
    weights = [_list_weights(network), aside(said)]
    return [Section("The network", shown), Section("Weights", weights)]


def _list_weights(network: Network) -> Markup:
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
                [name, *each_with_sd(values[j], None if own is None else own[j])]
                for j, name in enumerate(rows)
            ],
            class_="weights",
        )
        for letter, columns, rows, values, own in zip(
            "UWV" if len(layers) == 3 else "UV", into, out, layers, sds, strict=True
        )
    ]
    return markup(*tables)


def _decimals(half: float) -> int:
    return max(0, 2 - int(np.floor(np.log10(half)))) if half < 100 else 0
