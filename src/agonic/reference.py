"""`Reference`: what the field should have been, with its uncertainty and its source."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.errors import AgonicError, AgonicWarning, UnitError
from agonic.readable import Readable
from agonic.units import RAW, nanotesla_per

_ONE_PLACE_DEG = 5.0
_LARGEST_NT = 1e15
_ARTIFICIAL_NT = 1e6
"""A millitesla: no field that a compass is in, nor one of a coil for calibrating one."""

Kind = Literal["constant", "magnitude", "horizontal-vertical", "vector"]


def _choose_unit(magnitudes: Array, unit: str | None) -> str:
    """The unit of magnitudes beside readings in a unit: the same.

    They were in nT beside any unit before: such numbers are recognised by their size.
    """
    if unit is None or unit in (RAW, "", "nT"):
        return "nT"
    if not magnitudes.size or float(np.nanmax(magnitudes)) * nanotesla_per(unit) < _ARTIFICIAL_NT:
        return unit
    warnings.warn(
        f"the reference was taken in nT, as before; beside unit={unit!r} a later version will take "
        f"it in {unit}: give it in {unit}, or as Reference.constant(…)",
        AgonicWarning,
        stacklevel=4,
    )
    return "nT"


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference(Readable):
    """The field that the sensor was in, nT.

    `values` is (1,) for a constant magnitude, (n,) for a magnitude per sample, (1 or n, 2) for
    horizontal and vertical intensity, and (1 or n, 3) for a vector in `frame`; `sd` is the standard
    deviation of its error, nT; `source` says who says so.
    """

    kind: Kind
    values: Array
    sd: float = 0.0
    source: str = "given"
    frame: str | None = None

    @classmethod
    def of(cls, given: Reference | ArrayLike | None, unit: str | None = None) -> Reference | None:
        """The reference that was meant: a number is a constant magnitude, (n,) one per sample.

        Parameters: given, a `Reference`, a number, (n,) numbers, or None; `unit` of the readings,
        which numbers have too; default: nT. Raises `AgonicError` for anything else.

        >>> Reference.of(50_000).values, Reference.of(48, "uT").values
        (array([50000.]), array([48000.]))
        """
        if given is None or isinstance(given, Reference):
            return given
        needed = "a Reference, a magnitude in nT, or magnitudes (n,)"
        try:
            array = np.asarray(given, dtype=np.float64)
        except (TypeError, ValueError):
            raise AgonicError(
                f"the reference was given as {type(given).__name__}; needed is {needed}"
            ) from None
        if array.ndim > 1:
            raise AgonicError(
                f"the reference was given with shape {array.shape}; needed is {needed}; a vector "
                "is Reference.vector(values, frame='n')"
            )
        known = _choose_unit(array, unit)
        if array.ndim == 0:
            return cls.constant(float(array), unit=known)
        return cls.magnitude(array, unit=known)

    def _say(self) -> list[str]:
        """Its kind, size and source."""
        size = self.values if self.values.ndim == 1 else np.linalg.norm(self.values, axis=1)
        low, high = float(size.min()), float(size.max())
        span = f"{low:.6g}" if len(size) == 1 or high - low < 0.5 else f"{low:.0f} to {high:.0f}"
        sd = f" ± {self.sd:.3g}" if self.sd else ""
        rows = "" if len(size) == 1 else f", {len(size)} rows"
        return [f"Reference, {self.kind}: {span}{sd} nT{rows} ({self.source})"]

    def describe(self) -> str:
        """Its size and its source, in words.

        >>> Reference.constant(48_000.0, source="WMM2025").describe()
        '48000 nT (WMM2025)'
        """
        f = self.magnitudes(len(self.values))
        size = f"{f[0]:g} nT" if len(f) == 1 else f"{f.min():g} to {f.max():g} nT per sample"
        return f"{size} ({self.source})"

    @classmethod
    def required(cls, given: Reference | ArrayLike | None) -> Reference:
        """As `of`, for a fit that cannot do without one.

        Parameters: given, a `Reference`, a number or (n,) numbers.
        """
        found = cls.of(given)
        if found is None:
            raise AgonicError(
                "this fit needs the field of the place: Reference.horizontal_vertical, or "
                "ag.wmm().along(samples)"
            )
        return found

    @classmethod
    def constant(
        cls, magnitude: float, *, unit: str = "nT", sd: float = 0.0, source: str = "given"
    ) -> Reference:
        """One magnitude for all samples.

        >>> Reference.constant(49.5, unit="uT").values
        array([49500.])
        """
        return cls._make("constant", [magnitude], unit, sd, source)

    @classmethod
    def magnitude(
        cls, magnitudes: ArrayLike, *, unit: str = "nT", sd: float = 0.0, source: str = "given"
    ) -> Reference:
        """`magnitudes` (n,), one for each sample, in `unit`."""
        return cls._make("magnitude", magnitudes, unit, sd, source)

    @classmethod
    def horizontal_vertical(
        cls,
        horizontal: ArrayLike,
        vertical: ArrayLike,
        *,
        unit: str = "nT",
        sd: float = 0.0,
        source: str = "given",
    ) -> Reference:
        """Horizontal and vertical intensity (down positive), one for all samples or one for each.

        Parameters: horizontal (n,) and vertical (n,), or numbers, in `unit`.

        >>> Reference.horizontal_vertical(20_000, 45_000).values
        array([[20000., 45000.]])
        """
        pair = np.stack(np.broadcast_arrays(np.atleast_1d(horizontal), np.atleast_1d(vertical)), 1)
        return cls._make("horizontal-vertical", pair, unit, sd, source)

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
        """`vectors` (n, 3), one for each sample, or (3,) for all, in the frame of a letter."""
        vectors = np.atleast_2d(np.asarray(vectors, dtype=np.float64))
        return cls._make("vector", vectors, unit, sd, source, frame)

    @classmethod
    def _make(
        cls,
        kind: Kind,
        values: ArrayLike,
        unit: str,
        sd: float,
        source: str,
        frame: str | None = None,
    ) -> Reference:
        array = np.atleast_1d(np.asarray(values, dtype=np.float64)) * nanotesla_per(unit)
        size = array if array.ndim == 1 else np.linalg.norm(array, axis=1)
        if not np.isfinite(array).all() or (size <= 0).any():
            raise UnitError(f"a reference {kind} must be finite and above zero, in {unit}")
        if size.min(initial=1.0) < 1e-9 or size.max(initial=1.0) > _LARGEST_NT:
            raise UnitError(
                f"a reference {kind} of {size.min():.3g} to {size.max():.3g} nT is not a magnetic "
                "field; the Earth's is 22 000 to 67 000"
            )
        array.flags.writeable = False
        return cls(kind=kind, values=array, sd=sd, source=source, frame=frame)

    def magnitudes(self, n: int) -> Array:
        """The magnitude at each of `n` samples, (n,), or (1,) where it is constant."""
        size = self.values if self.values.ndim == 1 else np.linalg.norm(self.values, axis=1)
        return _for_rows(size, n)

    def horizontal_and_vertical(self, n: int) -> Array:
        """Horizontal and vertical intensity at each of `n` samples, (n, 2), or (1, 2).

        Raises `UnitError` for a reference that is a magnitude only.
        """
        if self.kind == "horizontal-vertical":
            return _for_rows(self.values, n)
        if self.kind == "vector" and self.frame == "n":
            level = np.hypot(self.values[:, 0], self.values[:, 1])
            return _for_rows(np.stack([level, self.values[:, 2]], axis=1), n)
        raise UnitError(
            f"the reference is a {self.kind} and the horizontal and vertical intensities are "
            "needed: give the place (--at LAT,LON) or Reference.horizontal_vertical(H, Z)"
        )

    @property
    def inclination_deg(self) -> float | None:
        """The dip of the place, where the reference tells it and it is one place.

        >>> Reference.horizontal_vertical(20_000, 20_000).inclination_deg
        45.0
        >>> Reference.constant(50_000).inclination_deg is None
        True
        """
        if self.kind not in ("horizontal-vertical", "vector") or self.frame not in (None, "n"):
            return None
        horizontal, vertical = self.horizontal_and_vertical(len(self.values)).T
        dips = np.degrees(np.arctan2(vertical, horizontal))
        return float(dips.mean()) if np.ptp(dips) < _ONE_PLACE_DEG else None

    def select(self, rows: ArrayLike) -> Reference:
        """The reference of the rows that `rows`, a boolean mask (n,) or indices (k,), names."""
        chosen = np.asarray(rows)
        return self if len(self.values) == 1 else replace(self, values=self.values[chosen])


def _for_rows(values: Array, n: int) -> Array:
    if len(values) not in (1, n):
        raise UnitError(f"the reference has {len(values)} rows and the samples have {n}")
    return values


def as_reference(given: Reference | ArrayLike) -> Reference:
    """The reference that was meant, as `Reference.required` has it."""
    return Reference.required(given)
