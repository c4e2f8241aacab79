"""`fit_recording`: from one recording of any length, by readings that are drawn evenly from it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Index
from agonic.calibration.base import Validity
from agonic.ellipsoid.fit import fit_ellipsoid
from agonic.errors import AgonicError, LogError
from agonic.fit import Fit
from agonic.health import check_rejected
from agonic.provenance import Input
from agonic.reference import Reference
from agonic.samples import COLUMNS, Samples

Progress = Callable[[str, int], None]

MOST = 100_000
"""Readings that are drawn: by 100 nT of noise they tell a bias to half a nanotesla, which is far
less than the bias of a sensor moves in a recording as long."""


class Strip(Protocol):
    """Some rows as they are stored; `agonic.logs.large.mission.Strip` is one."""

    @property
    def columns(self) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]: ...
    @property
    def factor(self) -> float: ...
    @property
    def time(self) -> Array | None: ...
    @property
    def rejected(self) -> Mapping[str, int]: ...
    def __len__(self) -> int: ...


class Recording(Protocol):
    """Readings strip by strip; `agonic.logs.large.mission.Mission` is one."""

    @property
    def rows(self) -> int: ...
    @property
    def inputs(self) -> tuple[Input, ...]: ...
    def head(self) -> Samples: ...
    def strips(self) -> Iterator[Strip]: ...


class Drawn(NamedTuple):
    """Readings of a recording, one of each stride; of all that it holds how many, why others are
    left out, and the largest on any axis."""

    samples: Samples
    rows: int
    rejected: Mapping[str, int]
    largest: float


def fit_recording(
    recording: Recording,
    reference: Reference | None = None,
    *,
    progress: Progress | None = None,
    **settings: Any,
) -> Fit:
    """`fit_ellipsoid` over a recording of any length, read once, piece by piece.

    The fit is that of `MOST` readings at most, one of each stride, at a random place in it: what
    more of them could tell is far below what lasts, which terms and memory of the noise hold.

    Parameters
    ----------
    recording : what gives the readings: `ag.inflight.open_mission(paths)`.
    reference : one constant magnitude, nT; as in `fit_ellipsoid`.
    progress : called with the name of the pass and the rows done in it.
    settings : those of `fit_ellipsoid`; `seed` is that of the drawing too.

    Returns a `Fit` of the readings drawn. Raises `CoverageError` where nothing can be fitted at
    all, `LogError` where files do not follow each other in time.

    Source: systematic sampling with a random start in each stride (Cochran 1977, chapter 8).

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from agonic.logs.large.mission import open_mission
    >>> from agonic.exports.csv import write_csv
    >>> from agonic.simulation import simulate
    >>> made = simulate("tumble")
    >>> with TemporaryDirectory() as folder:
    ...     path = write_csv(made.samples, Path(folder, "long.csv"))
    ...     fit = fit_recording(open_mission([path]), Reference.constant(50_000))
    >>> fit.n == len(made.samples), fit.ok
    (True, True)
    """
    return fit_recording_and_rows(recording, reference, progress=progress, **settings)[0]


def fit_recording_and_rows(
    recording: Recording,
    reference: Reference | None = None,
    *,
    progress: Progress | None = None,
    **settings: Any,
) -> tuple[Fit, Samples]:
    """`fit_recording`, and the readings drawn from it, a row for each of the fit's residuals."""
    if reference is not None and len(reference.values) > 1:
        raise AgonicError("a recording read in pieces needs one constant reference magnitude")
    drawn = draw(recording, settings.get("seed", 0), progress or (lambda _name, _rows: None))
    fit = fit_ellipsoid(drawn.samples, reference, **settings)
    calibration = replace(
        fit.calibration,
        validity=Validity(largest_reading=drawn.largest),
        provenance=replace(fit.calibration.provenance, inputs=recording.inputs),
    )
    fit = replace(fit, calibration=calibration)
    if len(drawn.samples) < drawn.rows:
        thinned = (
            f"the fit is by {len(drawn.samples)} of {drawn.rows} rows, drawn evenly: more rows "
            f"would hardly reduce the stated error"
        )
        fit = replace(fit, remarks=(*fit.remarks, thinned))
    total = drawn.rows + sum(drawn.rejected.values())
    return fit.with_findings(*check_rejected(drawn.rejected, total)), drawn.samples


def draw(recording: Recording, seed: int, report: Progress) -> Drawn:
    """One reading of each stride, with its time where all are known."""
    wanted = _draw_rows(recording.rows, seed)
    fields, times = [], []
    rejected: Counter[str] = Counter()
    done, largest = 0, 0.0
    head = recording.head()
    for strip in recording.strips():
        rejected.update(strip.rejected)
        if not len(strip):
            continue
        rows = wanted[slice(*np.searchsorted(wanted, (done, done + len(strip))))] - done
        fields.append(np.stack([column[rows] for column in strip.columns], axis=1) * strip.factor)
        if strip.time is not None:
            times.append(strip.time[rows])
        ends = [abs(float(end)) for c in strip.columns for end in (c.min(), c.max())]
        largest = max(largest, max(ends) * strip.factor)
        done += len(strip)
        report("reading", done)
    if not done:
        raise LogError("the recording holds no usable readings")
    columns = dict.fromkeys(COLUMNS) | {
        "field": np.concatenate(fields),
        "time": np.concatenate(times) if len(times) == len(fields) else None,
        "source": replace(head.origin, count=done),
    }
    return Drawn(head.with_columns(**columns, rejected={}), done, dict(rejected), largest)


def _draw_rows(rows: int, seed: int) -> Index:
    """One row of each stride, at random in it: else what turns in step with it would be missed."""
    stride = max(-(-rows // MOST), 1)
    starts = np.arange(0, rows, stride)
    offsets = np.random.default_rng(seed).integers(0, stride, len(starts))
    return np.asarray(np.minimum(starts + offsets, rows - 1))
