"""Where the field points, among the stars and at a place, from an alignment and attitudes."""

from agonic.alignment.direction.compute import field_direction, follow_direction
from agonic.alignment.direction.result import FieldDirection

__all__ = ["FieldDirection", "field_direction", "follow_direction"]
