"""What the turn to an accelerometer rests on, and what is wrong or worth knowing."""

from __future__ import annotations

import numpy as np

from agonic.alignment.gravity.result import GravityFit
from agonic.arrays import Array
from agonic.health import Finding, figure

OPEN_DEG, LOOSE_DEG = 5.0, 1.0
"""Standard errors of the turn above which it is not determined, and is worth a word."""
MISFIT = 0.02
"""Share of the field that the vertical component may scatter by."""
ODD_GRAVITY = 0.03
TURNED_DEG = 90.0
"""A turn as large may stand for an axis of the wrong sign, with the field turned round."""
EQUATOR_DEG = 25.0
"""Beyond this latitude the field dips down in the north and up in the south everywhere."""


def examine(fit: GravityFit, latitude_deg: Array | None) -> tuple[Finding, ...]:
    """The findings of a fit; `latitude_deg` (n,) of the readings, where it is known."""
    found = (_check_turn(fit), _check_gravity(fit), _check_dip(fit, latitude_deg))
    return tuple(one for one in found if one is not None)


def describe(fit: GravityFit) -> tuple[str, ...]:
    """How good it is, in sentences."""
    return (
        f"the magnetometer is misaligned by {figure(fit.angle_deg, 3)}° from the accelerometer, ± "
        f"{figure(fit.worst_sd_deg)}° about its worst axis, from {fit.n} orientations",
        f"the field dips by {fit.inclination_deg:.2f}°",
    )


def _check_turn(fit: GravityFit) -> Finding | None:
    """A vertical field that varies, or a turn that is not known well."""
    undetermined = not fit.worst_sd_deg < OPEN_DEG
    left = float(np.sqrt((fit.estimate.residuals**2).mean())) / fit.magnitude
    if left > MISFIT:
        what = (
            f"the vertical field scatters by {figure(100 * left)} % of the field between "
            "orientations"
        )
        move = "calibrate the magnetometer first, and keep away from iron"
        return Finding("vertical varies", "refuse" if undetermined else "check", what, move)
    if undetermined:
        what = f"{fit.n} orientations leave the turn about {_axis(fit)} open"
        move = "hold it still also nose up, on either side and upside down, and in between"
        return Finding("turn undetermined", "refuse", what, move)
    if fit.worst_sd_deg <= LOOSE_DEG:
        return None
    what = f"the standard error of the turn about {_axis(fit)} is {figure(fit.worst_sd_deg)}°"
    return Finding("turn loose", "check", what, "add orientations far from the others")


def _check_gravity(fit: GravityFit) -> Finding | None:
    uneven = float(np.ptp(fit.gravity) / fit.gravity.mean())
    if uneven <= ODD_GRAVITY:
        return None
    what = (
        f"the accelerometer reads gravity as {figure(100 * uneven)} % larger one way than another"
    )
    return Finding(
        "uneven gravity", "check", what, "calibrate it; its bias tilts every orientation"
    )


def _check_dip(fit: GravityFit, latitude_deg: Array | None) -> Finding | None:
    """An axis of the wrong sign, or two exchanged, fits as well as a true turn: −M is a rotation
    where M mirrors, and the field then dips the other way. Only the hemisphere tells."""
    dip = fit.inclination_deg
    north = float("nan") if latitude_deg is None else float(np.nanmedian(latitude_deg))
    known = abs(north) > EQUATOR_DEG
    if (known and dip * north >= 0) or (not known and (dip >= 0 or fit.angle_deg < TURNED_DEG)):
        return None
    way = "up" if dip < 0 else "down"
    here = f"at latitude {north:.0f}° it does not" if known else "it does so in the south only"
    what = (
        f"by this fit the field dips {way} by {abs(dip):.0f}°, and {here}: an axis of the "
        "magnetometer or accelerometer with the wrong sign, or two exchanged, fits as well"
    )
    unknown = ", or log latitude_deg if this is south of the magnetic equator"
    move = "compare the axes with the data sheets" + ("" if known else unknown)
    return Finding("dips the wrong way", "check", what, move)


def _axis(fit: GravityFit) -> str:
    """The accelerometer's axis, in words, about which the turn is known least."""
    turn = fit.estimate.covariance[:3, :3]
    if not np.isfinite(turn).all():
        return "all axes"
    worst = np.linalg.eigh(turn)[1][:, -1]
    return f"({', '.join(f'{part:.2f}' for part in worst)}) of the accelerometer's axes"
