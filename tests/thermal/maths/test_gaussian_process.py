"""Slow changes as correlated noise, against the dense covariance and against what was drawn."""

import numpy as np
import pytest

from agonic.maths.estimation.inference import average_over_term
from agonic.thermal.maths import gaussian_process

STATIONS, EACH = 5, 40


def drawn(seed: int, sd: float, kind: gaussian_process.Kind = ("smooth", 0.7), axes: int = 1):
    """Whitened residuals of white noise with slow changes, the fields' part, and a Jacobian."""
    rng = np.random.default_rng(seed)
    station = np.repeat(np.arange(STATIONS), EACH)
    time = np.tile(np.linspace(0.0, 100.0, EACH), STATIONS) + 120.0 * station
    course = gaussian_process.make_time_basis(time, station)
    m = len(time)
    by_field = np.eye(axes) * rng.uniform(0.5, 1.5, (m, 1, 1))
    of = gaussian_process.project_on_stations(by_field, course, station)
    blocks = gaussian_process.compute_covariance(course, kind)
    k, s = blocks.shape[:2]
    root = np.linalg.cholesky(blocks.reshape(k * s, k * s) + 1e-9 * np.eye(k * s))
    changes = np.empty((m, axes))
    for axis in range(axes):
        c = (root @ rng.standard_normal(k * s)).reshape(k, s)
        changes[:, axis] = sd * np.einsum("ms,ms->m", course.functions, c[station])
    z = np.einsum("mij,mj->im", by_field, changes).ravel() + rng.standard_normal(m * axes)
    jacobian = rng.standard_normal((m * axes, 6)) + np.repeat(np.eye(6)[:axes], m, axis=0)
    return of, z, jacobian, changes


def dense(
    of: gaussian_process.StationSpaces, n: int, sd: float, kind: gaussian_process.Kind
) -> np.ndarray:
    """The covariance of all residuals, written out."""
    blocks = gaussian_process.compute_covariance(of.course, kind)
    total = np.eye(n)
    s = blocks.shape[1]
    for a, (rows_a, q_a, r_a) in enumerate(zip(of.rows, of.bases, of.triangles, strict=True)):
        for b, (rows_b, q_b, r_b) in enumerate(zip(of.rows, of.bases, of.triangles, strict=True)):
            axes = np.eye(r_a.shape[1] // s)
            part = r_a @ np.kron(axes, blocks[a, :, b]) @ r_b.T
            total[np.ix_(rows_a, rows_b)] += sd**2 * q_a @ part @ q_b.T
    return total


@pytest.mark.parametrize("axes", [1, 3])
@pytest.mark.parametrize("kind", [("smooth", 0.5), ("rough", 4.0)])
def test_whitened_is_the_inverse_root_of_the_covariance(
    axes: int, kind: gaussian_process.Kind
) -> None:
    of, z, jacobian, _ = drawn(0, 3.0, axes=axes)
    axis = gaussian_process.find_principal_axes(of, kind)
    ours = gaussian_process.whiten(of, 3.0, axis, np.column_stack([z, jacobian]))
    both = np.column_stack([z, jacobian])
    written = both.T @ np.linalg.solve(dense(of, len(z), 3.0, kind), both)
    assert ours.T @ ours == pytest.approx(written, rel=1e-8)


def test_followed_is_the_conditional_mean() -> None:
    of, z, _, changes = drawn(1, 5.0, axes=3)
    by = gaussian_process.GaussianProcess(5.0, ("smooth", 0.7), 1.0)
    seen, taken = gaussian_process.predict_changes(
        of, by, gaussian_process.find_principal_axes(of, by.kind), z, len(changes)
    )
    assert np.sqrt(np.mean((seen + changes) ** 2)) < 0.6  # residual = … + change, field = −change
    assert 20 < taken < 105
    inside = np.eye(len(z)) - np.linalg.inv(dense(of, len(z), 5.0, ("smooth", 0.7)))
    written = inside @ z
    field = np.concatenate([-seen[:, axis] for axis in range(3)])
    assert np.corrcoef(field, written)[0, 1] > 0.95


def test_nothing_is_found_in_white_noise() -> None:
    nothing = (np.zeros(0), np.zeros((0, 6)))
    gains = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        of, _, jacobian, _ = drawn(seed, 0.0)
        heavy = of._replace(triangles=tuple(500.0 * r for r in of.triangles))
        gains.append(
            gaussian_process.estimate_process(
                heavy, rng.standard_normal(STATIONS * EACH), jacobian, nothing
            )[0]
        )
    assert np.mean([by.sd == 0.0 for by in gains]) > 0.8
    assert max(by.gain for by in gains) < 12.0


@pytest.mark.slow
def test_size_and_length_are_found_with_the_parameters_freedom_taken_off() -> None:
    """Noise 1, changes of 2 noises; as fields one is 1/500, for sizes are looked for below 0.02."""
    nothing = (np.zeros(0), np.zeros((0, 6)))
    sizes, lengths = [], []
    for seed in range(25):
        of, z, jacobian, _ = drawn(100 + seed, 2.0, axes=3)
        heavy = of._replace(triangles=tuple(500.0 * r for r in of.triangles))
        by, _ = gaussian_process.estimate_process(heavy, z, jacobian, nothing)
        sizes.append(500.0 * by.sd)
        lengths.append(by.kind)
        assert by.gain > 16.0
    assert np.median(sizes) == pytest.approx(2.0, abs=0.3)  # some 20 numbers tell each of them
    shapes = [kind for kind in lengths if kind[0] == "smooth" and 0.5 <= kind[1] <= 1.0]
    assert len(shapes) > 18


def test_averaged_is_one_model_or_the_other_where_that_is_clear() -> None:
    covariance = np.array([[2.0, 1.0], [1.0, 1.0]])
    clear = average_over_term(np.array([7.0, 9.0]), covariance, slice(1, 2), 0.1)
    assert clear.probability == pytest.approx(1.0, abs=1e-9)
    assert clear.params[0] == pytest.approx(7.0, abs=0.15)
    assert clear.covariance[0, 0] == pytest.approx(2.0, abs=0.05)
    none = average_over_term(np.array([7.0, 0.3]), covariance, slice(1, 2), 0.1)
    assert none.params.tolist() == pytest.approx([6.7, 0.0])
    assert none.covariance[0, 0] == pytest.approx(1.0)
    between = average_over_term(np.array([7.0, 3.0]), covariance, slice(1, 2), 0.1)
    assert 0.2 < between.probability < 0.9
    assert between.covariance[0, 0] > 2.0  # wider than either: which of the two is open


@pytest.mark.parametrize("size", [0.0, 0.5, 1.5, 3.0, 6.0])
def test_averaged_errors_are_nearly_honest_whatever_the_term(size: float) -> None:
    """A term of so many standard errors. Deciding by p < 1e-4 would give 1.9 at the worst."""
    rng = np.random.default_rng(2)
    covariance = np.eye(4)
    covariance[0, 0], covariance[0, 1:], covariance[1:, 0] = 1.8, 0.5, 0.5
    root = np.linalg.cholesky(covariance)
    z = []
    for _ in range(1200):
        direction = rng.standard_normal(3)
        truth = np.concatenate([[0.0], size * direction / np.linalg.norm(direction)])
        found = average_over_term(
            truth + root @ rng.standard_normal(4), covariance, slice(1, 4), 0.1
        )
        z.append(found.params[0] / np.sqrt(found.covariance[0, 0]))
    assert 0.93 < np.sqrt(np.mean(np.square(z))) < 1.35
