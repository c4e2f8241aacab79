"""The estimator by magnitude, dip and azimuth, on points of about one."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from agonic.maths.equation.affine import split
from agonic.maths.equation.channels import (
    Dip,
    Problem,
    field_of_terms,
    pieces,
)
from agonic.maths.equation.maximum_likelihood import estimate, find_attitude_shares
from agonic.maths.equation.priors import compute_turn
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.loss import squares

H, Z = 0.5, np.sqrt(0.75)
W = np.array([[1.05, 0.04, -0.03], [0.04, 0.95, 0.02], [-0.03, 0.02, 1.02]])
BIAS = np.array([0.8, -0.5, 0.3])


def problem(n: int = 1500, *, noise=0.003, tilt_deg=15.0, seed=0, turn_deg=0.0, slope=None, **more):
    """A vehicle at all headings, tilted a little, with a sensor that may sit turned in it."""
    rng = np.random.default_rng(seed)
    yaw, roll, pitch = rng.uniform(-1, 1, (3, n)) * [[180.0], [tilt_deg], [tilt_deg]]
    rot_nb = Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], 1), degrees=True).as_matrix()
    field_b = np.einsum("nji,j->ni", rot_nb, [H, 0.0, Z])
    matrix = Rotation.from_euler("y", turn_deg, degrees=True).as_matrix() @ W
    terms = None if slope is None else rng.normal(size=(n, 1))
    points = field_b @ np.linalg.inv(matrix).T + BIAS + noise * rng.normal(size=(n, 3))
    if slope is not None:
        points = points + terms @ np.array([slope])
    known = {
        "dip": Dip(rot_nb[:, 2], np.array([H]), np.array([Z])),
        "terms": terms,
        "model": "full",
        "gauge": "symmetric",
        "soft_iron_sd": None,
        "turn_sd": 0.05,
    }
    return Problem(points, np.array([np.hypot(H, Z)]), **(known | more)), rot_nb


def fitted(given: Problem, **settings):
    found = estimate(given, **settings)
    m = given.basis.shape[1]
    return found, *split(given.basis @ found.solution.params[:m])


def test_roll_pitch_and_intensities_find_bias_and_matrix_of_a_vehicle_that_hardly_tilts() -> None:
    found, bias, matrix = fitted(problem()[0])
    assert bias == pytest.approx(BIAS, abs=0.01)
    assert matrix == pytest.approx(W, abs=0.01)
    assert found.noise["magnitude"].sd == pytest.approx(0.003, rel=0.1)
    assert found.noise["dip"].sd == pytest.approx(0.003, rel=0.1)


def test_a_step_keeps_to_lines_on_which_the_field_is_linear() -> None:
    given, _ = problem(20, slope=[0.3, -0.2, 0.1], gauge="free")
    rng = np.random.default_rng(0)
    params = np.r_[BIAS, W[0, 0], W[1, 1], W[2, 2], W[0, 1], W[0, 2], W[1, 2], W[1, 0], W[2, 0]]
    params = np.r_[params, W[2, 1], 0.3, -0.2, 0.1] + 0.1 * rng.normal(size=15)
    step = 0.2 * rng.normal(size=15)

    def field(there: np.ndarray) -> np.ndarray:
        bias, matrix = split(given.basis @ there[:12])
        return (given.points - field_of_terms(given, there) - bias) @ matrix.T

    here, half, whole = (field(given.move(params, share * step)) for share in (0.0, 0.5, 1.0))
    assert half == pytest.approx((here + whole) / 2, abs=1e-12)
    tiny = 1e-7
    beside = (field(given.move(params, tiny * step)) - here) / tiny
    straight = (field(params + tiny * step) - here) / tiny
    assert beside == pytest.approx(straight, abs=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_gain_and_bias_that_vouch_for_each_other_are_followed_to_the_minimum(seed: int) -> None:
    """Tilts of half a degree leave a long curved valley, in which straight steps never end."""
    given, _ = problem(300, noise=0.002, tilt_deg=0.5, seed=seed, gauge="free", soft_iron_sd=0.1)
    found, _, _ = fitted(given)
    assert found.solution.converged
    assert found.solution.iterations < 9
    prior, noise = given.prior(given.soft_iron_sd), found.noise
    shares = find_attitude_shares(given, noise, found.solution.params)

    def cost(params: np.ndarray) -> np.ndarray:
        sides = [prior(params)[0]]
        for channel, of in noise.items():
            ((r, _),) = pieces(given, channel, noise["magnitude"].sd, shares[channel])(params)
            sides.append(r / of.sd / np.sqrt(of.correlation))
        return np.concatenate(sides)

    best = least_squares(cost, found.solution.params, x_scale="jac")
    gained = np.sum(cost(found.solution.params) ** 2) / 2 - best.cost
    assert gained < 0.01


def test_the_magnitude_alone_would_not_have_found_them() -> None:
    given = problem()[0]
    alone, _, _ = fitted(given._replace(dip=None))
    both, _, _ = fitted(given)
    ratio = np.diag(alone.solution.covariance)[:3] / np.diag(both.solution.covariance)[:3]
    assert ratio.max() > 9.0


def test_errors_of_roll_and_pitch_are_weighed_by_what_they_do() -> None:
    given, _ = problem()
    rng = np.random.default_rng(9)
    down = given.dip.down + 0.02 * rng.normal(size=given.dip.down.shape)
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    found, bias, _ = fitted(given._replace(dip=given.dip._replace(down=down)))
    assert found.noise["magnitude"].sd == pytest.approx(0.003, rel=0.1)
    assert found.noise["dip"].sd == pytest.approx(0.02, rel=0.15)
    assert bias == pytest.approx(BIAS, abs=0.02)


@pytest.mark.parametrize("gauge", ["symmetric", "free"])
def test_a_turned_sensor_needs_the_free_matrix(gauge: str) -> None:
    given, _ = problem(turn_deg=2.0, gauge=gauge)
    found, bias, _ = fitted(given)
    if gauge == "free":
        turn, covariance = compute_turn(given.basis, found.solution)
        assert turn[1] == pytest.approx(np.radians(2.0), abs=0.003)
        assert np.sqrt(covariance[1, 1]) < 0.002
        assert bias == pytest.approx(BIAS, abs=0.01)
    else:
        assert found.noise["dip"].sd > 1.25 * 0.003


def test_a_known_heading_finds_the_turn_about_the_vertical() -> None:
    given, rot_nb = problem(tilt_deg=3.0, gauge="free", turn_sd=None)
    known = given._replace(across=rot_nb[:, 1])
    found, _, matrix = fitted(known)
    assert set(found.noise) == {"magnitude", "dip", "azimuth"}
    assert matrix == pytest.approx(W, abs=0.02)
    without, _, _ = fitted(given._replace(turn_sd=0.1))
    sd = [
        np.sqrt(compute_turn(g.basis, f.solution)[1][0, 0])
        for g, f in ((known, found), (given, without))
    ]
    assert sd[0] < 0.2 * sd[1]


def test_a_term_takes_what_moves_with_it() -> None:
    found, bias, _ = fitted(problem(slope=[0.05, -0.02, 0.08])[0])
    assert found.solution.params[9:] == pytest.approx([0.05, -0.02, 0.08], abs=0.002)
    assert bias == pytest.approx(BIAS, abs=0.01)


def test_outliers_are_left_out() -> None:
    given, _ = problem()
    points = given.points.copy()
    points[::20] += 0.5
    found, bias, _ = fitted(given._replace(points=points))
    assert bias == pytest.approx(BIAS, abs=0.015)
    assert (found.weights[::20] == 0).mean() > 0.95
    assert (np.delete(found.weights, np.s_[::20]) > 0).all()


def test_the_prior_has_the_derivative_it_says() -> None:
    given, _ = problem(gauge="free", soft_iron_sd=0.1, slope=[0.0, 0.0, 0.0])
    prior = given.prior(0.1)
    at = np.random.default_rng(0).normal(size=15) + np.array([0, 0, 0, 2, 2, 2] + [0] * 9)
    jacobian = prior(at)[1]
    numeric = [(prior(at + step)[0] - prior(at - step)[0]) / 2e-6 for step in 1e-6 * np.eye(15)]
    assert jacobian == pytest.approx(np.stack(numeric, axis=1), abs=1e-6)


def test_pieces_of_all_kinds_cover_all_rows_once() -> None:
    given, rot_nb = problem(n=9000)
    given = given._replace(across=rot_nb[:, 1])
    for channel in given.channels:
        sums = leastsq.accumulate(
            pieces(given, channel),
            np.r_[BIAS, 1, 1, 1, 0, 0, 0],
            squares(),
            1.0,
        )
        assert len(sums.residuals) == 9000
