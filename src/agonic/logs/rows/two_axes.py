"""Whether a magnetometer of two axes may be read: only by what knows what to do without z.

Everything else would take the zeros that stand for z for readings.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_allowed: ContextVar[bool] = ContextVar("allowed", default=False)


@contextmanager
def allow_two_axes() -> Iterator[None]:
    """Read magnetometers of x and y alone, in logs that hold no other, while this lasts.

    >>> with allow_two_axes():
    ...     are_two_axes_allowed()
    True
    """
    token = _allowed.set(True)
    try:
        yield
    finally:
        _allowed.reset(token)


def are_two_axes_allowed() -> bool:
    """Whether magnetometers of x and y alone are read."""
    return _allowed.get()
