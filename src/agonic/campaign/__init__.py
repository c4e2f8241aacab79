"""A campaign in a climatic chamber: planned, described, recorded, and checked against its plan."""

from agonic.campaign.description import Description, Station
from agonic.campaign.expected import Expected
from agonic.campaign.followed import check_campaign
from agonic.campaign.plan import ThermalPlan, plan_thermal
from agonic.campaign.profile import Profile, Segment
from agonic.campaign.recording import Campaign
from agonic.campaign.sensors import MODELS, Model, Sensor
from agonic.campaign.standard import standard_stations, turn_words

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
