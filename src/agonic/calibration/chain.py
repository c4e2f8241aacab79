"""`Chain`: calibrations applied one after the other."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array, Index
from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration, Correction
from agonic.calibration.interference import Interference
from agonic.calibration.network import Network
from agonic.calibration.sources import parse_source
from agonic.calibration.thermal import Thermal
from agonic.calibration.timing import Timing
from agonic.errors import AgonicError, FrameError, UnitError
from agonic.provenance import Provenance

ENDS = ("unit_in", "unit_out", "frame_in", "frame_out", "sensor")
"""What a chain has of its first and last step."""


def _take_from(step: int, name: str, says: str) -> Any:
    """A property that a chain has of its first or last step."""
    return property(lambda chain: getattr(chain.steps[step], name), doc=says)


@dataclass(frozen=True, kw_only=True, eq=False)
class Chain(Correction):
    """Steps in the order they are applied; the frame and unit of each meet those of the next.

    >>> from scipy.spatial.transform import Rotation
    >>> turn = Alignment(rotation=Rotation.from_euler("z", 90, degrees=True))
    >>> chain = Chain(steps=(Affine(bias=[1, 0, 0], matrix=np.eye(3)), turn))
    >>> chain.correct([[3.0, 0.0, 0.0]]).round(12)
    array([[0., 2., 0.]])
    """

    kind: ClassVar[str] = "chain"

    steps: tuple[Affine | Thermal | Network | Alignment, ...]
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        if not self.steps:
            raise AgonicError("a chain needs at least one step")
        for before, after in zip(self.steps, self.steps[1:], strict=False):
            if before.frame_out != after.frame_in:
                raise FrameError(
                    "steps of a chain must meet", left=before.frame_out, right=after.frame_in
                )
            if before.unit_out != after.unit_in:
                raise UnitError(
                    f"steps of a chain must meet: {before.unit_out} into {after.unit_in}"
                )

    @property
    def needs(self) -> tuple[str, ...]:
        """The columns that its steps take beside the readings."""
        return tuple(dict.fromkeys(name for step in self.steps for name in step.needs))

    def correct(self, raw: ArrayLike, **columns: ArrayLike) -> Array:
        """The field (…, 3) after every step.

        Parameters: raw (…, 3) in `unit_in`; columns (…) that are named in `needs`.
        """
        values = np.asarray(raw, dtype=np.float64)
        for step in self.steps:
            values = step.correct(values, **columns)
        return values

    def uncertainty(self, raw: ArrayLike, **columns: ArrayLike) -> Array:
        """Covariance (n, 3, 3) of the field that all steps together contribute.

            C ← M C Mᵀ + C_step,   M = ∂correct/∂raw of each step in turn

        A change that was fitted in flight had the errors of the ground before it as its prior: its
        own covariance is all that is left, and C begins anew there.

        Parameters: raw (n, 3) in `unit_in`; columns (n,) that are named in `needs`. Raises
        `AgonicError` where a step carries no covariance.
        """
        values = np.atleast_2d(np.asarray(raw, dtype=np.float64))
        covariance = np.zeros((len(values), 3, 3))
        for step in self.steps:
            slope = _slope(step, values, columns)
            before = np.zeros_like(covariance) if contains_ground(step) else covariance
            covariance = slope @ before @ np.swapaxes(slope, -1, -2)
            covariance = covariance + step.uncertainty(values, **columns)
            values = step.correct(values, **columns)
        return covariance

    def at(self, temperature_C: float) -> Chain:
        """The chain that this is while the temperature stays at a value, °C.

        >>> Chain(steps=(Affine(bias=[1, 2, 3], matrix=np.eye(3)),)).at(20.0).steps[0].kind
        'affine'
        """
        fixed = tuple(
            step.at(temperature_C) if isinstance(step, Thermal | Network) else step
            for step in self.steps
        )
        return replace(self, steps=fixed)

    @property
    def composed(self) -> Affine:
        """The whole chain as one step, without covariance: an `Interference` where a step is one.

        Raises `AgonicError` where a step depends on temperature, which `at` holds, or is a network.

        Bias and coefficients of a step, seen through the matrix P of all steps before it:

            bias += P⁻¹ bias_i,   coefficients += P⁻¹ coefficients_i,   P ← matrix_i P.

        >>> from scipy.spatial.transform import Rotation
        >>> turn = Alignment(rotation=Rotation.from_euler("z", 90, degrees=True))
        >>> chain = Chain(steps=(Affine(bias=[1, 2, 3], matrix=np.eye(3) * 2), turn))
        >>> chain.composed.bias.round(9).tolist(), chain.composed.matrix.round(9)[0].tolist()
        ([1.0, 2.0, 3.0], [0.0, -2.0, 0.0])
        """
        bias, matrix = np.zeros(3), np.eye(3)
        added: dict[str, Array] = {}
        typical: dict[str, Array] = {}
        affine: list[Affine] = []
        for step in self.steps:
            if isinstance(step, Alignment):
                matrix = step.rotation.as_matrix() @ matrix
                continue
            known = _require_affine(step)
            affine.append(known)
            back = _inverse(matrix)
            bias = bias + back @ known.bias
            for name, block in _blocks(known).items():
                added[name] = added.get(name, np.zeros_like(block)) + back @ block
            typical |= _typical(known)
            matrix = known.matrix @ matrix
        common = {
            "bias": bias,
            "matrix": matrix,
            "gauge": "free",
            "magnitude": affine[-1].magnitude if affine else None,
            "noise": affine[0].noise if affine else None,
            "device_id": affine[0].device_id if affine else None,
            "latency_s": self.latency_s,
            "latency_sd_s": self.latency_sd_s,
            "provenance": self.provenance,
            **{name: getattr(self, name) for name in ENDS},
        }
        if not added:
            return Affine(**common)
        return Interference(
            **common,
            sources=tuple(added),
            coefficients=np.hstack(list(added.values())),
            second_sensor=self.second_sensor,
            typical=(
                np.concatenate([typical[name] for name in added])
                if set(added) <= set(typical)
                else None
            ),
        )

    unit_in = _take_from(0, "unit_in", "The unit of the readings that go in.")
    unit_out = _take_from(-1, "unit_out", "The unit of what comes out.")
    frame_in = _take_from(0, "frame_in", "The axes of the readings that go in.")
    frame_out = _take_from(-1, "frame_out", "The axes of what comes out.")
    sensor = _take_from(0, "sensor", "The sensor that the chain starts from.")

    @property
    def second_sensor(self) -> str | None:
        """The second magnetometer that a step takes into account, if one does and says which."""
        named = (getattr(step, "second_sensor", None) for step in self.steps)
        return next(filter(None, named), None)

    @property
    def timing(self) -> dict[str, Timing]:
        """How the columns that are recorded late or filtered go with what they do, in any step."""
        found: dict[str, Timing] = {}
        for step in self.steps:
            found |= getattr(step, "timing", {})
        return found

    @property
    def latency_s(self) -> float:
        """How late the readings came, by the first step that knows."""
        return next((late for s in self.steps if (late := getattr(s, "latency_s", 0.0))), 0.0)

    @property
    def latency_sd_s(self) -> float | None:
        """The standard error of that, by the first step that knows."""
        known = (getattr(step, "latency_sd_s", None) for step in self.steps)
        return next((sd for sd in known if sd is not None), None)

    @property
    def equation(self) -> str:
        """The steps in words, in order."""
        return "; then ".join(step.equation for step in self.steps)


def _slope(step: Calibration, values: Array, columns: dict[str, ArrayLike]) -> Array:
    """∂correct/∂raw (n, 3, 3) of a step, by central differences: exact where it is linear."""
    small = 1e-3 * max(float(np.abs(values).max(initial=0.0)), 1.0)
    moved = [
        step.correct(values + small * axis, **columns)
        - step.correct(values - small * axis, **columns)
        for axis in np.eye(3)
    ]
    return np.asarray(np.stack(moved, axis=-1) / (2 * small))


def contains_ground(step: Affine | Thermal | Network | Alignment) -> bool:
    """Whether the covariance of a step contains what is left of the errors of those before it."""
    of_flight = isinstance(step, Affine | Thermal) and step.covariance is not None
    return of_flight and step.provenance.settings.get("ground") is not None


def _require_affine(step: Affine | Thermal | Network) -> Affine:
    """The step, which must be bias and matrix."""
    if isinstance(step, Thermal):
        raise AgonicError(
            "a step of this chain changes with temperature, so the chain is no single affine; hold "
            "it at a temperature first: chain.at(20.0).composed"
        )
    if isinstance(step, Network):
        raise AgonicError(
            "a step of this chain is a network, which no bias and matrix can hold; write the chain "
            "as C, or give the base of the network alone"
        )
    return step


def _inverse(matrix: Array) -> Array:
    """The inverse of what the steps before amount to."""
    if np.linalg.matrix_rank(matrix) < 3:
        raise AgonicError("a matrix of this chain is singular, so it has no bias")
    return np.asarray(np.linalg.inv(matrix))


def _blocks(step: Affine) -> dict[str, Array]:
    """The coefficients (3, 1) or (3, 3) of each source of a step."""
    if not isinstance(step, Interference):
        return {}
    blocks = np.split(step.coefficients, _ends(step.sources), axis=1)
    return dict(zip(step.sources, blocks, strict=True))


def _typical(step: Affine) -> dict[str, Array]:
    """What each source of a step was on average, (1,) or (3,), as far as the step says."""
    if not isinstance(step, Interference) or step.typical is None:
        return {}
    return dict(zip(step.sources, np.split(step.typical, _ends(step.sources)), strict=True))


def _ends(sources: tuple[str, ...]) -> Index:
    """Where the signals of each source but the last end."""
    return np.cumsum([parse_source(name).width for name in sources])[:-1]
