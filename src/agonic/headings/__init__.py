"""True heading: from the readings of one or several magnetometers, with its standard error."""

from agonic.headings.from_samples import heading
from agonic.headings.record import Heading

__all__ = ["Heading", "heading"]
