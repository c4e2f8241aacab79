"""Samples from and to data frames of pandas, and a calibration applied to one."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC
from typing import Any

import numpy as np

from agonic.calibration.base import Calibration
from agonic.calibration.base import apply as apply_to_samples
from agonic.errors import AgonicError, MissingExtraError
from agonic.exports.csv import make_table
from agonic.logs.any_form import as_samples
from agonic.logs.headers.columns import identify_columns
from agonic.logs.headers.quantities import canonical_header
from agonic.samples import Samples
from agonic.units import RAW, nanotesla_per


def from_pandas(frame: Any, *, unit: str | None = None) -> Samples:
    """The samples in a data frame, whose columns are named as in a text table.

    Parameters: frame, with an index of moments or a column of times; `unit` of the readings where
    no column names it.

    >>> from_pandas({"mag_x_uT": [20.0], "mag_y_uT": [0.0], "mag_z_uT": [43.0]}).field.tolist()
    [[20000.0, 0.0, 43000.0]]
    """
    if isinstance(frame, Samples) or not hasattr(frame, "keys"):
        raise AgonicError(
            f"from_pandas takes a data frame and was given {type(frame).__name__}; for an array "
            "there is ag.Samples(field=array, unit=...)"
        )
    return as_samples(frame, unit)


def to_pandas(samples: Samples) -> Any:
    """The samples as a data frame, its columns named as in a text table.

    Parameters: `samples`; where their epoch is known, moments are the index.

    Raises `MissingExtraError` without pandas.

    >>> import pytest
    >>> _ = pytest.importorskip("pandas")
    >>> to_pandas(Samples(field=[[1.0, 2.0, 3.0]])).columns.tolist()
    ['mag_x_nT', 'mag_y_nT', 'mag_z_nT']
    """
    if not isinstance(samples, Samples):
        raise AgonicError(f"to_pandas takes Samples and was given {type(samples).__name__}")
    try:
        import pandas  # type: ignore[import-not-found,import-untyped,unused-ignore]
    except ImportError:
        raise MissingExtraError("a data frame", "pandas") from None
    table = make_table(samples)
    if samples.epoch is None or samples.time is None:
        return pandas.DataFrame(table)
    begun = samples.epoch if samples.epoch.tzinfo else samples.epoch.replace(tzinfo=UTC)
    spans = pandas.to_timedelta(samples.time, unit="s")
    index = pandas.DatetimeIndex(pandas.Timestamp(begun) + spans, name="time")
    said = {canonical_header("time"), canonical_header("epoch")}
    kept = {name: column for name, column in table.items() if name not in said}
    return pandas.DataFrame(kept, index=index)


def apply(calibration: Calibration, samples: Any) -> Any:
    """The samples, or the data frame, with the field corrected.

    Parameters
    ----------
    calibration : as `load` gives it, a fit, or the path of a calibration file.
    samples : `Samples`, or the path of a recording, which come back in the unit and frame that the
        calibration gives; a data frame, which keeps its index, columns and their unit; or an array
        of readings in the unit of the calibration, which gives an array.

    Raises `UnitError` and `FrameError` where calibration and samples do not meet, and `LogError`
    where a column is missing that the calibration needs.

    >>> from agonic.calibration.affine import Affine
    >>> apply(Affine(bias=[1, 0, 0], matrix=np.eye(3)), Samples(field=[[3.0, 0, 4]])).field
    array([[2., 0., 4.]])
    """
    if not isinstance(samples, Samples) and hasattr(calibration, "correct"):
        if hasattr(samples, "columns") and hasattr(samples, "index"):
            return _apply_to_frame(calibration, samples)
        if isinstance(samples, np.ndarray | Sequence) and not isinstance(samples, str):
            return calibration.correct(samples)
        samples = as_samples(samples)
    return apply_to_samples(calibration, samples)


def _apply_to_frame(calibration: Calibration, samples: Any) -> Any:
    """A copy of a data frame with the readings of its magnetometer corrected, in their unit."""
    fields = identify_columns(map(str, samples)).get("field", {}).values()
    whole = [axes for axes in fields if len(axes) == 3]
    if len(whole) != 1:
        raise AgonicError(
            f"the data frame holds {len(whole)} magnetometers and one is needed: columns such as "
            "mag_x_nT, mag_y_nT, mag_z_nT"
        )
    headers = [whole[0][axis].header for axis in "xyz"]
    finite = np.isfinite(samples[headers].to_numpy(dtype=float)).all(axis=1)
    unit = whole[0]["x"].unit or RAW
    given = RAW if calibration.unit_in == RAW or unit != RAW else "nT"
    rows = from_pandas(samples[finite], unit=None if unit != RAW else given)
    if len(rows) != int(finite.sum()):
        why = ", ".join(rows.rejected)
        raise AgonicError(f"{int(finite.sum()) - len(rows)} rows cannot be used: {why}; fix them")
    field = apply_to_samples(calibration, rows).field
    back = 1.0 if unit == RAW else nanotesla_per(unit)
    corrected = samples.copy()
    corrected[headers] = np.nan
    corrected.loc[finite, headers] = field / back
    return corrected
