"""What disturbs on board: which of it is in the readings, in which form, and where to sit apart."""
