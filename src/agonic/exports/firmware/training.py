"""A network that learns on the controller, as C99."""

from __future__ import annotations

from math import ceil
from pathlib import Path
from typing import Any

import numpy as np

from agonic.calibration.affine import Affine
from agonic.calibration.base import Calibration
from agonic.calibration.network import Network
from agonic.calibration.retraining import RetrainerParams
from agonic.errors import AgonicError
from agonic.exports.banner import write_banner
from agonic.exports.firmware import c_text as c
from agonic.exports.firmware.writer import Firmware, write_files

MAX_WEIGHTS = 60
WINDOW_BLOCKS = 50
"""In the window: neighbours err alike."""
CELLS, VISITS = 24, 3
"""Directions of the reservoir, and trainings of which each keeps a reading."""
LEAST_WINDOW, MOST_WINDOW = 100, 20_000
PARTS = ("network", "steps", "calls")


def write_training(
    calibration: Calibration, folder: Path | str, *, window: int = 300, name: str | None = None
) -> Firmware:
    """Write a network as C99 that is trained further on the controller.

        Δω = −(JᵀJ + P + μI)⁻¹ (Jᵀe + P (ω − ω₀))

    over the last readings of which the field was known, a slice a call, in float32 and fixed
    memory. The information of the last training is the prior of the next, loosened by a step of the
    bias whose size is that of the largest evidence; what was learned is taken where it is clearly
    better on readings that come next and on a reservoir of earlier ones. Written are
    `{name}_training.h` and `{name}_training.c`.

    Source: Wang, Sheng, He & Cheng (2020), Eq. 14, doi:10.4236/jcc.2020.86004.
    """
    network = _require_network(calibration)
    prefix = c.make_c_name(network.sensor) if name is None else c.require_identifier(name)
    values = _values(network, prefix, _require_window(network, window))
    return write_files(folder, c.fill_files(f"{prefix}_training", "training", PARTS, values))


def _require_network(calibration: Calibration) -> Network:
    """The network that can be trained on board, or an error that says what it lacks."""
    if not isinstance(calibration, Network):
        raise AgonicError(
            f"this {type(calibration).__name__} has no weights to train on the controller; fit a "
            "network (agonic fit network), or leave the window out"
        )
    base = calibration.base
    lacking = (
        (len(calibration.output) != 3, "has one output along the field; train it on vectors"),
        (calibration.second is not None, "has two hidden layers; train one with a single layer"),
        (calibration.inputs != ("field",), "takes more than the readings; leave the others out"),
        (base is not None and type(base) is not Affine, "has a base that takes more than readings"),
        (calibration.weights.size > MAX_WEIGHTS, f"has more than {MAX_WEIGHTS} weights"),
        (calibration.covariance is None, "states no errors of its weights; fit it again"),
        (calibration.noise is None, "states no noise; fit it again"),
    )
    for wrong, words in lacking:
        if wrong:
            raise AgonicError(f"on the controller this network cannot be trained: it {words}")
    return calibration


def _require_window(network: Network, window: int) -> int:
    """The window in whole blocks."""
    least = max(LEAST_WINDOW, _fewest(network, LEAST_WINDOW))
    if not least <= window <= MOST_WINDOW:
        raise AgonicError(
            f"a window of {window} readings: {network.weights.size} weights take {least} at least, "
            f"and {MOST_WINDOW} are the most"
        )
    return WINDOW_BLOCKS * (window // WINDOW_BLOCKS)


def _fewest(network: Network, window: int) -> int:
    """Readings from which on it is trained: enough for the weights, and eight blocks held out."""
    return max(ceil(1.5 * network.weights.size), WINDOW_BLOCKS // 2 * (window // WINDOW_BLOCKS))


def _values(network: Network, name: str, window: int) -> dict[str, Any]:
    shape, params = network.shape, RetrainerParams()
    assert network.covariance is not None
    assert network.noise is not None
    noise = network.noise / network.output_half
    prior = noise**2 * np.linalg.inv(network.covariance)
    columns = shape.nodes * 4 + shape.nodes + 1
    base = network.base
    formula = "field = base(raw) + network(raw), trained on the controller, float32"
    tables = {} if base is None else {"bias": base.bias, "matrix": base.matrix}
    kind = "none" if base is None else "affine"
    return {
        "name": name,
        "about": c.write_comment(write_banner(network, formula)),
        "unit_in": network.unit_in,
        "unit_out": network.unit_out,
        "outside": ", where the base is all that is left" if base is not None else "",
        "window": window,
        "block": window // WINDOW_BLOCKS,
        "fewest": _fewest(network, window),
        "weights": shape.size,
        "hidden": shape.nodes,
        "gram": columns * (columns + 1) // 2,
        "factor": shape.size * (shape.size + 1) // 2,
        "slice": 8,  # rows that a call takes
        "furthest": params.furthest,
        "furthest_percent": f"{100 * params.furthest:g}",
        "misfit": params.misfit,
        "step_share": params.bias_sd,
        "cells": CELLS,
        "reservoir": CELLS * VISITS,
        "noise": noise,
        "prior": prior[np.tril_indices(shape.size)],
        "input_scale": [network.input_middle, network.input_half],
        "output_middle": network.output_middle,
        "output_half": float(network.output_half),
        "exported": network.weights,
        "limits": [network.centres.min(axis=0), network.centres.max(axis=0)],
        "base": c.fill_template(f"training/base_{kind}.c.in", tables),
    }
