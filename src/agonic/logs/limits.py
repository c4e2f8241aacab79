"""How much memory the values of a file may take, and the check of what it declares."""

from __future__ import annotations

from agonic.errors import LogError

MOST_BYTES = 500_000_000
"""Bytes of values that a file read into memory may hold; longer tables are read as Parquet."""
MOST_COMPRESSION = 1100
"""No file holds more than so many bytes of values for one of its own (deflate: 1032)."""
_SMALL = 1_000_000


def check_declared(declared: int, stored: int, what: str = "it") -> None:
    """Raise `LogError` where values would take more memory than is given to a file.

    Parameters: `declared`, bytes of the values; `stored`, bytes they have in the file.

    >>> check_declared(40_000_000_000, 1900)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    agonic.errors.LogError: it declares 40 GB of values and stores 1900 bytes of them: damaged, ...
    """
    if declared > MOST_BYTES:
        raise LogError(
            f"{what} declares {declared / 1e9:.3g} GB of values and stores {stored} bytes of them: "
            f"damaged, or too long for memory ({MOST_BYTES / 1e9:g} GB); cut it, or make it Parquet"
        )
    if declared > max(_SMALL, MOST_COMPRESSION * stored):
        raise LogError(
            f"{what} declares {declared / 1e6:.3g} MB of values and stores {stored} bytes of them: "
            "damaged, or nothing was written there; fetch it again"
        )
