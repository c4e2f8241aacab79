"""What the tests of the alignment share: sessions with wrong clocks, names of findings."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta

import numpy as np

from agonic.alignment.session.session import Session
from agonic.alignment.star_sensor.result import AlignmentFit

MATRIX = np.eye(3) + 1e-3 * np.array([[1.0, 2, 3], [2, -4, 5], [3, 5, 6]])


def names(fit: AlignmentFit) -> set[str]:
    """Of the findings."""
    return {finding.name for finding in fit.findings}


def at_other_times(session: Session, seconds: float) -> Session:
    """All three clocks so far off."""
    later = timedelta(seconds=seconds)
    moved = {
        name: (own := getattr(session, name)).with_columns(epoch=own.epoch + later)
        for name in ("magnetometer", "reference")
    }
    star = replace(session.star, time=session.star.time + seconds)
    return replace(session, star=star, **moved)
