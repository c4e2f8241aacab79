"""The C header of a network: its parts, tables, code and self-test."""
