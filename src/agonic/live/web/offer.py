"""`Offer`: what would be written to the device for a sensor, and what came of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from agonic.calibration.base import Calibration
from agonic.errors import AgonicError
from agonic.live.streams.device import Change, Device
from agonic.live.web.messages import Setting, describe_read_back


class DeviceOffer(NamedTuple):
    """The sensor, its settings in the device, and what is to be said of them."""

    sensor: str = ""
    settings: Sequence[Setting] = ()
    says: str = ""


def make_offer(sensor: str, device: Device, calibration: Calibration) -> DeviceOffer:
    """What would be written to a device."""
    changes, warnings = device.changes(calibration)
    listed = [Setting(change.name, change.old, change.new) for change in changes]
    return DeviceOffer(sensor, listed, ". ".join(warnings))


def write_offer(offer: DeviceOffer, device: Device, calibration: Calibration) -> DeviceOffer:
    """The offer with what the device keeps after writing, or why it was not written."""
    listed = offer.settings
    try:
        changes = [Change(one.name, one.old, one.new) for one in listed]
        read = device.write(changes, calibration)
    except (AgonicError, OSError) as error:
        return offer._replace(says=f"not written: {error}")
    listed = [Setting(one.name, one.old, one.new, read.get(one.name)) for one in listed]
    return DeviceOffer(offer.sensor, listed, describe_read_back(listed))
