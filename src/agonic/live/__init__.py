"""Calibrating while a sensor is being turned: what is covered, how good it is, what to do next."""
