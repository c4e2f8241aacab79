"""A table of columns as the bytes of a Parquet file."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from typing import Any

from agonic.errors import MissingExtraError


def make_parquet(table: Mapping[str, Any]) -> bytes:
    """The columns by header, numbers or texts, compressed."""
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError:
        raise MissingExtraError("writing a Parquet file", "tables") from None
    stream = BytesIO()
    parquet.write_table(pa.table(dict(table)), stream, compression="zstd")
    return stream.getvalue()
