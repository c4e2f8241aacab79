"""True heading: from the readings of one or several magnetometers, with its standard error."""
