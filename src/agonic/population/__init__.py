"""Many calibrations: the table they make, and what stands out in it."""

from agonic.population.population import Population
from agonic.population.row import Row, Verdict
from agonic.population.table import read_population, write_population

__all__ = ["Population", "Row", "Verdict", "read_population", "write_population"]
