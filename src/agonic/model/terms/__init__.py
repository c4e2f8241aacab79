"""The table of terms: what a reading may contain, of the sensor, in time and by direction."""

from agonic.model.terms.sensor import DIRECTION, SENSOR
from agonic.model.terms.time import TIME

HIDDEN = (*SENSOR, *TIME, *DIRECTION)
"""Terms that no column of the log names; steps join from the blocks of time (`gram.STEPS`)."""

__all__ = ["HIDDEN"]
