"""The magnetic axis and constant of a coil, from current reversals."""

from agonic.alignment.coil.fit import fit_coil
from agonic.alignment.coil.result import CoilFit

__all__ = ["CoilFit", "fit_coil"]
