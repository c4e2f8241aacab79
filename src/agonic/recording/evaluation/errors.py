"""The error of a field by what is known of it: heading, dip, magnitude; and how parameters move it.

A heading is judged after one constant turn and a magnitude about its mean, for how a sensor sits in
its vehicle, the declination and the scale are no errors of a calibration that could not know them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.maths.rotations.angles import wrap_deg
from agonic.maths.rotations.attitude import down_b
from agonic.maths.rotations.tilt import heading_by_vectors_deg
from agonic.reference import Reference
from agonic.samples import Samples

HEADING, DIP, MAGNITUDE = "heading", "dip", "magnitude"
UNITS = {HEADING: "°", DIP: "°", MAGNITUDE: "%"}
"""The kinds of errors, the most telling first, and their units."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Known:
    """What is known of the field at each row.

    `magnitude` (n,), the same number in all rows where none is known; `down` (n, 3) in the axes of
    the readings; `dip_deg` and `heading_deg` (n,); `None` where not known.
    """

    magnitude: Array
    down: Array | None = None
    dip_deg: Array | None = None
    heading_deg: Array | None = None

    def select(self, rows: Index | Mask) -> Known:
        """The same of some rows."""

        def cut(values: Array | None) -> Array | None:
            return None if values is None else values[rows]

        return Known(
            magnitude=self.magnitude[rows],
            down=cut(self.down),
            dip_deg=cut(self.dip_deg),
            heading_deg=cut(self.heading_deg),
        )


def find_known(
    samples: Samples, reference: Reference | None, truth: Samples | None = None
) -> Known:
    """What samples, their reference and another's attitude `truth` at the same rows tell.

    A heading is a truth where it is independent of the magnetometer, and roll and pitch beside it
    make it level.
    """
    n, told = len(samples), samples if truth is None else truth
    columns = {"magnitude": np.ones(n)}
    in_units = reference is not None and samples.unit != "raw"
    if reference is not None and in_units:
        columns["magnitude"] = np.broadcast_to(reference.magnitudes(n), n)
    if told.roll_deg is None or told.pitch_deg is None:
        return Known(**columns)
    columns["down"] = down_b(told.roll_deg, told.pitch_deg)
    if told.heading_deg is not None and not told.heading_estimated:
        columns["heading_deg"] = told.heading_deg
    if reference is not None and in_units and reference.kind in ("vector", "horizontal-vertical"):
        horizontal, vertical = reference.horizontal_and_vertical(n).T
        columns["dip_deg"] = np.broadcast_to(np.degrees(np.arctan2(vertical, horizontal)), n)
    return Known(**columns)


def measure_errors(field: Array, known: Known) -> dict[str, Array]:
    """The errors (n,) of a field (n, 3) in every way that is known, degrees and per cent."""
    size = np.linalg.norm(field, axis=1)
    ratio = size / known.magnitude
    errors = {}
    if known.down is not None and known.heading_deg is not None:
        off = wrap_deg(heading_by_vectors_deg(field, known.down) - known.heading_deg)
        turn = np.degrees(np.angle(np.exp(1j * np.radians(off)).mean()))
        errors[HEADING] = np.asarray(wrap_deg(off - turn))
    if known.down is not None and known.dip_deg is not None:
        below = np.einsum("ni,ni->n", field, known.down)
        level = np.sqrt(np.maximum(size**2 - below**2, 0.0))
        errors[DIP] = np.asarray(np.degrees(np.arctan2(below, level)) - known.dip_deg)
    errors[MAGNITUDE] = np.asarray(100.0 * (ratio / ratio.mean() - 1.0))
    return errors


def measure_sensitivities(field: Array, sensitivity: Array, known: Known) -> dict[str, Array]:
    """How parameters move these errors, (n, m), where they move the field by (n, 3, m)."""
    size = np.maximum(np.linalg.norm(field, axis=1), np.finfo(float).tiny)[:, None]
    along = field / size

    def of(direction: Array, per: Array | float) -> Array:
        return np.asarray(np.einsum("ni,nij->nj", direction, sensitivity) / per)

    ratio = size / known.magnitude[:, None]
    longer = of(along, known.magnitude[:, None]) / ratio.mean()
    moves = {MAGNITUDE: 100.0 * (longer - ratio / ratio.mean() * longer.mean(axis=0))}
    if known.down is None:
        return moves
    below = np.einsum("ni,ni->n", field, known.down)[:, None]
    level = field - below * known.down
    flat = np.maximum(np.linalg.norm(level, axis=1, keepdims=True), 1e-9 * size)
    if known.heading_deg is not None:
        across = np.cross(level / flat, known.down)
        turned = of(across, flat)
        moves[HEADING] = np.degrees(turned - turned.mean(axis=0))
    if known.dip_deg is not None:
        steeper = (flat * known.down - below * level / flat) / size
        moves[DIP] = np.degrees(of(steeper, size))
    return moves
