"""Where the field points, among the stars and at a place, from an alignment and attitudes."""

from agonic.alignment.direction.compute import field_direction
from agonic.alignment.direction.follow import Follower, follow_direction
from agonic.alignment.direction.result import FieldDirection

__all__ = ["FieldDirection", "Follower", "field_direction", "follow_direction"]
