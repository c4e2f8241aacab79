"""The logs of many sensors at once.

The public names of this wing, a line each; see `agonic.public`.
"""

from agonic.fleet.run import calibrate_fleet as calibrate_fleet
from agonic.fleet.settings import FleetSettings as FleetSettings
from agonic.population import Population as Population
from agonic.population import read_population as read_population
from agonic.population import write_population as write_population
