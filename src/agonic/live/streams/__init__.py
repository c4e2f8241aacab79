"""Where live readings come from: serial ports, network, vehicles, logs replayed, a simulation."""

from agonic.live.streams.events import Chunk, Notice
from agonic.live.streams.source import Source, open_source

__all__ = ["Chunk", "Notice", "Source", "open_source"]
