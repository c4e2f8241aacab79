"""The magnetic axis and constant of a coil, from current reversals."""

from agonic.alignment.coil.fit import fit_coil
from agonic.alignment.coil.result import CoilFit, Direction, Level

__all__ = ["CoilFit", "Direction", "Level", "fit_coil"]
