"""`Reference`: what the field should have been, with its uncertainty and its source."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agonic.errors import UnitError
from agonic.units import nanotesla_per

Kind = Literal["constant", "magnitude", "vector"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference:
    """The field that the sensor was in, nT.

    `values` is (1,) for a constant magnitude, (n,) for a magnitude per sample, and (n, 3) for a
    vector in `frame`; `sd` is the standard deviation of its error, nT; `source` says who says so.
    """

    kind: Kind
    values: NDArray[np.float64]
    sd: float = 0.0
    source: str = "given"
    frame: str | None = None

    @classmethod
    def constant(
        cls, magnitude: float, *, unit: str = "nT", sd: float = 0.0, source: str = "given"
    ) -> Reference:
        """One magnitude for all samples.

        >>> Reference.constant(49.5, unit="uT").values
        array([49500.])
        """
        return cls._checked("constant", [magnitude], unit, sd, source)

    @classmethod
    def magnitude(
        cls, magnitudes: ArrayLike, *, unit: str = "nT", sd: float = 0.0, source: str = "given"
    ) -> Reference:
        """A magnitude for each sample, (n,)."""
        return cls._checked("magnitude", magnitudes, unit, sd, source)

    @classmethod
    def vector(
        cls,
        vectors: ArrayLike,
        *,
        frame: str,
        unit: str = "nT",
        sd: float = 0.0,
        source: str = "given",
    ) -> Reference:
        """A vector for each sample, (n, 3), in the frame of the given letter."""
        return cls._checked("vector", vectors, unit, sd, source, frame)

    @classmethod
    def _checked(
        cls,
        kind: Kind,
        values: ArrayLike,
        unit: str,
        sd: float,
        source: str,
        frame: str | None = None,
    ) -> Reference:
        array = np.atleast_1d(np.asarray(values, dtype=np.float64)) * nanotesla_per(unit)
        size = np.linalg.norm(array, axis=1) if kind == "vector" else array
        if not np.isfinite(array).all() or (size <= 0).any():
            raise UnitError(f"a reference {kind} must be finite and above zero, in {unit}")
        array.flags.writeable = False
        return cls(kind=kind, values=array, sd=sd, source=source, frame=frame)

    def magnitudes(self, n: int) -> NDArray[np.float64]:
        """The magnitude at each of `n` samples, (n,), or (1,) where it is constant."""
        size = np.linalg.norm(self.values, axis=1) if self.kind == "vector" else self.values
        if len(size) not in (1, n):
            raise UnitError(f"the reference has {len(size)} rows and the samples have {n}")
        return size
