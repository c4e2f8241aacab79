"""The direction of the field: against a chain of its own, honest, and as readings come in."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise

import erfa
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.alignment.direction.compute import field_direction
from agonic.alignment.direction.follow import follow_direction
from agonic.alignment.direction.result import FieldDirection
from agonic.alignment.session.earth import load_earth_rotation
from agonic.alignment.session.session import Session, StarReadings, compute_unix_s
from agonic.alignment.simulation.session import SimulatedSession, simulate_session
from agonic.errors import AgonicError, FrameError
from agonic.maths.rotations.frames import ARCSEC_RAD, angles_323_deg
from tests.command_line import answer, complaint

QUIET = {"noise": 0.0, "reference_noise": 0.0, "across_sd_arcsec": 0.0, "about_sd_arcsec": 0.0}
BARE = {"refraction": "removed", "aberration": "removed"}


def true_turn(made: SimulatedSession) -> ag.alignment.Alignment:
    return ag.alignment.Alignment(
        rotation=Rotation.from_matrix(made.rot_mc.T), covariance=np.zeros((3, 3)), frame_out="c"
    )


def known(stars: StarReadings) -> StarReadings:
    """With attitudes that are stated to be exact."""
    return replace(stars, covariance=np.zeros((len(stars), 3, 3)))


def find(made: SimulatedSession, **settings) -> FieldDirection:
    night: Session = made.session
    stars = night.star if night.star.covariance is not None else known(night.star)
    turn = true_turn(made)
    return field_direction(turn, night.magnetometer, stars, night.site, **settings)


def at(stars: StarReadings, rows: np.ndarray) -> ag.Samples:
    """Readings of any field at the moments of some attitudes."""
    return ag.Samples(
        field=np.random.default_rng(0).normal(0, 3e4, (len(rows), 3)),
        time=stars.time[rows] - stars.time[0],
        epoch=datetime.fromtimestamp(stars.time[0], UTC),
        unit="nT",
    )


def test_it_is_the_chain_of_elementary_rotations() -> None:
    """To a hundredth of an arcsecond, by ERFA's elementary matrices and none of the code here."""
    made = simulate_session(**QUIET, **BARE, seed=4)
    stars, site = known(made.session.star), made.session.site
    samples = at(stars, np.arange(0, len(stars), 37))
    found = field_direction(true_turn(made), samples, stars, site)
    alpha, beta, gamma = np.radians(angles_323_deg(made.rot_mc))
    sim_csc = erfa.rz(gamma, erfa.ry(beta, erfa.rz(alpha, np.eye(3))))
    latitude, longitude = np.radians([site.latitude_deg, site.longitude_deg])
    ned_cts = erfa.rz(-longitude, erfa.ry(np.pi / 2 + latitude, np.eye(3)))
    assert found.rows.tolist() == list(range(len(samples)))
    for row in range(len(samples)):
        star = 37 * row
        a, b, c = np.radians(angles_323_deg(stars.rot_ci[star]))
        cis_sim = erfa.rz(c, erfa.ry(b, erfa.rz(a, np.eye(3))))
        celestial = cis_sim.T @ sim_csc.T @ samples.field[row]
        earth = load_earth_rotation().rot_ei(stars.time[star])[0] @ celestial
        for vector, own in (
            (celestial, found.field_i[row]),
            (earth, found.field_e[row]),
            (ned_cts.T @ earth, found.field_n[row]),
        ):
            away = np.linalg.norm(np.cross(vector, own)) / (vector @ vector)
            assert away < 0.01 * ARCSEC_RAD


def test_angles_are_those_of_the_vectors() -> None:
    made = simulate_session(**QUIET, **BARE, seed=4)
    found = find(made)
    east_of_north = np.degrees(np.arctan2(found.field_n[:, 1], found.field_n[:, 0]))
    np.testing.assert_allclose(found.declination_deg, east_of_north)
    ra, dec = np.radians(found.ra_deg), np.radians(found.dec_deg)
    unit = np.stack([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)], axis=1)
    np.testing.assert_allclose(unit * found.magnitude[:, None], found.field_i, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(found.field_n, axis=1), found.magnitude)


def test_standard_errors_are_honest() -> None:
    z = []
    for seed in range(10):
        settings = {"seed": seed, "orientations": 12, "readings": 6}
        made = simulate_session(**settings)
        night = made.session
        turn = ag.fit_alignment(night).calibration
        found = field_direction(turn, night.magnetometer, night.star, night.site, noise=night.noise)
        truth = find(simulate_session(**settings, **QUIET))
        for name in ("declination", "inclination"):
            error = getattr(found, f"{name}_deg") - getattr(truth, f"{name}_deg")
            z.append(error / getattr(found, f"{name}_sd_deg"))
    assert 0.85 < np.sqrt(np.mean(np.square(z))) < 1.15
    assert abs(np.mean(z)) < 0.2


def test_batches_as_they_come_are_the_whole() -> None:
    night = simulate_session(seed=2).session
    turn = ag.fit_alignment(night).calibration
    whole = field_direction(turn, night.magnetometer, night.star, night.site, gap_s=60.0)
    moments = compute_unix_s(night.magnetometer)
    edges = np.linspace(moments[0], moments[-1] + 1, 9)
    batches = []
    for low, high in pairwise(edges):
        seen = (night.star.time >= low - 5) & (night.star.time < high - 5)
        stars = replace(
            night.star,
            time=night.star.time[seen],
            orientation=night.star.orientation[seen],
            rot_ci=night.star.rot_ci[seen],
            covariance=night.star.covariance[seen],
        )
        rows = np.flatnonzero((moments >= low) & (moments < high))
        batches.append((night.magnetometer.select(rows), stars))
    parts = list(follow_direction(turn, batches, night.site, gap_s=60.0))
    together = np.concatenate([part.field_i for part in parts])
    when = np.concatenate([part.time for part in parts])
    common = np.isin(whole.time, when)
    assert common.mean() > 0.95
    np.testing.assert_allclose(together[np.argsort(when)], whole.field_i[common], atol=1e-6)


def test_a_platform_that_turns_unevenly_is_less_sure_between_attitudes() -> None:
    """Interpolation leaves out what the platform does between; the standard error holds it."""
    made = simulate_session(**QUIET, **BARE, seed=1)
    start = made.session.star.time[0]

    def attitude(t):
        angle = 0.2 * np.sin(2 * np.pi * t / 8.0)
        return Rotation.from_rotvec(angle[:, None] * np.array([0.0, 0.6, 0.8])).as_matrix()

    t = np.arange(0.0, 60.0, 0.5)
    stars = StarReadings(
        time=start + t,
        orientation=np.zeros(len(t), dtype=np.int64),
        rot_ci=attitude(t),
        covariance=np.broadcast_to(np.eye(3) * (3 * ARCSEC_RAD) ** 2, (len(t), 3, 3)),
    )
    moments = np.arange(1.1, 58.0, 0.21)
    samples = ag.Samples(
        field=np.tile([30_000.0, -20_000.0, 35_000.0], (len(moments), 1)),
        time=moments,
        epoch=datetime.fromtimestamp(start, UTC),
        unit="nT",
    )
    found = field_direction(true_turn(made), samples, stars)
    field_c = samples.field @ made.rot_mc
    expected = np.einsum("nji,nj->ni", attitude(moments), field_c)
    off = found.field_i - expected
    apart = np.linalg.norm(np.cross(expected, off), axis=1) / (expected**2).sum(axis=1) / ARCSEC_RAD
    assert apart.max() > 300  # arcseconds
    assert (apart < 2.5 * found.sd_arcsec).all()


@pytest.mark.parametrize("apart_s", [0.0, 3e-7])
def test_a_reading_at_an_attitude_has_it_be_it_first_last_or_alone(apart_s: float) -> None:
    made = simulate_session(seed=3)
    night = made.session
    at_once = replace(night.star, time=compute_unix_s(night.magnetometer) + apart_s)
    found = field_direction(true_turn(made), night.magnetometer, at_once, night.site)
    assert (len(found), found.left_out) == (480, 0)
    own = np.einsum("nji,nj->ni", at_once.rot_ci, night.magnetometer.field @ made.rot_mc)
    alone = replace(at_once, refraction="removed", aberration="removed")
    exact = field_direction(true_turn(made), night.magnetometer, alone)
    np.testing.assert_allclose(exact.field_i, own, atol=1e-6)
    one = replace(alone, orientation=np.arange(480))
    single = field_direction(true_turn(made), night.magnetometer, one, gap_s=1.0)
    np.testing.assert_allclose(single.field_i, own, atol=1e-6)


def test_bad_input_is_named(tmp_path) -> None:
    made = simulate_session(seed=1)
    night, turn = made.session, true_turn(made)
    with pytest.raises(FrameError, match="alignment with a star sensor"):
        field_direction(replace(turn, frame_out="b"), night.magnetometer, night.star)
    with pytest.raises(AgonicError, match="the errors of the attitudes"):
        field_direction(turn, night.magnetometer, replace(night.star, covariance=None), night.site)
    later = replace(night.star, time=night.star.time + 86_400)
    with pytest.raises(AgonicError, match="none of 480 readings has an attitude"):
        field_direction(turn, night.magnetometer, known(later), night.site)
    unsure = replace(turn, covariance=None)
    found = field_direction(unsure, night.magnetometer, known(night.star), night.site)
    assert "leave out those of alignment" in found.notes[0]


@pytest.mark.usefixtures("empty_folder")
def test_from_a_session_to_a_table(capsys, tmp_path) -> None:
    assert answer(capsys, "simulate", "alignment", "-o", "night", "--seed", "4")[0] == 0
    assert answer(capsys, "fit", "alignment", "night", "-o", "cal.json")[0] == 0
    said = ("direction", "cal.json", "night", "-o", "field.csv", "--report", "page.html")
    status, told = answer(capsys, *said)
    assert (status, told["schema"]) == (0, "agonic/direction@1")
    rows = (tmp_path / "field.csv").read_text().splitlines()
    assert len(rows) == told["n"] + 1
    assert "declination_sd_deg" in rows[0]
    assert "Inclination" in (tmp_path / "page.html").read_text()
    magnetometer = ("direction", "cal.json", "night/magnetometer.csv", "-o", "again.csv")
    assert "--stars" in complaint(capsys, *magnetometer)
    stars = ("--stars", "night/star.csv", "--at", "52.0725,12.675")
    own = ("--across", "3", "--about", "20", "--refraction", "present", "--aberration", "removed")
    status, again = answer(capsys, *magnetometer, *stars, *own)
    assert status == 0
    assert again["inclination_deg_median"] == pytest.approx(
        told["inclination_deg_median"], abs=0.01
    )
