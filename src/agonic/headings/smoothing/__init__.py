"""Headings from all rows: what compass and gyro tell together, forwards and backwards in time."""
