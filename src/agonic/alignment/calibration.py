"""An alignment in units: the turn with its covariance, after what corrects the readings before."""

from __future__ import annotations

from typing import Any

from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration
from agonic.calibration.chain import Chain
from agonic.calibration.steps import steps_of
from agonic.provenance import Input, Provenance
from agonic.samples import Samples


def make_calibration(
    rot_mp: Array,
    covariance: Array,
    samples: Samples,
    provenance: Provenance,
    *,
    frame: str,
    before: Calibration | None = None,
    own: Affine | None = None,
) -> Alignment | Chain:
    """field_p = rotation.apply(field_m), p the platform's axes of a `frame`'s letter. Parameters:
    `rot_mp` (3, 3) the platform's components into those of the magnetometer, with `covariance` (3,
    3), rad², of its turn in magnetometer axes: a turn δ of R_mp is −R_pm δ of R_pm. `before` and
    `own` correct the readings first."""
    back = rot_mp.T
    turn = Alignment(
        rotation=Rotation.from_matrix(back),
        covariance=back @ covariance @ back.T,
        unit_in=samples.unit if before is None else before.unit_out,
        frame_in="m",
        frame_out=frame,
        sensor=samples.name,
        provenance=provenance,
    )
    steps = [*(() if before is None else steps_of(before)), *(() if own is None else (own,)), turn]
    if len(steps) == 1:
        return turn
    return Chain(steps=tuple(steps), provenance=provenance)


def make_provenance(
    sources: tuple[Input, ...], arrays: dict[str, Array], settings: dict[str, Any], *method: str
) -> Provenance:
    """The origin of a fit: its files, or without any the arrays themselves."""
    inputs = sources or tuple(Input.of_array(name, values) for name, values in arrays.items())
    return Provenance(inputs=inputs, settings=settings, method=method)
