"""`Export`: a calibration written for another program, and what all such writers share.

A target fixes its unit and often its axes, and most hold a symmetric matrix only. The functions
here bring a calibration to that form and say in warnings what could not be kept.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import polar

from agonic.arrays import Array
from agonic.atomic import write_atomically
from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration
from agonic.calibration.chain import Chain
from agonic.calibration.interference import Interference, signals
from agonic.calibration.sources import name_sources, parse_source, spell_source
from agonic.calibration.steps import compose, steps_of
from agonic.errors import AgonicError, FrameError, UnitError
from agonic.health.finding import figure
from agonic.maths.equation.symmetric import pack_symmetric
from agonic.maths.rotations.right_angles import right_angles

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

NEGLIGIBLE_DEG = 0.01
"""A rotation below this is not worth a warning."""


@dataclass(frozen=True, kw_only=True)
class Export:
    """A file that was written: where, for which target, and what it does not hold or do."""

    path: Path
    target: str
    warnings: tuple[str, ...] = ()


def write_rows(
    target: str,
    path: Path | str,
    notes: Iterable[str],
    rows: Iterable[str],
    warnings: tuple[str, ...],
) -> Export:
    """Write rows of text below # comments."""
    text = "\n".join([*(f"# {note}" for note in notes), *rows]) + "\n"
    return Export(path=write_atomically(path, text), target=target, warnings=warnings)


CORRECTED = "readings"
"""In the settings of a calibration: how its readings had been corrected already."""


def add_to(old: Affine, new: Calibration) -> Chain:
    """Both as one for raw readings, where the readings of the new one had been corrected by the old
    one: field = W₂ (W₁ (raw − b₁) − b₂)."""
    axes = new.frame_in
    before = replace(old, sensor=new.sensor, frame_in=axes, frame_out=axes)
    return Chain(steps=(before, *steps_of(new)))


def require_uncorrected(calibration: Calibration) -> None:
    """Raise `AgonicError` for a calibration of readings that an autopilot had corrected."""
    said = calibration.provenance.settings.get(CORRECTED)
    if said is not None:
        raise AgonicError(
            f"the readings that {calibration.sensor} was calibrated on were {said}: give the "
            "parameters that were in force then (--on OLD.param), and both are joined"
        )


def reduce(calibration: Calibration) -> tuple[Array, Array]:
    """Bias (3,) and matrix (3, 3) of a whole calibration, field = matrix @ (raw − bias). Where it
    takes a current or throttle into account, the bias is that without them: see `list_left_out`.
    Raises `AgonicError` where it mixes two magnetometers."""
    one = compose(calibration)
    if "second" in one.needs:
        raise AgonicError(
            f"this calibration mixes the readings of {one.sensor} with those of a second "
            "magnetometer, which the target cannot do; export the setup to c, or fit "
            f"{one.sensor} alone"
        )
    return one.bias, one.matrix


def list_left_out(calibration: Calibration) -> tuple[str, ...]:
    """Warnings for the sources that a target without a term for them leaves in the field."""
    one = compose(calibration)
    if not isinstance(one, Interference):
        return ()
    added = np.linalg.norm(one.matrix @ one.coefficients, axis=0)
    return tuple(
        f"the target has no term for {signal}: {figure(size, 3)} {one.unit_out} per unit of it "
        "stay in the field; the file is right where it is zero. Export the setup to c to keep the "
        "term"
        for signal, size in zip(signals(one.sources), added, strict=True)
    )


def require_physical(calibration: Calibration, unit: str) -> tuple[Array, Array]:
    """`reduce`, for a target whose numbers are in `unit`: bias in nT, matrix without unit."""
    bias, matrix = reduce(calibration)
    if {calibration.unit_in, calibration.unit_out} != {"nT"}:
        raise UnitError(
            f"the target needs {unit} and this calibration turns {calibration.unit_in} into "
            f"{calibration.unit_out}; read the log with its unit, give the field magnitude, and "
            "fit again"
        )
    return bias, matrix


def turn_into_frame(
    calibration: Calibration, frame: str, *, unit: str, rotation_bm: Rotation | None = None
) -> tuple[Array, Array, tuple[str, ...]]:
    """`require_physical`, for a target whose readings and field are both in the axes of `frame`.

        bias_f = R_in bias,   matrix_f = R_out matrix R_inᵀ

    with R_in, R_out from the calibration's own axes to those of the target, made of `rotation_bm`
    (m components into b components). Without it the mounting inside a chain is taken, or none.
    Returns bias (3,) nT, matrix (3, 3) and warnings.
    """
    bias, matrix = require_physical(calibration, unit)
    into, out, warnings = find_turns(calibration, frame, rotation_bm)
    return into @ bias, out @ matrix @ into.T, warnings


def hold_sources(
    calibration: Calibration, kept: Collection[str] = ()
) -> tuple[Calibration, tuple[str, ...]]:
    """The calibration for a target that has a term for one of the sources `kept`, and warnings.
    Others, or several, are held at their average in the log, or at zero where that is not known."""
    steps = steps_of(calibration)
    sources = [n for step in steps if isinstance(step, Interference) for n in step.sources]
    untimed = (parse_source(one)._replace(late_s=0.0, time_constant_s=0.0) for one in sources)
    plain = spell_source(next(untimed)) if len(sources) == 1 else ""
    if plain in kept and plain not in sources:
        said = f"the target uses {plain} as recorded, without removing its delay or filter"
        recorded = (
            replace(one, sources=(plain,), timing_sd_s={}) if isinstance(one, Interference) else one
            for one in steps
        )
        return join_steps(recorded), (said,)
    if not sources or "second" in sources or (len(sources) == 1 and sources[0] in kept):
        return calibration, ()
    if any(isinstance(step, Interference) and step.typical is None for step in steps):
        if not kept:
            return calibration, list_left_out(calibration)
        raise AgonicError(
            f"the target takes one of current and throttle into account, not {', '.join(sources)}; "
            "fit with one of them, or export the setup to c"
        )
    held = [
        step.at(step.typical)
        if isinstance(step, Interference) and step.typical is not None
        else step
        for step in steps
    ]
    warning = (
        f"the target has no terms for {name_sources(sources)}: held at their average in the log, "
        "and their changes about it stay in the field. Export the setup to c to keep the terms"
    )
    return join_steps(held), (warning,)


def join_steps(steps: Iterable[Any]) -> Calibration:
    """A chain of steps, or the one that there is."""
    one, *others = steps
    return Chain(steps=(one, *others)) if others else one


def find_source_term(
    calibration: Calibration, frame: str, *, rotation_bm: Rotation | None = None
) -> tuple[str, Array] | None:
    """The current or throttle and its coefficient, after `hold_sources`."""
    one = compose(calibration)
    if not isinstance(one, Interference):
        return None
    into, _, _ = find_turns(calibration, frame, rotation_bm)
    return one.sources[0], into @ one.coefficients[:, 0]


def find_turns(
    calibration: Calibration, frame: str, rotation_bm: Rotation | None
) -> tuple[Array, Array, tuple[str, ...]]:
    """R_in and R_out of `turn_into_frame`, and what was assumed."""
    ends = (calibration.frame_in, calibration.frame_out)
    if set(ends) == {frame}:
        return np.eye(3), np.eye(3), ()
    if not {*ends, frame} <= {"m", "b"}:
        raise FrameError(
            "the target takes a calibration between sensor and body axes",
            left=" to ".join(ends),
            right=frame,
        )
    warnings: tuple[str, ...] = ()
    if rotation_bm is None:
        rotation_bm, warnings = find_rotation_inside(calibration)
    turn = {"m": rotation_bm.as_matrix(), "b": np.eye(3)}
    into, out = (turn[frame].T @ turn[end] for end in ends)
    return into, out, warnings


def find_rotation_inside(calibration: Calibration) -> tuple[Rotation, tuple[str, ...]]:
    """The rotation from m to b that the calibration itself holds, and what was assumed."""
    from scipy.spatial.transform import Rotation  # slow to load

    if calibration.frame_in == calibration.frame_out:
        return Rotation.identity(), (
            "the mounting of the sensor is not known: its axes were taken for those of the body; "
            "give rotation_bm where they differ",
        )
    turn = Rotation.identity()
    for step in steps_of(calibration):
        if isinstance(step, Alignment):
            turn = step.rotation * turn
        elif isinstance(step, Affine) and step.frame_in != step.frame_out:
            turn = split_rotation(step.matrix)[1] * turn
    warning = (
        f"the mounting of {np.degrees(turn.magnitude()):.2f} deg inside the calibration is left "
        "to the target: set its sensor orientation to the same turn, or give rotation_bm",
    )
    return turn if calibration.frame_in == "m" else turn.inv(), warning


def find_turn_inside(
    calibration: Calibration, rotation_bm: Rotation | None
) -> tuple[Rotation | None, Array | None]:
    """The rotation from sensor to body axes, for a target that can take it as its own orientation:
    as given, or, at angles far from right ones, as the calibration itself holds it; then its roll,
    pitch and yaw too, degrees.

    Angles are of the order yaw, pitch, roll (321), from sensor to body axes. A turn near right
    angles is the orientation that the target has by a number of its own, and stays with it.
    """
    if rotation_bm is not None or (calibration.frame_in, calibration.frame_out) != ("m", "b"):
        return rotation_bm, None
    turn = find_rotation_inside(calibration)[0]
    nearest = float(np.einsum("ij,kij->k", turn.as_matrix(), right_angles()).max())
    if np.degrees(np.arccos(np.clip((nearest - 1) / 2, -1.0, 1.0))) < 5.0:  # the target's own
        return rotation_bm, None
    return turn, np.asarray(turn.as_euler("ZYX", degrees=True)[::-1])


def split_rotation(matrix: ArrayLike) -> tuple[Array, Rotation]:
    """The polar decomposition matrix = rotation @ symmetric, as (symmetric, rotation).

    The symmetric factor gives the same magnitudes and the rotation is what it leaves out: a target
    that holds a symmetric matrix only shows the field turned by the inverse of that rotation.
    Source: Higham, Functions of Matrices (2008), chapter 8.
    """
    from scipy.spatial.transform import Rotation  # slow to load

    rotation, symmetric = polar(np.asarray(matrix, dtype=np.float64))
    if np.linalg.det(rotation) < 0:
        raise AgonicError(
            "this calibration mirrors the axes and the target cannot; reverse one axis of the "
            "readings, and fit again"
        )
    return (symmetric + symmetric.T) / 2, Rotation.from_matrix(rotation)


def take_symmetric(
    calibration: Calibration, frame: str, *, unit: str, rotation_bm: Rotation | None = None
) -> tuple[Array, Array, tuple[str, ...]]:
    """`turn_into_frame`, for a target that holds a symmetric matrix."""
    bias, matrix, warnings = turn_into_frame(calibration, frame, unit=unit, rotation_bm=rotation_bm)
    symmetric, left_out = split_rotation(matrix)
    angle = np.degrees(left_out.magnitude())
    if angle > NEGLIGIBLE_DEG:
        warnings += (
            f"the target holds a symmetric matrix only: a rotation of {angle:.2f} deg is left "
            "out, and its field is turned by the same angle",
        )
    return bias, pack_symmetric(symmetric), warnings
