"""The thermal model on arrays: Jacobians, layouts, mountings, and each temperature by itself."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.maths.equation import temperature_model
from agonic.maths.equation.affine import FREE, SYMMETRIC, correction_jacobian, model_basis
from agonic.maths.estimation import leastsq
from agonic.thermal.fit.each_temperature import fit_ellipsoids
from agonic.thermal.fit.known_field_model import KnownFieldReadings, choose_model
from agonic.thermal.fit.problem import Scale, Settings
from agonic.thermal.maths import (
    estimate,
    gaussian_process,
    station_residuals,
    stations,
)
from agonic.thermal.maths.prior import make_prior
from agonic.thermal.maths.stations import list_standard_rotations

RNG = np.random.default_rng(0)


def drawn(gauge: str = SYMMETRIC, degree: int = 2, rate: bool = True, n: int = 30):
    rng = np.random.default_rng(1)
    onto = temperature_model.build_layout(degree, gauge, rate)
    x = rng.uniform(-1, 1, n)
    phi = temperature_model.build_covariates(x, 0.0, degree, rng.normal(size=n) if rate else None)
    p = degree + 1
    coefficients = 0.05 * rng.normal(size=onto.shape[1])
    coefficients[[3 * p, 4 * p, 5 * p]] += 1.0
    return onto, phi, coefficients, rng.normal(size=(n, 3))


@pytest.mark.parametrize("gauge", [SYMMETRIC, FREE])
def test_the_jacobian_of_the_magnitude_is_its_derivative(gauge: str, derivative) -> None:
    onto, phi, start, raw = drawn(gauge)

    def r(coefficients):
        bias, matrix = temperature_model.evaluate_local(coefficients, onto, phi)
        return temperature_model.size_residual(raw, bias, matrix, np.ones(30))[0]

    bias, matrix = temperature_model.evaluate_local(start, onto, phi)
    by = temperature_model.chain_to_coefficients(
        temperature_model.size_residual(raw, bias, matrix, np.ones(30))[1], onto, phi
    )
    assert by == pytest.approx(derivative(r, start, 1e-6), abs=1e-7)


@pytest.mark.parametrize("gauge", [SYMMETRIC, FREE])
def test_the_jacobians_of_readings_and_field_are_their_derivatives(gauge: str, derivative) -> None:
    onto, phi, start, raw = drawn(gauge)
    field = RNG.normal(size=(30, 3))

    def r(coefficients):
        bias, matrix = temperature_model.evaluate_local(coefficients, onto, phi)
        return temperature_model.reading_residual(raw, bias, matrix, field)[0].ravel()

    def u(coefficients):
        bias, matrix = temperature_model.evaluate_local(coefficients, onto, phi)
        return np.einsum("nij,nj->ni", matrix, raw - bias).ravel()

    bias, matrix = temperature_model.evaluate_local(start, onto, phi)
    thrice = np.repeat(phi, 3, axis=0)
    by = temperature_model.reading_residual(raw, bias, matrix, field)[1].reshape(-1, 12)
    assert temperature_model.chain_to_coefficients(by, onto, thrice) == pytest.approx(
        derivative(r, start, 1e-6), abs=1e-7
    )
    by = correction_jacobian(raw, bias, matrix).reshape(-1, 12)
    assert temperature_model.chain_to_coefficients(by, onto, thrice) == pytest.approx(
        derivative(u, start, 1e-6), abs=1e-7
    )


def campaign(noise: float = 0.0, *, rate: bool = False, fixture_deg: float = 1.0, seed: int = 2):
    """Cells of twelve stations at eleven temperatures, both directions."""
    rng = np.random.default_rng(seed)
    x = np.tile(np.linspace(-1, 1, 11), 24)
    station = np.repeat(np.arange(12), 22)
    lag = np.tile(np.repeat([-1.0, 1.0], 11), 12) if rate else None
    phi = temperature_model.build_covariates(x, 0.0, 2, lag)
    onto = temperature_model.build_layout(2, SYMMETRIC, rate)
    truth = 0.03 * rng.normal(size=onto.shape[1])
    truth[[9, 12, 15]] += 1.0
    field = np.array([0.42, 0.1, 0.0])
    field[2] = np.sqrt(1 - field @ field)
    mount = Rotation.from_euler("zyx", [100, 20, -40], degrees=True).as_matrix()
    off = Rotation.from_rotvec(np.radians(fixture_deg) * rng.normal(size=(12, 3))).as_matrix()
    seen = np.array(
        [mount.T @ (r @ e).T @ field for r, e in zip(list_standard_rotations(), off, strict=True)]
    )
    bias, matrix = temperature_model.evaluate_local(truth, onto, phi)
    points = bias + np.linalg.solve(matrix, seen[station][:, :, None])[:, :, 0]
    points = points + noise * rng.normal(size=points.shape)
    problem = station_residuals.StationProblem(
        points=points,
        covariance=np.tile(max(noise, 1e-6) ** 2 * np.eye(3), (264, 1, 1)),
        phi=phi,
        station=station,
        pace=None,
        degree=2,
        rate=rate,
        rot_nb=list_standard_rotations(),
        fixture_sd=np.radians(1.0),
    )
    start = np.zeros_like(truth)
    start[[9, 12, 15]] = 1.0
    return problem, truth, start, mount


@pytest.mark.parametrize("rate", [False, True])
def test_without_noise_the_truth_comes_back(rate: bool) -> None:
    problem, truth, start, mount = campaign(rate=rate)
    alone = estimate.estimate_by_magnitude(problem, start)
    assert alone.coefficients == pytest.approx(truth, abs=1e-6)
    known = estimate.estimate_by_orientations(problem, alone.coefficients)
    assert known.coefficients == pytest.approx(truth, abs=1e-6)
    assert known.poses is not None
    angle = Rotation.from_matrix(known.poses.mount @ mount.T).magnitude()
    assert np.degrees(angle) < 1.0  # twelve stations that stand off by 1° each
    assert np.degrees(known.fixture_sd) == pytest.approx(1.0, abs=0.5)


@pytest.mark.parametrize("taught", ["magnitude", "turns"])
def test_all_jacobians_of_the_joint_problem_are_derivatives(taught: str, derivative) -> None:
    problem, _, start, _ = campaign(noise=1e-3, rate=True)
    m = len(problem.points)
    time = np.linspace(-0.5, 0.5, m)
    problem = problem._replace(
        pace=time, course=gaussian_process.make_time_basis(time, problem.station)
    )
    poses = None
    if taught == "turns":
        seen = station_residuals.find_directions(problem, start)
        found = stations.find_mounting(seen, problem.rot_nb)
        poses = station_residuals.Poses(seen, found.mount, found.field)
    width = problem.clock.shape[1] * (1 if poses is None else 3)
    slow = gaussian_process.GaussianProcess(0.01, ("smooth", 1.0), 20.0)
    followed = np.zeros((m, 1 if poses is None else 3))
    steady = (np.zeros(width), np.zeros(3))
    state = station_residuals.State(start, *steady, poses, 1e-6, 0.02, slow, followed)
    pieces, prior = station_residuals.make_pieces(problem, state), make_prior(problem, state)
    at = station_residuals.collect_parameters(state, len(start))
    at = at + 1e-3 * RNG.normal(size=len(at))
    _, jacobian = next(iter(pieces(at)))
    found = derivative(lambda p: next(iter(pieces(p)))[0], at, 1e-6)
    assert jacobian == pytest.approx(found, abs=1e-5 * np.abs(found).max())
    _, rows = prior(at)
    found = derivative(lambda p: prior(p)[0], at, 1e-6)
    assert rows == pytest.approx(found, abs=1e-6 * np.abs(found).max())


def test_each_temperature_by_itself_agrees_with_one_solved_alone() -> None:
    problem, _, _, _ = campaign(noise=2e-4)
    points = problem.points.reshape(12, 2, 11, 3)[:, 0].swapaxes(0, 1)
    covariance = np.tile(4e-8 * np.eye(3), (11, 12, 1, 1))
    start = np.tile(np.array([0, 0, 0, 1.0, 1, 1, 0, 0, 0]), (11, 1))
    found = fit_ellipsoids(points, covariance, np.ones((11, 12), dtype=bool), start)
    assert found.determined.all()
    basis = model_basis("full")

    def pieces(params):
        bias, matrix = (basis @ params)[:3], (basis @ params)[3:].reshape(3, 3)
        r, j = temperature_model.size_residual(
            points[4], np.tile(bias, (12, 1)), np.tile(matrix, (12, 1, 1)), np.ones(12)
        )
        weight = 1 / np.linalg.norm(j[:, :3], axis=1)
        yield r * weight, j @ basis * weight[:, None]

    alone = leastsq.solve(pieces, start[4], scale=2e-4, tolerance=1e-8)
    sd = np.sqrt(np.diag(found.covariance[4]))
    assert np.abs(found.values[4] - alone.params).max() < 1e-2 * sd.min()


def test_eight_stations_do_not_determine_a_temperature() -> None:
    there = np.ones((2, 12), dtype=bool)
    there[1, :4] = False
    points = np.tile(np.swapaxes(list_standard_rotations(), 1, 2) @ [0.4, 0.1, 0.911], (2, 1, 1))
    start = np.tile(np.array([0, 0, 0, 1.0, 1, 1, 0, 0, 0]), (2, 1))
    found = fit_ellipsoids(points, np.tile(1e-6 * np.eye(3), (2, 12, 1, 1)), there, start)
    assert found.determined.tolist() == [True, False]


def test_mounting_and_exchanged_stations_are_found() -> None:
    mount = Rotation.from_euler("zyx", [-30, 50, 170], degrees=True).as_matrix()
    field = np.array([0.4, -0.2, np.sqrt(1 - 0.2)])
    seen = np.array([mount.T @ r.T @ field for r in list_standard_rotations()])
    found = stations.find_mounting(seen, list_standard_rotations())
    assert found.mount == pytest.approx(mount, abs=1e-6)
    assert found.field == pytest.approx(field, abs=1e-6)
    order = np.arange(12)
    order[[2, 9]] = 9, 2
    assert stations.find_mounting(seen[order], list_standard_rotations()).rms > np.radians(10)
    swapped, left = stations.find_mistake(seen[order], list_standard_rotations())
    assert swapped == (2, 9)
    assert left < np.radians(1)
    seen[4] = -seen[4]
    alone, left = stations.find_mistake(seen, list_standard_rotations())
    assert alone == (4,)
    assert left < np.radians(1)


@pytest.mark.slow
def test_a_known_field_gives_every_entry_and_noise_does_not_shrink_them() -> None:
    """Noise of 10 % of the field would lower gains by 3 % if it were regressed upon."""
    rng = np.random.default_rng(3)
    errors = []
    for _ in range(8):
        n = 6000
        x, field = rng.uniform(-1, 1, n), rng.normal(size=(n, 3)) / np.sqrt(3)
        phi = temperature_model.build_covariates(x, 0.0, 1)
        onto = temperature_model.build_layout(1, FREE)
        truth = np.concatenate([0.1 * rng.normal(size=6), 0.03 * rng.normal(size=18)])
        truth[[6, 8, 10]] += 1.0
        bias, matrix = temperature_model.evaluate_local(truth, onto, phi)
        raw = bias + np.linalg.solve(matrix, field[:, :, None])[:, :, 0]
        raw = raw + 0.1 * rng.normal(size=raw.shape)
        scale = Scale(np.zeros(3), 1.0, -25.0, 25.0, 1.0, 1.0)
        readings = KnownFieldReadings(raw, field, x, None, scale, 1.0)
        _, found, *_ = choose_model(readings, Settings(degree=1, robust=False), "nT")
        assert found.noise.sd == pytest.approx(0.1, rel=0.05)
        sd = np.sqrt(np.diag(found.covariance))
        errors.append((found.coefficients - truth) / sd)
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(1.0, abs=0.15)
