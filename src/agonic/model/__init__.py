"""The one fit of a calibration: what a reading may contain, by evidence (docs/architecture.md)."""
