"""The map of a region.

The public names of this wing, a line each; see `agonic.public`.
"""

from agonic.region.fit import fit_map as fit_map
from agonic.region.result import FieldAt as FieldAt
from agonic.region.result import FieldMap as FieldMap
