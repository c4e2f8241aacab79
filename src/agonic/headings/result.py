"""`Heading`: the headings of a log, how far to trust each, and why not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.headings.monitor.result import CompassFault
from agonic.readable import Readable

EACH_ROW = "each row by itself"
SMOOTHED = "smoothed with the gyro"
FLAGS: Mapping[str, str] = MappingProxyType(
    {
        "no reading": "no magnetometer was read at that time",
        "no attitude": "roll and pitch are not known",
        "tilted": "the vehicle is tilted too far for its nose to have a heading",
        "vertical field": "the field is nearly vertical: near a magnetic pole",
        "disturbed": "the field is not the one that is expected there",
        "unsure tilt": "the vehicle accelerates, turns or rocks: its tilt is not known to 5°",
        "disagreement": "two sensors differ by more than their errors, neither clearly disturbed",
    }
)
"""Why a heading may mean nothing, in the order of `Heading.flags`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Heading(Readable):
    """Headings, a row a sample, 0…360° clockwise; NaN where there is none.

    Parameters
    ----------
    time : (n,) s, or `None` as in the samples.
    compass_deg : (n,) what the compass used reads, from its field and the tilt.
    magnetic_deg : (n,) compass + deviation. true_deg : (n,) magnetic + declination.
    sd_deg : (n,) standard error of `true_deg`: noise, calibration, tilt, deviation, declination.
    random_sd_deg : (n,) the part of it that the noise of the sensor makes, new in every row; the
        rest lasts and does not average out.
    disagreement_deg : (n,) largest difference between the magnetic headings of two sensors, or
        `None` with a single one.
    used : (n,) which of `sensors` the row is from.
    flags : `FLAGS` and the rows (n,) that each marks, those that could not be judged left out.
    roll_deg, pitch_deg : (n,) the tilt that was compensated. tilt_sd_deg : (n,) how well it is
        known about either level axis.
    declination_deg : (n,) east positive.
    sensors : names, in the order of the setup. tilt : where roll and pitch came from.
    method : "each row by itself", or "smoothed with the gyro": by all rows together.
    notes : sentences on what could not be done or known.
    faults : of two compasses, which disagreed with what both know, since when, by how much.
    """

    time: Array | None
    compass_deg: Array
    magnetic_deg: Array
    true_deg: Array
    sd_deg: Array
    random_sd_deg: Array
    disagreement_deg: Array | None
    used: Index
    flags: Mapping[str, Mask]
    roll_deg: Array
    pitch_deg: Array
    tilt_sd_deg: Array
    declination_deg: Array
    sensors: tuple[str, ...]
    tilt: str
    method: str = EACH_ROW
    notes: tuple[str, ...] = ()
    faults: tuple[CompassFault, ...] = ()

    def __len__(self) -> int:
        return len(self.true_deg)

    def _say(self) -> list[str]:
        """How many, how sure, and what the flags mark."""
        trusted = self.trusted
        names, east = ", ".join(self.sensors), float(np.median(self.declination_deg))
        said = [f"Heading: {len(self)} rows of {names}, {int(trusted.sum())} to trust"]
        said.append(f"{self.method}; tilt: {self.tilt}; declination {east:.2f}°")
        if trusted.any():
            sd = float(np.median(self.sd_deg[trusted]))
            said.append(f"standard error {sd:.2g}° (median)")
        counts = {name: int(rows.sum()) for name, rows in self.flags.items()}
        return [*said, *(f"{n} rows: {name}" for name, n in counts.items() if n), *self.notes]

    @property
    def trusted(self) -> Mask:
        """The rows that no flag marks, (n,)."""
        return np.asarray(~np.logical_or.reduce(list(self.flags.values())))

    def columns(self) -> dict[str, Array]:
        """The columns of numbers that are there, by name, in writing order."""
        named = {one.name: getattr(self, one.name) for one in fields(self) if one.name != "used"}
        return {name: column for name, column in named.items() if isinstance(column, np.ndarray)}

    def flag_names(self) -> list[str]:
        """The flags of each row as text, joined by "+"; "" for a row to trust."""
        bits = np.zeros(len(self), dtype=np.intp)
        for k, rows in enumerate(self.flags.values()):
            bits |= rows.astype(np.intp) << k
        text = {
            code: "+".join(name for k, name in enumerate(self.flags) if code >> k & 1)
            for code in np.unique(bits).tolist()
        }
        return [text[code] for code in bits.tolist()]
