"""`Chain`: calibrations applied one after the other."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.errors import AgonicError, FrameError, UnitError
from agonic.provenance import Provenance

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Chain:
    """Steps in the order they are applied; the frame and unit of each meet those of the next.

    >>> from scipy.spatial.transform import Rotation
    >>> turn = Alignment(rotation=Rotation.from_euler("z", 90, degrees=True))
    >>> chain = Chain(steps=(Affine(bias=[1, 0, 0], matrix=np.eye(3)), turn))
    >>> chain.correct([[3.0, 0.0, 0.0]]).round(12)
    array([[0., 2., 0.]])
    """

    kind: ClassVar[str] = "chain"

    steps: tuple[Affine | Alignment, ...]
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

    def correct(self, raw: ArrayLike) -> Array:
        """The field (…, 3) after every step."""
        values = np.asarray(raw, dtype=np.float64)
        for step in self.steps:
            values = step.correct(values)
        return values

    @property
    def multiplied_out(self) -> tuple[Array, Array]:
        """MR (3, 3) and MR0 (3,) of the whole chain, field = MR raw + MR0."""
        offset = self.correct(np.zeros(3))
        return (self.correct(np.eye(3)) - offset).T, offset

    @property
    def unit_in(self) -> str:
        """The unit of the readings that go in."""
        return self.steps[0].unit_in

    @property
    def unit_out(self) -> str:
        """The unit of what comes out."""
        return self.steps[-1].unit_out

    @property
    def frame_in(self) -> str:
        """The axes of the readings that go in."""
        return self.steps[0].frame_in

    @property
    def frame_out(self) -> str:
        """The axes of what comes out."""
        return self.steps[-1].frame_out

    @property
    def sensor(self) -> str:
        """The sensor that the chain starts from."""
        return self.steps[0].sensor

    @property
    def equation(self) -> str:
        """The steps in words, in order."""
        return "; then ".join(step.equation for step in self.steps)
