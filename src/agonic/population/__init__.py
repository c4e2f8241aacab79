"""Many calibrations: the table they make, and what stands out in it."""

from agonic.population.comparable import Compared, compare
from agonic.population.duplicate import Duplicate, find_duplicates
from agonic.population.outlier import Outlier, find_outliers
from agonic.population.population import Population
from agonic.population.row import Row
from agonic.population.store import History, SensorSummary
from agonic.population.table import read_population, write_population

__all__ = [
    "Compared",
    "Duplicate",
    "History",
    "Outlier",
    "Population",
    "Row",
    "SensorSummary",
    "compare",
    "find_duplicates",
    "find_outliers",
    "read_population",
    "write_population",
]
