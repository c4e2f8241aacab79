"""Many calibrations: the table they make, and what stands out in it."""

from agonic.population.duplicate import Compared, Duplicate, compare, find_duplicates
from agonic.population.outlier import Outlier, find_outliers
from agonic.population.population import Population, Row
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
