"""Calibrate over temperature, in a climatic chamber.

The public names of this wing, a line each; see `agonic.public`.
"""

from agonic.calibration.thermal import Thermal as Thermal
from agonic.thermal.all_sensors import calibrate_campaign as calibrate_campaign
from agonic.thermal.campaign.recording import Campaign as Campaign
from agonic.thermal.checks.programme import check_campaign as check_campaign
from agonic.thermal.document import campaign_page as campaign_page
from agonic.thermal.files.read import read_campaign as read_campaign
from agonic.thermal.files.write import write_campaign as write_campaign
from agonic.thermal.fit.fit import fit_thermal as fit_thermal
from agonic.thermal.fit.result import ThermalFit as ThermalFit
from agonic.thermal.plan.plan import plan_thermal as plan_thermal
from agonic.thermal.result import CalibratedCampaign as CalibratedCampaign
from agonic.thermal.simulation.campaign import simulate_campaign as simulate_campaign
