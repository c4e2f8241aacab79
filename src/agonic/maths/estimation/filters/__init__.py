"""Filters that go through a record once."""
