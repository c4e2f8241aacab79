"""Clocks that nobody set: the moment with which a clock begins is no date of a log."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import numpy as np

from agonic.samples import Samples

_BEGINNINGS = [
    datetime(1970, 1, 1, tzinfo=UTC),  # Unix
    datetime(1980, 1, 1, tzinfo=UTC),  # MS-DOS, and files on memory cards
    datetime(1980, 1, 6, tzinfo=UTC),  # GPS
]
_RUNNING = timedelta(days=2)  # that it may have run for


def leave_out_date(samples: Samples) -> Samples:
    """The readings without their date, where it is the one that an unset clock has.

    A log with positions keeps it: what tells the place tells the time as well.

    >>> never = Samples(field=[[0, 0, 1.0]], time=[60.0], epoch=datetime(1970, 1, 1, tzinfo=UTC))
    >>> leave_out_date(never).notes
    ('the clock was not set, it says 1970-01-01: the log has no date',)
    """
    if samples.epoch is None or samples.latitude_deg is not None or not len(samples):
        return samples
    seconds = 0.0 if samples.time is None else float(np.nan_to_num(samples.time[0]))
    if not any(
        timedelta(0) <= samples.epoch - beginning + timedelta(seconds=seconds) < _RUNNING
        for beginning in _BEGINNINGS
    ):
        return samples
    said = f"the clock was not set, it says {samples.epoch:%Y-%m-%d}: the log has no date"
    return samples.with_columns(epoch=None, notes=(*samples.notes, said))
