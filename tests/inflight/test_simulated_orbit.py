"""`simulate_orbit`: its mechanics, what it meets on the way, and that its truth undoes it."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.errors import AgonicError
from agonic.inflight.simulation.kepler import GRAVITATION_M3_S2, Orbit, compute_state_i
from agonic.inflight.simulation.orbit import SimulatedOrbit, simulate_orbit
from agonic.maths.earth.geodesy import SEMI_MAJOR_M, directions, earth_fixed, earth_fixed_position
from agonic.maths.rotations.attitude import rot_nb

nT = 1.0


@pytest.fixture(scope="module")
def day() -> SimulatedOrbit:
    """A day with everything that disturbs, but for noise."""
    return simulate_orbit(
        n=8640,
        rate_Hz=0.1,
        noise=0.0,
        moved=2000.0,
        drift=200.0,
        jump=300.0,
        jump_at=0.25,
        walk_nT_h=5.0,
        torquer=3000.0,
        scalar_sd=0.1,
        mounting_deg=2.0,
        seed=4,
    )


def corrected(made: SimulatedOrbit) -> np.ndarray:
    """The field in sensor axes that the truth makes of the readings."""
    matrix = made.truth.matrix_at(made.samples.temperature)
    return np.einsum("nij,nj->ni", matrix, made.samples.field - made.bias)


# --- truth -------------------------------------------------------------------------------------


def test_the_truth_undoes_the_readings(day: SimulatedOrbit) -> None:
    quiet = day.samples.flagged == 0
    np.testing.assert_allclose(corrected(day)[quiet], day.field_m()[quiet], atol=1e-6 * nT)
    apart = np.linalg.norm(corrected(day) - day.field_m(), axis=1)[~quiet]
    assert apart.min() > 2000 * nT  # what torquers add is in no row that is not flagged
    assert 0.15 < (~quiet).mean() < 0.25


def test_attitude_and_mounting_take_the_reading_to_the_field(day: SimulatedOrbit) -> None:
    s = day.samples
    body = Rotation.from_matrix(rot_nb(s.roll_deg, s.pitch_deg, s.heading_deg))
    turned = (body * day.rot_bm).apply(corrected(day))
    quiet = s.flagged == 0
    np.testing.assert_allclose(turned[quiet], day.field_n[quiet], atol=1e-4 * nT)
    assert np.degrees(day.rot_bm.magnitude()) == pytest.approx(2.0)


def test_the_field_is_the_world_models_and_what_lies_outside(day: SimulatedOrbit) -> None:
    s = day.samples
    when = np.datetime64(s.epoch.replace(tzinfo=None)) + np.round(s.time * 1e3).astype("m8[ms]")
    model = ag.wmm().at(s.latitude_deg, s.longitude_deg, s.altitude_m, when)
    np.testing.assert_allclose(day.field_n - day.external_n, model.field_n, atol=0.01 * nT)
    np.testing.assert_allclose(s.scalar, np.linalg.norm(day.field_n, axis=1), atol=0.6 * nT)
    assert np.std(s.scalar - np.linalg.norm(day.field_n, axis=1)) == pytest.approx(0.1, rel=0.05)


def test_the_bias_moves_as_asked() -> None:
    still = {"noise": 0.0, "thermal": 0.0, "n": 2001, "rate_Hz": 0.1, "external": 0.0}
    made = simulate_orbit(moved=2000.0, drift=200.0, jump=300.0, jump_at=0.5, **still)
    moved = made.truth.bias[0] - made.ground.bias[0]
    assert np.linalg.norm(moved) == pytest.approx(2000.0)
    steps = np.linalg.norm(np.diff(made.bias, axis=0), axis=1)
    assert np.linalg.norm(made.bias[999] - made.bias[0]) == pytest.approx(200.0 * 999 / 2000)
    assert steps.argmax() == 999
    assert steps.max() == pytest.approx(300.0, abs=0.2)
    walks = [simulate_orbit(walk_nT_h=60.0, seed=k, **still).bias[[0, -1]] for k in range(20)]
    hours = 20_000 / 3600
    assert np.std(np.diff(walks, axis=1)) == pytest.approx(60.0 * np.sqrt(hours), rel=0.2)


def test_the_bias_follows_the_temperature() -> None:
    made = simulate_orbit(n=600, rate_Hz=0.1, thermal=1500.0, noise=0.0)
    temperature = made.samples.temperature
    np.testing.assert_allclose(made.bias, made.truth.bias_at(temperature))
    spread = np.ptp(made.truth.bias_at(np.linspace(-30.0, 50.0, 500)), axis=0)
    assert spread.max() <= 1500.0 + 1e-6
    assert spread.min() >= 0.2 * 1500.0 - 1.0
    assert np.ptp(made.truth.matrix_at([-20.0, 40.0]), axis=0).max() == 0.0


def test_a_given_sensor_is_the_one_that_flies() -> None:
    affine = ag.Affine(bias=[1e4, -2e4, 5e3], matrix=np.diag([1.02, 0.98, 1.0]), model="diagonal")
    made = simulate_orbit(n=300, sensor=affine, noise=0.0, external=0.0)
    np.testing.assert_allclose(affine.correct(made.samples.field), made.field_m(), atol=1e-6)
    again = simulate_orbit(n=300, sensor=made.ground, noise=0.0, external=0.0)
    np.testing.assert_array_equal(again.samples.field, made.samples.field)


# --- the way -----------------------------------------------------------------------------------


def test_circular_orbits_keep_their_height_speed_and_period() -> None:
    orbit = Orbit(altitude_m=700e3, inclination_deg=60.0)
    time = np.linspace(0, orbit.period_s, 1000)
    position, velocity = compute_state_i(orbit, time)
    radius = SEMI_MAJOR_M + 700e3
    np.testing.assert_allclose(np.linalg.norm(position, axis=0), radius)
    np.testing.assert_allclose(
        np.linalg.norm(velocity, axis=0), np.sqrt(GRAVITATION_M3_S2 / radius)
    )
    numeric = np.gradient(position, time, axis=1)[:, 5:-5]
    np.testing.assert_allclose(numeric, velocity[:, 5:-5], atol=15.0)  # m/s; the node moves too
    assert np.degrees(np.arcsin(position[2] / radius)).max() == pytest.approx(60.0, abs=0.01)


def test_eccentric_orbits_keep_energy_and_angular_momentum() -> None:
    orbit = Orbit(altitude_m=2_000e3, eccentricity=0.15, perigee_deg=40.0, anomaly_deg=10.0)
    position, velocity = compute_state_i(orbit, np.linspace(0, orbit.period_s, 500))
    radius, speed = np.linalg.norm(position, axis=0), np.linalg.norm(velocity, axis=0)
    energy = speed**2 / 2 - GRAVITATION_M3_S2 / radius
    np.testing.assert_allclose(energy, -GRAVITATION_M3_S2 / (2 * orbit.semi_major_m))
    spin = np.linalg.norm(np.cross(position, velocity, axis=0), axis=0)
    np.testing.assert_allclose(
        spin, np.sqrt(GRAVITATION_M3_S2 * orbit.semi_major_m * (1 - 0.15**2))
    )
    assert radius.min() == pytest.approx(orbit.semi_major_m * 0.85, rel=1e-4)


def test_a_sun_synchronous_orbit_turns_once_a_year() -> None:
    """800 km and 98.6°: the node moves by 0.9856° a day (Vallado, section 11.4.1)."""
    orbit = Orbit(altitude_m=800e3, inclination_deg=98.6, node_deg=0.0)
    position, velocity = compute_state_i(orbit, np.array([0.0, 86_400.0]))
    normal = np.cross(position, velocity, axis=0)
    node = np.degrees(np.arctan2(normal[0], -normal[1]))
    assert node[1] - node[0] == pytest.approx(0.9856, abs=0.01)


def test_against_sgp4_for_a_day() -> None:
    """The same elements through another propagator: planes within arcminutes."""
    api = pytest.importorskip("sgp4.api")
    satellite = api.Satrec()
    orbit = Orbit(altitude_m=600e3, inclination_deg=75.0, node_deg=30.0, eccentricity=0.001)
    satellite.sgp4init(
        api.WGS72,
        "i",
        99999,
        27_000.0,
        0.0,
        0.0,
        0.0,
        orbit.eccentricity,
        0.0,
        np.radians(75.0),
        0.0,
        orbit.motion_rad_s * 60,
        np.radians(30.0),
    )
    days = satellite.jdsatepochF + np.array([0.0, 1.0])
    _, theirs, speeds = satellite.sgp4_array(np.full(2, satellite.jdsatepoch), days)
    ours = compute_state_i(orbit, np.array([0.0, 86_400.0]))
    plane = np.cross(*ours, axis=0).T
    for k, theirs_too in enumerate(np.cross(theirs, speeds)):
        cosine = plane[k] @ theirs_too / np.linalg.norm(plane[k]) / np.linalg.norm(theirs_too)
        assert np.degrees(np.arccos(cosine)) < 0.05
    turned = np.degrees(np.arccos(plane[0] @ plane[1] / np.linalg.norm(plane[0]) ** 2))
    assert turned > 1.5  # of which nothing would be left without the Earth's flattening
    np.testing.assert_allclose(ours[0][:, 0] / 1e3, theirs[0], atol=25.0)  # km, short periods


def test_positions_are_geodetic_and_under_the_satellite() -> None:
    made = simulate_orbit(n=200, rate_Hz=0.05, orbit=Orbit(node_deg=10.0))
    s = made.samples
    where = earth_fixed_position(directions(s.latitude_deg, s.longitude_deg), s.altitude_m)
    np.testing.assert_allclose(np.linalg.norm(where, axis=0), SEMI_MAJOR_M + 500e3, rtol=1e-12)
    ground_speed = np.linalg.norm(np.diff(where, axis=1), axis=0) / 20.0
    assert 7000 < ground_speed.min() < ground_speed.max() < 7900  # m/s


# --- aboard ------------------------------------------------------------------------------------


def test_nadir_pointing_looks_down_and_forward() -> None:
    made = simulate_orbit(n=5000, rate_Hz=0.2, pace_s=600.0)
    down = made.rot_nb.as_matrix()[:, :, 2]
    tilt = np.degrees(np.arccos(down[:, 2]))
    assert np.median(tilt) < 6.0
    assert tilt.max() < 20.0
    s = made.samples
    east = np.diff(s.longitude_deg) * np.cos(np.radians(s.latitude_deg[1:]))
    heading = np.degrees(np.arctan2(east, np.diff(s.latitude_deg)))
    off = (s.heading_deg[1:] - heading + 180) % 360 - 180
    away_from_poles = np.abs(s.latitude_deg[1:]) < 70
    assert np.median(np.abs(off[away_from_poles])) < 6.0


def test_tumbling_reaches_all_sides() -> None:
    made = simulate_orbit(n=5000, rate_Hz=0.1, pointing="tumble", pace_s=200.0)
    for axis in np.moveaxis(made.rot_nb.as_matrix(), 2, 0):
        np.testing.assert_allclose(axis.mean(axis=0), 0.0, atol=0.1)
        np.testing.assert_allclose((axis**2).mean(axis=0), 1 / 3, atol=0.06)


def test_attitude_carries_the_star_cameras_noise() -> None:
    made = simulate_orbit(n=4000, attitude_sd_deg=0.01)
    s = made.samples
    body = Rotation.from_matrix(rot_nb(s.roll_deg, s.pitch_deg, s.heading_deg))
    errors = np.degrees((made.rot_nb.inv() * body).as_rotvec())
    np.testing.assert_allclose(errors.std(axis=0), 0.01, rtol=0.05)
    assert simulate_orbit(n=10, attitude_sd_deg=None).samples.heading_deg is None


def test_it_is_cold_in_the_shadow() -> None:
    made = simulate_orbit(n=20_000, rate_Hz=0.1, equilibrium_C=(-40.0, 60.0), settling_s=600.0)
    share = made.eclipse.mean()
    assert 0.2 < share < 0.42  # of a low orbit that is not flown along the terminator
    temperature = made.samples.temperature
    assert -40.0 < temperature.min() < 0.0 < 40.0 < temperature.max() < 60.0
    change = np.diff(temperature)
    assert (change[made.eclipse[1:]] < 0).all()
    assert (change[~made.eclipse[1:]] > 0).all()


def test_the_ring_current_is_along_the_dipole_and_keeps_its_time() -> None:
    made = [
        simulate_orbit(n=3000, rate_Hz=0.01, external=40.0, correlation_s=3000.0, seed=k)
        for k in range(3)
    ]
    size = np.sqrt(np.mean([(m.external_n**2).sum(axis=1).mean() for m in made]))
    assert size == pytest.approx(40.0 * np.sqrt(1.5), rel=0.1)
    equator = [m.external_n[np.abs(m.samples.latitude_deg) < 20] for m in made]
    north, east, down = np.concatenate(equator).std(axis=0)
    assert north == pytest.approx(40.0, rel=0.15)
    assert max(east, down) < 30.0
    kept = [correlation(earth_axes(m), lag=30) for m in made]
    assert np.mean(kept) == pytest.approx(np.exp(-1.0), abs=0.1)


def earth_axes(made: SimulatedOrbit) -> np.ndarray:
    """The ring current's field (n, 3) in Earth-fixed axes, where it does not turn."""
    s = made.samples
    return earth_fixed(made.external_n.T, directions(s.latitude_deg, s.longitude_deg)).T


def correlation(vectors: np.ndarray, lag: int) -> float:
    return float(np.sum(vectors[lag:] * vectors[:-lag]) / np.sum(vectors**2))


def test_quantisation_and_noise() -> None:
    made = simulate_orbit(n=3000, noise=100.0, step=50.0)
    steps = made.samples.field / 50.0
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    left = made.samples.field - simulate_orbit(n=3000, noise=0.0).samples.field
    np.testing.assert_allclose(left.std(axis=0), np.hypot(100.0, 50.0 / np.sqrt(12)), rtol=0.05)


def test_one_setting_does_not_change_what_another_draws() -> None:
    plain = simulate_orbit(n=100, seed=2)
    more = simulate_orbit(n=100, seed=2, torquer=1.0, scalar_sd=1.0, walk_nT_h=1.0, moved=5.0)
    np.testing.assert_array_equal(plain.external_n, more.external_n)
    np.testing.assert_array_equal(plain.rot_nb.as_quat(), more.rot_nb.as_quat())
    assert not np.array_equal(plain.external_n, simulate_orbit(n=100, seed=3).external_n)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"pointing": "sun"}, "pointing 'sun' is not known"),
        ({"n": 0}, "n is 0; a simulation needs it above zero"),
        ({"noise": -1.0}, "noise is -1.0"),
        ({"torquer_share": 2.0}, "torquer_share is 2.0; it needs a share"),
        ({"epoch": datetime(1850, 1, 1, tzinfo=UTC)}, "IGRF-14 holds from"),
    ],
)
def test_what_makes_no_sense_is_refused(wrong: dict, said: str) -> None:
    with pytest.raises(AgonicError, match=said):
        simulate_orbit(**{"n": 10} | wrong)


def test_an_orbit_below_the_ground_is_refused() -> None:
    with pytest.raises(AgonicError, match="comes down to"):
        Orbit(altitude_m=500e3, eccentricity=0.1)
