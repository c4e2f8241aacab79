"""True heading: from the readings of one or several magnetometers, with its standard error."""

from agonic.headings.compute import heading
from agonic.headings.result import Heading

__all__ = ["Heading", "heading"]
