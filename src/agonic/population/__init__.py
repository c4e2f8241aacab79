"""Many calibrations: the table they make, and what stands out in it."""

from agonic.population.comparable import Compared, compare
from agonic.population.duplicate import Duplicate, duplicates
from agonic.population.outlier import Outlier, outliers
from agonic.population.peers import Peers
from agonic.population.population import Population
from agonic.population.row import Row
from agonic.population.store import History, Kept
from agonic.population.table import read_population, write_population

__all__ = [
    "Compared",
    "Duplicate",
    "History",
    "Kept",
    "Outlier",
    "Peers",
    "Population",
    "Row",
    "compare",
    "duplicates",
    "outliers",
    "read_population",
    "write_population",
]
