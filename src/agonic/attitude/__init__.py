"""Calibrations taught by the attitude: levelled, vector, and with the interference on board."""
