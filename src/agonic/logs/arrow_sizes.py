"""How many bytes the buffers of an Arrow file say that they unpack to, before any is unpacked.

The library makes room for what a packed buffer declares; a file of a megabyte may declare all the
memory there is. Source: Apache Arrow, Message.fbs; FlatBuffers, internals: a table begins with the
distance back to the places of its fields.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

from agonic.errors import LogError

_DICTIONARY, _BATCH = 2, 3
_KIND, _HEADER = 1, 2
_DATA = 1
_BUFFERS, _COMPRESSION = 2, 3
_BUFFER = struct.Struct("<qq")


def count_unpacked_bytes(pa: Any, source: Any) -> int:
    """The bytes that all packed buffers of a stream of messages declare; 0 where none is packed.

    Parameters: `pa`, the module pyarrow; `source`, a file of it at the first message.

    Raises `LogError` where a message is not what it states.
    """
    try:
        return sum(_count(message) for message in _messages(pa, source))
    except (struct.error, IndexError, pa.ArrowException) as error:
        raise LogError(f"damaged: a message in it is not whole ({error}); fetch it again") from None


def _messages(pa: Any, source: Any) -> Iterator[Any]:
    """The messages up to the mark that ends them; what is behind it, a footer, is none."""
    reader = pa.ipc.MessageReader.open_stream(source)
    while True:
        try:
            yield reader.read_next_message()
        except (StopIteration, EOFError):
            return


def _count(message: Any) -> int:
    """The bytes that the packed buffers of one message declare."""
    data = bytes(message.metadata)
    root = _follow(data, 0)
    kind = data[at] if (at := _field(data, root, _KIND)) else 0
    if kind not in (_DICTIONARY, _BATCH):
        return 0
    batch = _follow(data, _field(data, root, _HEADER))
    if kind == _DICTIONARY:
        batch = _follow(data, _field(data, batch, _DATA))
    if not _field(data, batch, _COMPRESSION) or not (at := _field(data, batch, _BUFFERS)):
        return 0
    buffers = _follow(data, at)
    (count,) = struct.unpack_from("<I", data, buffers)
    listed = data[buffers + 4 : buffers + 4 + _BUFFER.size * count]
    if len(listed) != _BUFFER.size * count:
        raise IndexError("a list of buffers")
    body, total = memoryview(message.body), 0
    for offset, length in _BUFFER.iter_unpack(listed):
        if length:
            if min(offset, length) < 0 or offset + length > len(body):
                raise IndexError("a buffer")
            total += max(0, *struct.unpack_from("<q", body, offset))
    return total


def _follow(data: bytes, at: int) -> int:
    """Where the distance that stands at a place leads."""
    return at + int(struct.unpack_from("<I", data, at)[0])


def _field(data: bytes, table: int, number: int) -> int:
    """Where a field of a table stands; 0 where it has none."""
    places = table - struct.unpack_from("<i", data, table)[0]
    if places < 0:
        raise IndexError("a table")
    (size,) = struct.unpack_from("<H", data, places)
    at = 4 + 2 * number
    if at + 2 > size:
        return 0
    offset = struct.unpack_from("<H", data, places + at)[0]
    return table + offset if offset else 0
