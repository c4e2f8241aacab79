"""True north by a gyrotheodolite, carried to a magnetometer, and absolute measurements."""
