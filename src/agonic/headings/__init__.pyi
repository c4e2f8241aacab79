"""Headings, the deviation of a compass, and its card.

The public names of this wing, a line each; see `agonic.public`.
"""

from agonic.calibration.deviation import Deviation as Deviation
from agonic.calibration.monitoring import MonitorParams as MonitorParams
from agonic.calibration.monitoring import derive_monitor_params as derive_monitor_params
from agonic.calibration.setup import Compass as Compass
from agonic.calibration.setup import Setup as Setup
from agonic.files.setup import load_setup as load_setup
from agonic.files.setup import save_setup as save_setup
from agonic.headings.compute import heading as heading
from agonic.headings.deviation import DeviationFit as DeviationFit
from agonic.headings.deviation import SwingPlan as SwingPlan
from agonic.headings.deviation import fit_deviation as fit_deviation
from agonic.headings.deviation import plan_swing as plan_swing
from agonic.headings.deviation.card import card_text as card_text
from agonic.headings.deviation.document import card_page as card_page
from agonic.headings.files.swing import read_swing as read_swing
from agonic.headings.monitor.result import CompassFault as CompassFault
from agonic.headings.monitor.watch import CompassReadings as CompassReadings
from agonic.headings.monitor.watch import watch_compasses as watch_compasses
from agonic.headings.result import Heading as Heading
