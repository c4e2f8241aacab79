"""The magnetic axis and the constant of a coil, from current reversals."""
