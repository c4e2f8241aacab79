"""A two-axis compass that turned level: the ellipse that its readings lie on."""
