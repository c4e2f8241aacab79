"""Networks for sensors that are not affine, and their retraining.

The public names of this wing, a line each; see `agonic.public`.
"""

from agonic.calibration.network import Network as Network
from agonic.calibration.retraining import RetrainerParams as RetrainerParams
from agonic.calibration.retraining import RetrainerState as RetrainerState
from agonic.calibration.retraining import Retraining as Retraining
from agonic.network.fit import Method as Method
from agonic.network.fit import NetworkChoice as NetworkChoice
from agonic.network.fit import NetworkFit as NetworkFit
from agonic.network.fit import choose_network as choose_network
from agonic.network.fit import compare_methods as compare_methods
from agonic.network.fit import fit_network as fit_network
from agonic.network.retraining import Retrainer as Retrainer
