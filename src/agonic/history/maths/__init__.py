"""Mathematics that only a history uses."""
