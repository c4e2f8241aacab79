"""The rotation between a magnetometer and a star sensor, from a session of many orientations."""
