"""Calibrations aided by raw accelerometer and gyro: for what cannot be turned over."""
