"""Tests of what is not in a fit, and averages over what may not be there."""
