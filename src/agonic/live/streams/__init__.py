"""Where live readings come from: serial ports, network, vehicles, logs replayed, a simulation."""

from agonic.live.streams.events import Chunk, Notice, Words
from agonic.live.streams.source import Source, open_source

__all__ = ["Chunk", "Notice", "Source", "Words", "open_source"]
