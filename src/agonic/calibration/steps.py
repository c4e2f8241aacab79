"""The steps of whatever calibrates readings: a chain's, or the one that a calibration is."""

from __future__ import annotations

from typing import TypeAlias, TypeVar

import numpy as np

from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration
from agonic.calibration.chain import Chain
from agonic.calibration.deviation import Deviation
from agonic.calibration.interference import Interference
from agonic.calibration.network import Network
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError
from agonic.provenance import Provenance

AnyCalibration: TypeAlias = Affine | Thermal | Network | Alignment | Chain
"""Every calibration of readings that is saved, exported and loaded; an `Affine` may be an
`Interference`."""


def require_calibration(value: object) -> AnyCalibration:
    """The value itself, or an `AgonicError` that says what to give instead."""
    if isinstance(value, AnyCalibration):
        return value
    if isinstance(value, Deviation):
        raise AgonicError(
            "a deviation card corrects headings and a calibration of readings is needed; name the "
            "card in a setup beside the calibration of its compass"
        )
    if "calibration" in getattr(value, "__dataclass_fields__", ()):
        raise AgonicError("a Fit was given and a calibration is needed: give fit.calibration")
    raise AgonicError(
        f"a {type(value).__name__} was given and a calibration is needed: "
        "an Affine, a Thermal, a Network, an Alignment or a Chain of them"
    )


def steps_of(calibration: Calibration) -> tuple[Affine | Thermal | Network | Alignment, ...]:
    """The steps of a chain, or the one that a calibration is."""
    known = require_calibration(calibration)
    return known.steps if isinstance(known, Chain) else (known,)


Step = TypeVar("Step", Affine, Interference, Thermal, Network, Alignment)


def find_step(calibration: Calibration, kind: type[Step]) -> Step | None:
    """The first step of a calibration that is of a kind, or `None`.

    >>> print(find_step(Affine(bias=[0, 0, 0], matrix=np.eye(3)), Thermal))
    None
    """
    return next((step for step in steps_of(calibration) if isinstance(step, kind)), None)


def list_origins(calibration: AnyCalibration | Deviation) -> list[Provenance]:
    """Where a calibration, and each of its steps, came from."""
    steps = calibration.steps if isinstance(calibration, Chain) else ()
    return [calibration.provenance, *(step.provenance for step in steps)]


def find_magnitude(calibration: Calibration) -> float | None:
    """The field magnitude that the last step with one was scaled to, in `unit_out`, if known."""
    magnitudes = [
        step.magnitude for step in steps_of(calibration) if isinstance(step, Affine | Thermal)
    ]
    return magnitudes[-1] if magnitudes else None


def compose(calibration: Calibration) -> Affine:
    """A whole calibration as one step, an `Interference` where it takes sources into account.

    Raises `AgonicError` where it is not affine or its matrix is singular.

    >>> from scipy.spatial.transform import Rotation
    >>> turn = Alignment(rotation=Rotation.from_euler("z", 90, degrees=True))
    >>> compose(turn).matrix.round(9).tolist()
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    known = require_calibration(calibration)
    if not isinstance(known, Affine | Chain):
        known = Chain(steps=(known,))
    one = known.composed if isinstance(known, Chain) else known
    if np.linalg.matrix_rank(one.matrix) < 3:
        raise AgonicError("the matrix of this calibration is singular; it cannot be exported")
    return one
