"""Bytes with damage, as it happens to files."""

from __future__ import annotations

import numpy as np


def change_bytes(data: bytes, rng: np.random.Generator) -> bytes:
    """The bytes cut, overwritten, with some lost, doubled or put in."""
    if not data:
        return data
    at, size = int(rng.integers(len(data))), int(rng.integers(1, 200))
    noise = rng.integers(0, 256, size).astype(np.uint8).tobytes()
    kinds = (
        data[:at],
        data[:at] + noise[:1] + data[at + 1 :],
        data[:at] + noise + data[at + size :],
        data[:at] + data[at + size :],
        data[:at] + data[at : at + size] * 3 + data[at + size :],
    )
    return kinds[int(rng.integers(len(kinds)))]
