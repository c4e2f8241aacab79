"""Where live readings come from: serial ports, network, vehicles, logs replayed, a simulation."""

from agonic.live.streams.events import Chunk, Event, Said
from agonic.live.streams.opened import Source, open_source

__all__ = ["Chunk", "Event", "Said", "Source", "open_source"]
