"""Where the field points, among the stars and at a place, from an alignment and attitudes."""
