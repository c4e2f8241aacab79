"""Filters and smoothers that go through a record once."""
