"""A whole campaign in a climatic chamber: every sensor calibrated, tested, and compared."""

from agonic.calibrated_campaign.chamber_field import ChamberField, Share, chamber_field
from agonic.calibrated_campaign.from_campaign import calibrate_campaign
from agonic.calibrated_campaign.held_out import HeldOut
from agonic.calibrated_campaign.result import CalibratedCampaign, CalibratedSensor

__all__ = [
    "CalibratedCampaign",
    "CalibratedSensor",
    "ChamberField",
    "HeldOut",
    "Share",
    "calibrate_campaign",
    "chamber_field",
]
