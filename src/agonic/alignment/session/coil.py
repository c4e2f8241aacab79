"""`CoilSession`: a standard coil switched through its currents before a magnetometer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agonic.alignment.session.session import Site, correct_field
from agonic.arrays import Array
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration
from agonic.errors import AgonicError
from agonic.provenance import Input
from agonic.samples import Samples


@dataclass(frozen=True, kw_only=True, eq=False)
class Attitude:
    """How the platform stands: north-east-down into its axes, (3, 3), with covariance (3, 3), rad².

    `frame` is the letter of its axes: "b" (forward, right, down) or "c" (star sensor).
    """

    rot_pn: Array
    covariance: Array
    frame: str = "b"


@dataclass(frozen=True, kw_only=True, eq=False)
class CoilSession:
    """Readings of a magnetometer while a coil's current is reversed.

    Parameters
    ----------
    magnetometer : readings in nT with times and `current_A`. calibration : applied before all else.
    reference : the field beside it, north-east-down, which takes out the ambient's changes.
    geometric_axis : (3,) of the coil as drawn, in axes of the letter `geometric_frame`.
    alignment : magnetometer axes into those of the platform. attitude : of the platform.
    site : needed for Earth-fixed and inertial axes.
    settle_s : readings so soon after a change of current are left out.
    current_sd : relative standard deviation of the current's scale.
    """

    magnetometer: Samples
    reference: Samples | None = None
    calibration: Calibration | None = None
    geometric_axis: Array | None = None
    geometric_frame: str = "m"
    alignment: Alignment | None = None
    attitude: Attitude | None = None
    site: Site | None = None
    settle_s: float = 0.0
    current_sd: float = 0.0
    coil: str = "coil"
    name: str = ""
    sources: tuple[Input, ...] = ()

    @property
    def corrected(self) -> Array:
        """The magnetometer's field (n, 3), nT, with its calibration where there is one."""
        return correct_field(self.magnetometer, self.calibration)

    def __post_init__(self) -> None:
        if mistakes := _amiss(self):
            raise AgonicError("; ".join(mistakes))


def _amiss(session: CoilSession) -> list[str]:
    """What does not fit together."""
    said = []
    samples = session.magnetometer
    if samples.current_A is None:
        said.append("the magnetometer's table has no current of the coil; add a column current_A")
    elif not np.ptp(samples.current_A) > 0:
        said.append("the current never changes; reverse it")
    if samples.time is None:
        said.append("the magnetometer's table has no times")
    known = session.calibration
    if (samples.unit if known is None else known.unit_out) != "nT":
        said.append("the magnetometer's readings need a unit")
    frames = {"m"}
    if session.alignment is not None:
        frames.add(session.alignment.frame_out)
    if session.attitude is not None:
        if session.attitude.frame not in frames:
            said.append(
                f"the attitude is that of {session.attitude.frame} axes and no alignment leads "
                "there from the magnetometer's"
            )
        frames.add("n")
    if session.geometric_axis is not None and session.geometric_frame not in frames:
        said.append(
            f"the geometric axis is in {session.geometric_frame} axes and nothing leads there "
            f"(known: {', '.join(sorted(frames))})"
        )
    return said
