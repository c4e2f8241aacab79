"""Where a record changes: moments, stretches, states."""
