"""`CompassFault`: which of two compasses disagrees with what both know, since when, by how much."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.health.finding import figure

UNITS = ("magnetometer", "inclinometer")
"""In the order of the groups that tell of them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CompassFault:
    """A fault of one of two compasses.

    Parameters
    ----------
    unit : "magnetometer" or "inclinometer". sensor : the compass it is part of, `None` while the
        log does not tell which of the two. use : the compass whose heading to use, if so.
    began_s, began_sd_s : since when, on the log's clock. seen_s, named_s : when it was seen, and
        when the compass was named, the ends of blocks of three seconds. ended_s : when it was over.
    change : (3,) what this compass reads more than before, less the other's, in body axes: nT; of
        an inclinometer the tilt about the axes ahead and across, degrees, and 0. sd : its standard
        error on an axis.
    """

    unit: str
    sensor: str | None
    use: str | None
    began_s: float
    began_sd_s: float
    seen_s: float
    named_s: float | None
    ended_s: float | None
    change: Array
    sd: float

    @property
    def size(self) -> float:
        """How large the change is, nT or degrees."""
        return float(np.linalg.norm(self.change))

    @property
    def sentence(self) -> str:
        """The fault in words, and which heading to use."""
        unit = "°" if self.unit == "inclinometer" else " nT"
        until = "" if self.ended_s is None else f" until {self.ended_s:.0f} s"
        how = (
            f"since t = {self.began_s:.0f} ± {max(self.began_sd_s, 1.0):.0f} s{until} by "
            f"{figure(self.size)} ± {figure(self.sd)}{unit}"
        )
        if self.sensor is None:
            return (
                f"the {self.unit}s of the two compasses disagree {how}; which is wrong shows when "
                "the vehicle steers other courses: use neither heading until then"
            )
        return f"the {self.unit} of {self.sensor} is off {how}; use the heading of {self.use}"

    def values(self) -> dict[str, Any]:
        """The same for JSON."""
        return vars(self) | {"change": self.change.tolist()}
