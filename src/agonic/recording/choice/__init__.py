"""Which fit suits a log, and that fit."""
