"""Every usual mistake with frames, signs and clocks is found by its name, and none is made up.

The mistakes are made with SciPy's rotations and ERFA's own series, not with the code that undoes
them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import erfa
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.alignment.session.earth import load_earth_rotation
from agonic.alignment.session.session import Pier, Session, Site
from agonic.alignment.simulation.session import simulate_session
from agonic.alignment.star_sensor.fit import fit_alignment
from tests.alignment.nights import MATRIX, at_other_times, names


def with_attitudes(session: Session, rot_ci: np.ndarray) -> Session:
    return replace(session, star=replace(session.star, rot_ci=rot_ci))


def scipy_angles(session: Session) -> np.ndarray:
    """Ra, 90° − Dec and Rot."""
    return Rotation.from_matrix(session.star.rot_ci).inv().as_euler("ZYZ", degrees=True)


def passive(angles: np.ndarray) -> np.ndarray:
    return Rotation.from_euler("ZYZ", angles, degrees=True).inv().as_matrix()


def of_date(session: Session, matrix: Callable[..., np.ndarray]) -> Session:
    tt = (session.star.time + 69.184) / 86_400
    turn = np.swapaxes(matrix(2_440_587.5, tt), 1, 2)
    return with_attitudes(session, session.star.rot_ci @ turn)


def through_earth(session: Session, origin: Callable, matrix: Callable) -> Session:
    """Attitudes carried into Earth-fixed axes rightly, and back into inertial ones wrongly."""
    tt = (session.star.time + 69.184) / 86_400
    wrong = np.array(
        [
            erfa.rz(angle, celestial)
            for angle, celestial in zip(
                origin(session.star.time / 86_400, tt), matrix(2_440_587.5, tt), strict=True
            )
        ]
    )
    right = load_earth_rotation().rot_ei(session.star.time)
    return with_attitudes(session, session.star.rot_ci @ np.swapaxes(right, 1, 2) @ wrong)


def other_field(session: Session, which: str, order: list[int], sign: list[int]) -> Session:
    samples = getattr(session, which)
    return replace(session, **{which: samples.with_columns(field=samples.field[:, order] * sign)})


def scalar_last(session: Session) -> Session:
    """Columns x y z w that were read as w x y z."""
    xyzw = Rotation.from_matrix(session.star.rot_ci).as_quat()
    return with_attitudes(session, Rotation.from_quat(xyzw[:, [1, 2, 3, 0]]).as_matrix())


GAST = (lambda ut, tt: erfa.gst06a(2_440_587.5, ut, 2_440_587.5, tt), erfa.c2i06a)
ERA = (lambda ut, tt: erfa.era00(2_440_587.5, ut), erfa.pnm06a)
MISTAKES: dict[str, Callable[[Session], Session]] = {
    "roll counted from north, not from south": lambda s: with_attitudes(
        s, passive(scipy_angles(s) + np.array([0, 0, 180]))
    ),
    "roll counted the other way round": lambda s: with_attitudes(
        s, passive(scipy_angles(s) * [1, 1, -1])
    ),
    "active elementary rotations for passive ones": lambda s: with_attitudes(
        s, passive(-scipy_angles(s))
    ),
    "the conjugate quaternion (or transposed matrix)": lambda s: with_attitudes(
        s, Rotation.from_matrix(s.star.rot_ci).inv().as_matrix()
    ),
    "quaternions with the scalar last, read as scalar first": scalar_last,
    "right ascension in hours": lambda s: with_attitudes(
        s, passive(np.where([True, False, False], scipy_angles(s) % 360 / 15, scipy_angles(s)))
    ),
    "polar distance for declination": lambda s: with_attitudes(
        s, passive(np.where([False, True, False], 90 - scipy_angles(s), scipy_angles(s)))
    ),
    "longitude counted west": lambda s: replace(s, site=replace(s.site, longitude_deg=-12.675)),
    "latitude and longitude exchanged": lambda s: replace(
        s, site=Site(latitude_deg=12.675, longitude_deg=52.0725)
    ),
    "latitude with the sign reversed": lambda s: replace(
        s, site=replace(s.site, latitude_deg=-52.0725)
    ),
    "TAI taken for UTC": lambda s: at_other_times(s, 37.0),
    "UTC taken for TAI": lambda s: at_other_times(s, -37.0),
    "GPS time taken for UTC": lambda s: at_other_times(s, 18.0),
    "TT taken for UTC": lambda s: at_other_times(s, 69.184),
    "times 2 h late (a local time taken for UTC)": lambda s: at_other_times(s, 7200.0),
    "attitudes in the true equator and equinox of date, not J2000": lambda s: of_date(
        s, erfa.pnm06a
    ),
    "attitudes in the celestial intermediate system of date, not J2000": lambda s: of_date(
        s, erfa.c2i06a
    ),
    "GAST used with a CIO matrix, for the Earth rotation angle": lambda s: through_earth(s, *GAST),
    "the Earth rotation angle used with an equinox matrix, for GAST": lambda s: through_earth(
        s, *ERA
    ),
    "attitudes in Earth-fixed axes, not J2000": lambda s: with_attitudes(
        s,
        s.star.rot_ci @ np.swapaxes(load_earth_rotation().rot_ei(s.star.time), 1, 2),
    ),
    "refraction left in by the sensor": lambda s: replace(
        s, star=replace(s.star, refraction="removed")
    ),
    "aberration left in by the sensor": lambda s: replace(
        s, star=replace(s.star, aberration="removed")
    ),
    "the pier difference with the sign reversed": lambda s: replace(
        s, pier=Pier(difference=-s.pier.difference)
    ),
    "a reference whose third axis points up": lambda s: other_field(
        s, "reference", [0, 1, 2], [1, 1, -1]
    ),
    "a reference with axes east, north, up": lambda s: other_field(
        s, "reference", [1, 0, 2], [1, 1, -1]
    ),
    "left-handed axes of the magnetometer, its y reversed": lambda s: other_field(
        s, "magnetometer", [0, 1, 2], [1, -1, 1]
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("words", MISTAKES)
def test_every_mistake_is_found_by_its_name(words: str) -> None:
    made = simulate_session(
        seed=5, pier=(8.0, -6.0, 5.0), orientations=16, readings=6, lowest_elevation_deg=42.0
    )
    fit = fit_alignment(MISTAKES[words](made.session))
    assert fit.verdict == "refused"
    assert [f.name for f in fit.findings] == ["session mistake"]
    said = fit.findings[0].what
    assert said.split("; ", 1)[1].startswith(f"{words} would explain it"), said


@pytest.mark.slow
def test_a_mistake_is_found_while_the_bias_is_solved_for() -> None:
    made = simulate_session(seed=5, bias=(200.0, -100.0, 50.0), matrix=MATRIX)
    session = MISTAKES["TAI taken for UTC"](made.session)
    fit = fit_alignment(session, solve=("bias", "matrix"))
    assert "TAI taken for UTC" in fit.status


def test_without_a_mistake_none_is_named() -> None:
    made = simulate_session(seed=8)
    assert names(fit_alignment(made.session)) == set()


@pytest.mark.slow
def test_a_magnetometer_that_needs_calibration_is_no_mistake_of_frames() -> None:
    made = simulate_session(seed=5, bias=(200.0, -100.0, 50.0), matrix=MATRIX)
    fit = fit_alignment(made.session)
    assert names(fit) == {"session misfit"}
    assert "solve for the magnetometer's bias and matrix" in fit.status
    better = fit_alignment(made.session, solve=("bias", "matrix"))
    assert better.verdict == "good"
