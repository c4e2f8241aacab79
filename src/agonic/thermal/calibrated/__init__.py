"""A whole campaign in a climatic chamber: every sensor calibrated, tested, and compared."""

from agonic.thermal.calibrated.chamber_field import ChamberField, Share, chamber_field
from agonic.thermal.calibrated.from_campaign import calibrate_campaign
from agonic.thermal.calibrated.held_out import HeldOut
from agonic.thermal.calibrated.result import CalibratedCampaign, CalibratedSensor

__all__ = [
    "CalibratedCampaign",
    "CalibratedSensor",
    "ChamberField",
    "HeldOut",
    "Share",
    "calibrate_campaign",
    "chamber_field",
]
