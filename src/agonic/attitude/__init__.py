"""Calibrations aided by attitude: levelled, vector, and with the interference on board."""
