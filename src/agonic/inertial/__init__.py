"""Calibrations beside raw accelerometer and gyro, in motion, or accelerometer alone, at rest."""
