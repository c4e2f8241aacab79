"""Which rows of columns are usable: finite numbers of the right shape, with increasing time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array, Mask
from agonic.errors import LogError, UnitError
from agonic.units import NANOTESLA_PER

LARGEST_FIELD = 1e15
"""Readings (nT, or raw) beyond it are garbage; a million tesla, or 50 bits of raw counts."""

EARTH_NT = (15_000.0, 95_000.0)
"""What a sensor reads of the Earth's field at its surface, its own bias included, nT."""

VECTORS = ("field", "acceleration", "rotation_rate", "second")
"""The columns of three numbers a row."""


def check_column(name: str, values: ArrayLike | None) -> Array | None:
    """A column as float64 of the right shape, or a clear error; a copy, where it may be changed."""
    if values is None:
        return None
    try:
        array = (np.asarray if _is_constant(values) else np.array)(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise LogError(f"{name} does not hold numbers ({error})") from None
    wanted = "(n, 3)" if name in VECTORS else "(n,)"
    fits = array.ndim == 2 and array.shape[1] == 3 if name in VECTORS else array.ndim == 1
    if not fits:
        raise LogError(f"{name} has shape {array.shape}; it needs {wanted}, a row a sample")
    return array


def _is_constant(values: ArrayLike) -> bool:
    """Whether nothing changes an array any more: read-only, and of no other that could be."""
    return isinstance(values, np.ndarray) and values.base is None and not values.flags.writeable


def check_axes(axes: str, field: Array | None) -> None:
    """Raise `LogError` for other axes than there can be, or readings along one that is not."""
    if axes != "xy":
        raise LogError(f'axes is {axes!r}; it is "xyz", or "xy" of a two-axis compass')
    if field is not None and field[:, 2].any():
        raise LogError("a two-axis compass reads nothing along z; write zeros there")


def refuse_other_unit(field: Array | None) -> None:
    """Raise `UnitError` where readings without a unit have the Earth's size in another than nT."""
    if field is None or not len(field):
        return
    with np.errstate(over="ignore", invalid="ignore"):
        size = (
            float(np.nanmedian(np.sqrt((field**2).sum(axis=1)))) if np.isfinite(field).any() else 0
        )
    low, high = EARTH_NT
    for name in ("uT", "mG", "G", "T"):
        if low <= size * NANOTESLA_PER[name] <= high:
            raise UnitError(
                f"no unit was given, and readings of about {size:.2g} look like {name}: give "
                f"unit={name!r}, or 'nT' or 'raw' if they are that"
            )


def find_usable(columns: Mapping[str, Array | None], factor: float) -> tuple[Mask, dict[str, int]]:
    """The rows of usable numbers and with increasing time, and why the others are not.

    `factor` makes nanotesla of the field.
    """
    present = {name: c for name, c in columns.items() if c is not None}
    keep = np.ones(len(present["field"]), dtype=bool)
    rejected: dict[str, int] = {}
    for name, values in present.items():
        if (
            len(values)
            and np.isfinite(extent := max(-values.min(), values.max()))
            and (name not in ("field", "second") or extent <= LARGEST_FIELD / max(factor, 1.0))
        ):
            continue  # a NaN is the least and the greatest of its array
        finite = np.isfinite(values).all(axis=tuple(range(1, values.ndim)))
        if not finite.all():
            rejected[f"NaN or infinite {name}"] = int((keep & ~finite).sum())
            keep &= finite
        if name in ("field", "second"):
            most = LARGEST_FIELD / max(factor, 1.0)
            sane = np.asarray((np.abs(values) <= most).all(axis=1)) | ~finite
            if not sane[keep].all():
                rejected[f"{name} beyond what any sensor gives"] = int((keep & ~sane).sum())
                keep &= sane
    time = present.get("time")
    if time is not None and keep.any() and not (time[1:] > time[:-1]).all():
        latest = np.maximum.accumulate(np.where(keep, time, -np.inf))
        increasing = np.ones(len(time), dtype=bool)
        increasing[1:] = time[1:] > latest[:-1]
        late = keep & ~increasing
        if late.any():
            rejected["time does not increase"] = int(late.sum())
            keep &= increasing
    return keep, rejected
