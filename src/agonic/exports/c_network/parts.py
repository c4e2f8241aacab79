"""A calibration with a network in it, in the parts that a C header holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.base import Calibration
from agonic.calibration.chain import Chain
from agonic.calibration.inputs import signals
from agonic.calibration.interference import Interference
from agonic.calibration.network import Network
from agonic.calibration.steps import steps_of
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError
from agonic.exports.polynomials import Polynomials, fit_polynomials, make_constant


@dataclass(frozen=True, kw_only=True, eq=False)
class Parts:
    """A network as the header holds it: what is before and after it, and the base's polynomials."""

    network: Network
    before: Affine | None
    after: Affine | None
    base: Polynomials | None

    @property
    def beside(self) -> tuple[str, ...]:
        """The numbers that are given beside a reading, in order."""
        return signals(self.network.needs) if self.network.needs else ()

    @property
    def table(self) -> Array:
        """(p, 12 + 3 s): bias, matrix and coefficients of the base, a row a power of warmth."""
        assert self.base is not None
        p = len(self.base.bias)
        parts = (self.base.bias, self.base.matrix, self.base.coefficients)
        return np.concatenate([part.reshape(p, -1) for part in parts], axis=1)

    @property
    def warm(self) -> bool:
        """Whether the base changes with temperature."""
        return isinstance(self.network.base, Thermal)

    @property
    def constants(self) -> int:
        """How many float32 the header holds, its self-test left out."""
        network = self.network
        count = network.weights.size + 2 * network.shape.inputs + network.shape.outputs + 1
        count += network.centres.size + 1
        if self.base is not None:
            count += self.table.size + 1 + (4 if self.warm else 0)
        return count + 12 * sum(step is not None for step in (self.before, self.after))


def hold_network(calibration: Calibration, temperature_C: float) -> Calibration:
    """The calibration held at a temperature, °C; an error where it does not depend on one."""
    if "temperature" not in calibration.needs:
        raise AgonicError(
            f"the calibration of {calibration.sensor} does not change with temperature; leave the "
            "temperature out"
        )
    held: Calibration = calibration.at(temperature_C)  # type: ignore[attr-defined]
    return held


def split_parts(calibration: Calibration) -> Parts:
    """The network with what is before and after it.

    Raises `AgonicError` where a step beside it is no bias and matrix.
    """
    steps = steps_of(calibration)
    at = [k for k, step in enumerate(steps) if isinstance(step, Network)]
    if len(at) > 1:
        raise AgonicError("the header holds one network and this chain has more; export each alone")
    network = steps[at[0]]
    assert isinstance(network, Network)
    before, after = (_one(steps[part]) for part in (slice(0, at[0]), slice(at[0] + 1, None)))
    base = network.base
    found = (
        fit_polynomials(base)
        if isinstance(base, Thermal)
        else None
        if base is None
        else make_constant(base)
    )
    return Parts(network=network, before=before, after=after, base=found)


def _one(steps: tuple[object, ...]) -> Affine | None:
    """Steps as one bias and matrix; None without any."""
    if not steps:
        return None
    if any(isinstance(step, Thermal | Interference) for step in steps):
        raise AgonicError(
            "a step beside the network takes temperature or sources into account, which the header "
            "has no place for; make that step the base of the network: fit_network(base=...)"
        )
    return Chain(steps=steps).composed  # type: ignore[arg-type]
