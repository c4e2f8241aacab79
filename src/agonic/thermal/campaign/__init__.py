"""A campaign in a climatic chamber: planned, described, recorded, and checked against its plan."""

from agonic.thermal.campaign.description import Description, Station
from agonic.thermal.campaign.expected import Expected
from agonic.thermal.campaign.plan import ThermalPlan, plan_thermal
from agonic.thermal.campaign.profile import Profile, Segment
from agonic.thermal.campaign.profile_check import check_campaign
from agonic.thermal.campaign.recording import Campaign
from agonic.thermal.campaign.sensors import MODELS, Model, Sensor
from agonic.thermal.campaign.standard import standard_stations, turn_words

__all__ = [
    "MODELS",
    "Campaign",
    "Description",
    "Expected",
    "Model",
    "Profile",
    "Segment",
    "Sensor",
    "Station",
    "ThermalPlan",
    "check_campaign",
    "plan_thermal",
    "standard_stations",
    "turn_words",
]
