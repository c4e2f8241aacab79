"""The magnetic axis and constant of a coil, from current reversals."""

from agonic.fitting.coil.from_session import fit_coil
from agonic.fitting.coil.record import CoilFit, Direction, Level

__all__ = ["CoilFit", "Direction", "Level", "fit_coil"]
