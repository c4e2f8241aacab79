"""Calibrating many logs and sensors without anyone watching."""
