"""A session: instruments set up at one place in many orientations, and what they read."""
