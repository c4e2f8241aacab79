"""`Alignment`: the rotation from one set of axes to another."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.calibration.base import Correction
from agonic.calibration.schema_fields import Frame, Matrix, RotationRecord, Sensor, Unit, stored
from agonic.errors import AgonicError
from agonic.maths.rotations.vectors import skew
from agonic.provenance import Provenance

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


@dataclass(frozen=True, kw_only=True, eq=False)
class Alignment(Correction):
    """The mounting of a sensor, field_out = rotation.apply(field_in).

    `covariance` (3, 3) is that of the rotation vector, rad², axes of `frame_out`; frames are
    letters.

    >>> from scipy.spatial.transform import Rotation
    >>> turn = Alignment(rotation=Rotation.from_euler("z", 90, degrees=True), frame_out="b")
    >>> turn.correct([[1.0, 0.0, 0.0]]).round(12)
    array([[0., 1., 0.]])
    """

    kind: ClassVar[str] = "alignment"
    needs: ClassVar[tuple[str, ...]] = ()

    rotation: Annotated[Rotation, stored(RotationRecord, "Turns frame_in into frame_out.")]
    covariance: Annotated[
        Array | None, stored(Matrix | None, "Of the rotation vector, rad², row by row.")
    ] = None
    unit_in: Unit = "nT"
    frame_in: Frame = "m"
    frame_out: Frame = "b"
    sensor: Sensor = "mag"
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        if self.covariance is not None:
            object.__setattr__(self, "covariance", np.array(self.covariance))

    @property
    def unit_out(self) -> str:
        """A rotation keeps the unit."""
        return self.unit_in

    def correct(self, raw: ArrayLike, **columns: ArrayLike) -> Array:
        """The field (…, 3) in the axes of `frame_out`.

        Parameters: raw (…, 3) in `unit_in`; columns (…), not used.
        """
        return np.asarray(np.asarray(raw, dtype=np.float64) @ self.rotation.as_matrix().T)

    def uncertainty(self, raw: ArrayLike, **columns: ArrayLike) -> Array:
        """Covariance (n, 3, 3) of the turned field that the rotation itself contributes.

            [B×] C [B×]ᵀ,   B the field in the axes of `frame_out`, C its covariance

        Parameters: raw (n, 3) in `unit_in`; columns (n,), not used. Raises `AgonicError` where the
        covariance is not known.
        """
        if self.covariance is None:
            raise AgonicError("this alignment carries no covariance; fit it again with agonic")
        across = skew(np.atleast_2d(self.correct(raw)))
        return np.asarray(across @ self.covariance @ np.swapaxes(across, -1, -2))

    @property
    def equation(self) -> str:
        """The correction in words."""
        return f"field_{self.frame_out} = rotation.apply(field_{self.frame_in})"
