"""From samples and reference to what a training takes: rows, inputs, what the field was."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.calibration.affine import Affine
from agonic.calibration.network import require_nodes
from agonic.calibration.sources import check_inputs, measure_width, stack_inputs
from agonic.calibration.thermal import Thermal
from agonic.calibration.timing import restore
from agonic.errors import AgonicError, CoverageError, FrameError, LogError, check_choice
from agonic.health import find_usable_rows
from agonic.maths.equation.network import Nodes, Shape
from agonic.maths.estimation.series import compute_rates
from agonic.maths.rotations.attitude import rot_nb
from agonic.network.fit.base import BaseFit, Ends, fit_magnitudes, fit_vectors
from agonic.network.maths.levenberg_marquardt import Stopping
from agonic.reference import Reference
from agonic.samples import Samples

Target = Literal["vector", "magnitude"]
Base = Affine | Thermal | Literal["affine"] | None


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The settings of a training; see `fit_network`."""

    hidden: Nodes = 3
    inputs: tuple[str, ...] = ("field",)
    base: Base = "affine"
    target: Target = "vector"
    stopping: Stopping = "bayesian"
    robust: bool = True
    restarts: int = 4
    most_epochs: int = 300
    seed: int = 0

    def __post_init__(self) -> None:
        check_choice("target", self.target, get_args(Target))
        check_choice("stopping", self.stopping, get_args(Stopping))
        object.__setattr__(self, "inputs", tuple(self.inputs))
        object.__setattr__(self, "hidden", require_nodes(self.hidden))
        check_inputs(self.inputs)
        if not (self.base is None or isinstance(self.base, Affine | Thermal | str)):
            raise AgonicError(
                f"base is a {type(self.base).__name__}; give an Affine, an Interference or a "
                'Thermal, "affine" to fit one, or None'
            )
        if isinstance(self.base, str):
            check_choice("base", self.base, ("affine",))
        if self.base is None and self.target == "magnitude":
            raise AgonicError(
                'target="magnitude" determines a length and no direction, so it needs a base'
            )
        for name in ("restarts", "most_epochs"):
            if getattr(self, name) < 1:
                raise AgonicError(f"{name} is {getattr(self, name)}; it must be at least 1")

    def to_record(self) -> Mapping[str, Any]:
        """The settings for the provenance."""
        base = self.base if isinstance(self.base, str | None) else self.base.kind
        return {
            "fit": "network",
            **vars(self),
            "hidden": self.hidden if isinstance(self.hidden, int) else list(self.hidden),
            "inputs": list(self.inputs),
            "base": base,
        }


FEWEST = 40
PER_WEIGHT = 1.0
"""At least so many readings for each weight of the network."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """Everything that a training needs, of all rows.

    `inputs` (n, i) as they are; `columns` beside the readings; `wanted` (n, 3) in the axes of the
    result, or (n, 1) magnitudes; `rows` (n,) those that take part.
    """

    samples: Samples
    inputs: Array
    columns: dict[str, Array]
    wanted: Array
    rows: Mask
    ends: Ends
    source: str
    sd: float
    settings: Settings

    def fit_base(self, rows: Index) -> BaseFit:
        """The base that was given, or an affine one from some of the rows."""
        given = self.settings.base
        if not isinstance(given, str):
            return BaseFit(given)
        raw, wanted = self.samples.field[rows], self.wanted[rows]
        if self.settings.target == "vector":
            return fit_vectors(raw, wanted, self.ends, robust=self.settings.robust)
        return fit_magnitudes(
            raw, wanted[:, 0], self.ends, robust=self.settings.robust, seed=self.settings.seed
        )

    def select_columns(self, rows: Index) -> dict[str, Array]:
        """The columns that inputs and base take, of some of the rows."""
        return {name: values[rows] for name, values in self.columns.items()}

    def apply_base(self, base: Affine | Thermal | None, rows: Index) -> Array:
        """The field (n, 3) by the base, or zeros without one."""
        if base is None:
            return np.zeros((len(rows), 3))
        needed = {name: self.columns[name][rows] for name in base.needs}
        return base.correct(self.samples.field[rows], **needed)


def pose_problem(samples: Samples, reference: Reference, settings: Settings) -> Problem:
    """The problem that samples and reference pose, or a clear error."""
    base = settings.base if not isinstance(settings.base, str) else None
    columns = _columns(samples, settings, base)
    ends_in = samples.frame if base is None else base.frame_out
    wanted, frame_out = find_known_field(samples, reference, settings.target, ends_in)
    ends = Ends(samples.name, samples.unit, samples.frame, frame_out, samples.device_id)
    if base is not None:  # it corrects these readings into these axes
        if (base.unit_in, base.frame_in) != (ends.unit_in, ends.frame_in):
            raise FrameError(
                f"the base corrects readings in {base.unit_in}, axes {base.frame_in}; these are "
                f"in {ends.unit_in}",
                left=base.frame_in,
                right=ends.frame_in,
            )
        if base.frame_out != ends.frame_out:
            raise FrameError(
                "the base and the known field must be in the same axes",
                left=base.frame_out,
                right=ends.frame_out,
            )
    rows = find_usable_rows(samples.field)
    if samples.flagged is not None:
        rows &= samples.flagged == 0
    inputs = stack_inputs(settings.inputs, samples.field, columns)
    _require_enough(rows, inputs, settings)
    return Problem(
        samples=samples,
        inputs=inputs,
        columns=columns,
        wanted=wanted,
        rows=rows,
        ends=ends,
        source=reference.source,
        sd=reference.sd,
        settings=settings,
    )


def _columns(
    samples: Samples, settings: Settings, base: Affine | Thermal | None
) -> dict[str, Array]:
    """The columns that inputs and base take, or an error that names the missing ones."""
    there = samples.columns()
    if {"time", "temperature"} <= set(there):
        there["temperature_rate"] = compute_rates(there["time"], there["temperature"])
    needs = () if base is None else base.needs
    wanted = [*(name for name in settings.inputs if name != "field"), *needs]
    missing = [name for name in wanted if name not in there]
    if missing:
        raise LogError(
            f"{samples.name}: the samples have no {', '.join(missing)}; record it with the "
            "magnetometer, or leave it out of inputs"
        )
    at_rows = restore(there, getattr(base, "timing", {}))
    return {name: at_rows[name] for name in wanted}


def compute_errors(field: Array, wanted: Array) -> Array:
    """How far fields (n, 3) are from vectors (n, 3), or from magnitudes (n, 1), nT."""
    if wanted.shape[1] == 3:
        return field - wanted
    return np.asarray(np.linalg.norm(field, axis=1, keepdims=True) - wanted)


def find_known_field(
    samples: Samples, reference: Reference, target: Target, frame: str
) -> tuple[Array, str]:
    """The field (n, 3) or magnitude (n, 1) known at each reading, and its axes: fixed to sensor or
    body, or `frame`, those that a magnitude leaves as they are."""
    n = len(samples)
    if target == "magnitude":
        return np.array(np.broadcast_to(reference.magnitudes(n), n))[:, None], frame
    if reference.kind != "vector":
        raise AgonicError(
            f'the reference is a {reference.kind} and target="vector" needs its components: give '
            'Reference.vector, or train with target="magnitude"'
        )
    if len(reference.values) not in (1, n):
        raise AgonicError(f"the reference has {len(reference.values)} rows and the samples {n}")
    values = np.broadcast_to(reference.values, (n, 3))
    if reference.frame in ("m", "b"):
        return np.array(values), reference.frame
    if reference.frame != "n":
        raise FrameError(
            "the known field must be in the axes of the sensor (m), of the body (b), or north-"
            "east-down (n) with the attitude beside it",
            left=str(reference.frame),
            right="m",
        )
    roll, pitch, heading = samples.roll_deg, samples.pitch_deg, samples.heading_deg
    if roll is None or pitch is None or heading is None:
        raise LogError(
            f"{samples.name}: a field north-east-down needs roll, pitch and heading beside the "
            'readings; give the field in sensor axes, or train with target="magnitude"'
        )
    return np.einsum("nji,nj->ni", rot_nb(roll, pitch, heading), values), "b"


def _require_enough(rows: Mask, inputs: Array, settings: Settings) -> None:
    outputs = 3 if settings.target == "vector" else 1
    count = Shape(inputs.shape[1], settings.hidden, outputs).size
    needed = max(FEWEST, int(PER_WEIGHT * count))
    if rows.sum() < needed:
        raise CoverageError(
            f"{int(rows.sum())} usable readings cannot determine a network of {count} weights",
            turns=f"record at least {needed}, or take fewer hidden nodes",
        )
    at = 0
    for name in settings.inputs:
        values = inputs[rows, at : at + measure_width(name)]
        at += measure_width(name)
        if np.ptp(values, axis=0).max() <= 1e-12 * np.abs(values).max():
            raise CoverageError(
                f"{name} never changes, so what it does to the readings cannot be learned",
                turns=f"record while it changes, or leave {name} out of inputs",
            )
