"""Calibrations kept over time: how a sensor drifts, when it stepped, whether it left the others."""
