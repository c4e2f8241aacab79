"""`fit_pair` against simulated truth, bad data, few shots, and real instruments."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.alignment.simulation.laboratory import simulate_gravity
from agonic.inertial.maths.shots import Shots, linearise
from agonic.inertial.pair.simulate import SimulatedShots
from agonic.inertial.pair.solve import point_ahead
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.maths.rotations.tilt import heading_by_vectors_deg
from agonic.units import STANDARD_GRAVITY_M_S2

STRENGTH = ag.Reference.constant(49_000.0)
FREE = [0, 4, 8, 1, 2, 5, 3, 6, 7]
"""Where xx yy zz xy xz yz yx zx zy stand in a matrix, row by row."""


def errors(fit: ag.inertial.PairFit, made: SimulatedShots) -> np.ndarray:
    """The errors of both calibrations (24,) in standard errors."""
    off = []
    for found, true in (
        (fit.accelerometer, made.accelerometer),
        (fit.calibration, made.magnetometer),
    ):
        off += [found.bias - true.bias, (found.matrix - true.matrix).ravel()[FREE]]
    return np.concatenate(off) / np.sqrt(np.diag(fit.covariance))


def sight_deg(fit: ag.inertial.PairFit, samples: ag.Samples) -> np.ndarray:
    """The direction of the sight at each shot, (n, 3) unit vectors: north, east, up."""
    up = fit.accelerometer.correct(samples.acceleration)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    azimuth = np.radians(heading_by_vectors_deg(fit.calibration.correct(samples.field), -up))
    level = np.sqrt(1 - up[:, 0] ** 2)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), up[:, 0]], axis=1)


def scatter_deg(directions: np.ndarray) -> float:
    """rms angle from the mean direction."""
    mean = directions.mean(axis=0)
    cosine = directions @ mean / np.linalg.norm(mean)
    return float(np.degrees(np.sqrt(np.mean(np.arccos(np.clip(cosine, -1, 1)) ** 2))))


def test_the_jacobian_is_the_derivative() -> None:
    rng = np.random.default_rng(1)
    target = np.array([-1, 0, 0, 1, 1, -1, 0])
    shots = Shots(rng.normal(size=(7, 3)), rng.normal(size=(7, 3)), target)
    sight = [0.1, 0.9, 0.2]
    at = np.concatenate(
        [
            0.1 * rng.normal(size=3),
            [1.0, 1.1, 0.9, 0.1, 0.05, -0.1],
            0.1 * rng.normal(size=3),
            (np.eye(3) + 0.1 * rng.normal(size=(3, 3))).ravel(),
            [0.5],
            sight,
            [0.2, 0.3, -0.1, 0.4],
        ]
    )
    found = linearise(shots, at)
    for k, step in enumerate(1e-6 * np.eye(len(at))):
        if k in (25, 27):  # the elevation of a target only weighs its azimuth
            continue
        ahead, behind = linearise(shots, at + step), linearise(shots, at - step)
        slope = (ahead.residuals - behind.residuals) / 2e-6
        np.testing.assert_allclose(found.jacobian[:, :, k], slope, atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"targets": 0, "attitudes": 24},
        {"targets": 0, "attitudes": 14},
        {"noise": 300.0, "accelerometer_noise": 0.05, "pointing_deg": 0.2},
    ],
)
def test_the_standard_errors_are_honest(settings: dict) -> None:
    z, left_out = [], 0
    for seed in range(5):
        made = ag.inertial.simulate_shots(seed=seed, **settings)
        fit = ag.fit_pair(made.samples, STRENGTH)
        assert fit.verdict != "refused"
        z.append(errors(fit, made))
        left_out += len(fit.left_out)
    assert 0.85 < np.sqrt(np.mean(np.square(z))) < 1.2
    assert left_out <= 2
    assert np.abs(np.mean(z, axis=0)).max() < 3.5 / np.sqrt(len(z))  # of 24, the largest


@pytest.mark.slow
def test_the_biases_and_the_dip_are_as_good_as_they_can_be() -> None:
    """Errors beside the Cramér–Rao bound of the whole model: known noise, no prior."""
    z = []
    for seed in range(6):
        made = ag.inertial.simulate_shots(attitudes=30, targets=3, rolls=10, seed=seed)
        fit = ag.fit_pair(made.samples, STRENGTH)
        off = np.concatenate(
            [
                fit.accelerometer.bias - made.accelerometer.bias,
                fit.calibration.bias - made.magnetometer.bias,
                [np.radians(fit.inclination_deg - 66.0)],
            ]
        )
        z.append(off / np.sqrt(bound(made)))
    assert 0.8 < np.sqrt(np.mean(np.square(z))) < 1.2


def bound(made: SimulatedShots) -> np.ndarray:
    """The least variances (7,) of both biases and the dip, by another way than the fit's own.

    Every attitude is unknown here, and the six readings of each shot are what is observed; the
    derivatives are differences.
    """
    target = made.samples.target.astype(int)
    on, n = np.flatnonzero(target), len(target)
    body = point_ahead(made.sight)
    shapes = (body.T @ made.accelerometer.matrix, body.T @ made.magnetometer.matrix)
    rot_na = made.rot_nb * Rotation.from_matrix(body)
    sight_n = rot_na[on].apply(made.sight)

    def predict(x: np.ndarray) -> np.ndarray:
        """Readings in units of their noise, and the sight on its targets in those of pointing."""
        turned = rot_na * Rotation.from_rotvec(x[27:][: 3 * n].reshape(n, 3))
        dip = np.radians(66.0) + x[6]
        field = 49_000.0 * np.array([np.cos(dip), 0.0, np.sin(dip)])
        force = shapes[0] + unpack_symmetric(x[7:13])
        soft = shapes[1] + x[13:22].reshape(3, 3)
        up = turned.apply([0.0, 0.0, -STANDARD_GRAVITY_M_S2], inverse=True)
        acc = up @ np.linalg.inv(force).T + x[:3]
        mag = turned.apply(field, inverse=True) @ np.linalg.inv(soft).T + x[3:6]
        sight = turned[on].apply(made.sight + np.array([0.0, x[22], x[23]]))
        aimed = Rotation.from_rotvec(x[27 + 3 * n :].reshape(-1, 3)[target[on] - 1]).apply(sight_n)
        seen = np.concatenate([acc.ravel() / 0.02, mag.ravel() / 150.0])
        return np.concatenate([seen, (sight - aimed).ravel() / np.radians(0.1)])

    m = 27 + 3 * n + 3 * int(target.max())
    sizes = np.full(m, 1e-6)
    sizes[3:6] = 1e-2
    columns = [(predict(d) - predict(-d)) / (2 * d.max()) for d in np.diag(sizes)]
    jacobian = np.stack(columns, axis=1)
    scale = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-12)
    whole = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale), rcond=1e-11)
    return (np.diag(whole) / scale**2)[:7]


def test_the_sight_the_turn_and_the_dip_are_found() -> None:
    made = ag.inertial.simulate_shots(attitudes=16, seed=3)
    fit = ag.fit_pair(made.samples)
    assert np.degrees(np.linalg.norm(fit.sight.axis - made.sight)) < 4 * fit.sight.sd_deg
    assert abs(fit.inclination_deg - 66.0) < 4 * fit.inclination_sd_deg
    later = ag.inertial.simulate_shots(attitudes=0, targets=1, rolls=24, seed=3, survey=1).samples
    assert scatter_deg(sight_deg(fit, later)) < 0.8


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_one_bad_shot_is_named_and_does_no_harm(seed: int) -> None:
    clean, bad = (ag.inertial.simulate_shots(seed=seed, bad=count) for count in (0, 1))
    fit, best = (ag.fit_pair(made.samples, STRENGTH) for made in (bad, clean))
    assert fit.left_out.tolist() == bad.bad.tolist()
    assert f"shot {bad.bad[0] + 1} does not fit" in fit.status.lower()
    assert fit.verdict == best.verdict
    assert np.sqrt(np.mean(errors(fit, bad) ** 2)) < 1.8


@pytest.mark.slow
def test_of_several_bad_shots_no_harm_is_left() -> None:
    square = []
    for seed in range(100, 106):
        made = ag.inertial.simulate_shots(seed=seed, bad=3)
        fit = ag.fit_pair(made.samples, STRENGTH)
        if fit.verdict != "refused":
            square.append(np.mean(errors(fit, made) ** 2))
    assert len(square) > 3
    assert np.sqrt(np.mean(square)) < 1.5


def test_arrays_and_numbers_will_do() -> None:
    samples = ag.inertial.simulate_shots(seed=1).samples
    table = {"mag_x_nT": samples.field[:, 0], "mag_y_nT": samples.field[:, 1]}
    table |= {"mag_z_nT": samples.field[:, 2], "target": samples.target}
    table |= {f"acc_{a}_m_s2": samples.acceleration[:, k] for k, a in enumerate("xyz")}
    np.testing.assert_allclose(
        ag.fit_pair(table, 49_000.0).calibration.matrix,
        ag.fit_pair(samples, STRENGTH).calibration.matrix,
    )


def test_shots_among_iron_are_refused() -> None:
    fit = ag.fit_pair(ag.inertial.simulate_shots(seed=4, bad=14).samples)
    assert fit.verdict == "refused"
    assert {"field varies", "shots disagree"} & {f.name for f in fit.findings}


def test_few_shots_are_refused_with_what_to_add() -> None:
    few = ag.inertial.simulate_shots(attitudes=8, targets=0).samples
    with pytest.raises(ag.CoverageError, match=r"8 attitudes.*12 are needed.*nose up"):
        ag.fit_pair(few)
    level = ag.inertial.simulate_shots(attitudes=20, targets=0, tilt_deg=3.0, noise=300.0).samples
    fit = ag.fit_pair(level)
    assert fit.verdict == "refused"
    assert "attitudes missing" in [f.name for f in fit.findings]
    assert fit.prior_only
    assert len(fit.to_add) > 2
    assert any("up" in one or "down" in one for one in fit.to_add)


def test_what_is_to_be_added_helps_more_than_what_is_there() -> None:
    made = ag.inertial.simulate_shots(attitudes=12, targets=0, tilt_deg=20.0)
    spread = ag.inertial.simulate_shots(attitudes=18, targets=0)
    wide, narrow = ag.fit_pair(spread.samples), ag.fit_pair(made.samples)
    assert narrow.heading_sd_deg > 2 * wide.heading_sd_deg


def test_shots_that_miss_their_target_are_found_out() -> None:
    made = ag.inertial.simulate_shots(targets=0, attitudes=24, seed=1)
    wrong = made.samples.with_columns(target=np.repeat([1.0, 2.0, 3.0], 8))
    fit = ag.fit_pair(wrong)
    assert fit.verdict == "check"
    assert "not kept on target" in fit.status
    assert fit.sight is None
    np.testing.assert_allclose(fit.calibration.bias, ag.fit_pair(made.samples).calibration.bias)
    loose = ag.fit_pair(ag.inertial.simulate_shots(pointing_deg=2.0, seed=1).samples)
    assert "sight not kept" in [f.name for f in loose.findings]


def test_the_sign_of_gravity_is_told_by_the_place() -> None:
    made = ag.inertial.simulate_shots(seed=5)
    turned = made.samples.with_columns(acceleration=-made.samples.acceleration)
    doubted = ag.fit_pair(turned)
    assert doubted.verdict == "check"
    assert "field points up" in [f.name for f in doubted.findings]
    dip = np.radians(66.0)
    place = ag.Reference.horizontal_vertical(49_000 * np.cos(dip), 49_000 * np.sin(dip))
    fit, straight = ag.fit_pair(turned, place), ag.fit_pair(made.samples, place)
    assert "gravity reversed" in [f.name for f in fit.findings]
    np.testing.assert_allclose(fit.accelerometer.matrix, -straight.accelerometer.matrix, atol=1e-6)
    np.testing.assert_allclose(fit.calibration.matrix, straight.calibration.matrix, atol=1e-6)


def test_a_magnetometer_that_is_mounted_the_other_way_round_is_found() -> None:
    made = ag.inertial.simulate_shots(seed=6)
    turn = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    fit = ag.fit_pair(made.samples.with_columns(field=made.samples.field @ turn.T))
    straight = ag.fit_pair(made.samples)
    assert fit.verdict == straight.verdict
    np.testing.assert_allclose(
        fit.calibration.matrix @ turn, straight.calibration.matrix, atol=2e-3
    )


def test_rows_of_a_station_are_one_shot() -> None:
    made = ag.inertial.simulate_shots(attitudes=20, targets=0, seed=7)
    rows = np.repeat(np.arange(20), 5)
    numbered = made.samples.select(rows).with_columns(station=rows + 1.0)
    fit = ag.fit_pair(numbered)
    np.testing.assert_allclose(fit.calibration.bias, ag.fit_pair(made.samples).calibration.bias)
    assert fit.shot.tolist() == list(range(1, 21))


def test_stretches_at_rest_are_found_in_a_recording() -> None:
    made = simulate_gravity(seed=1, bias=(2000.0, -1000.0, 500.0))
    fit = ag.fit_pair(made.samples)
    assert (fit.n, fit.verdict) == (24, "good")
    turn = Rotation.from_matrix(fit.rot_am @ made.rot_bm.T).as_rotvec(degrees=True)
    assert np.abs(turn / fit.turn_sd_deg).max() < 4
    assert fit.turn_sd_deg.max() < 0.05


def test_without_acceleration_nothing_can_be_done() -> None:
    with pytest.raises(ag.LogError, match="without acceleration"):
        ag.fit_pair(ag.inertial.simulate_shots().samples.with_columns(acceleration=None))


@pytest.mark.slow
@pytest.mark.recordings
def test_real_instruments_keep_their_sight(recordings) -> None:
    """Each rolled set by the calibration of all other shots; the makers aim at half a degree."""
    scatter = []
    for file in sorted((recordings / "instruments").glob("*.csv")):
        shots = ag.read(file)
        for held_out in (1, 2):
            fit = ag.fit_pair(shots.select(shots.target != held_out))
            assert fit.verdict != "refused"
            scatter.append(scatter_deg(sight_deg(fit, shots.select(shots.target == held_out))))
    assert np.median(scatter) < 0.5
    assert np.mean(np.square(scatter) < 1.0) > 0.8
