"""A session: instruments set up at one place in many orientations, and what they read."""

from agonic.alignment.session.earth import load_earth_rotation
from agonic.alignment.session.observed import Observed, observe
from agonic.alignment.session.session import (
    Mounting,
    Pier,
    Session,
    Site,
    StarReadings,
    check_session,
)

__all__ = [
    "Mounting",
    "Observed",
    "Pier",
    "Session",
    "Site",
    "StarReadings",
    "check_session",
    "load_earth_rotation",
    "observe",
]
