"""What there is to choose for the training of a network."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

from agonic.calibration.affine import Affine
from agonic.calibration.inputs import check_inputs
from agonic.calibration.network import require_nodes
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError, check_choice
from agonic.maths.equation.network import Nodes
from agonic.network.maths.levenberg_marquardt import Stopping

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
