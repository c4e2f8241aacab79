"""What objects show of themselves: text, a page for notebooks, a figure of Matplotlib."""

from agonic.display.documents import draw_page, write_summary
from agonic.display.plots import plot

__all__ = ["draw_page", "plot", "write_summary"]
