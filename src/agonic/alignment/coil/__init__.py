"""The magnetic axis and constant of a coil, from current reversals."""
