"""The UD filter: its Jacobian, its updates, numba, and that it stays a covariance."""

import numpy as np
import pytest

from agonic.inflight.tracking.jump import find_onset
from agonic.maths.equation.affine import magnitude_residual, model_basis
from agonic.maths.estimation.filters import kalman, reading, states

MATRIX = np.array([1.03, 0.98, 1.01, 0.02, -0.015, 0.01])
STATE = np.array([25.0, 3000.0, -2000.0, 500.0, *MATRIX])
WHOLE = model_basis("full") @ STATE[1:]


def rows_of(n: int, *, seed: int = 0, noise: float = 100.0, cone: float = 0.0) -> np.ndarray:
    """Readings of a sensor with the calibration above, 1 Hz; in a cone about z where asked."""
    rng = np.random.default_rng(seed)
    field = rng.standard_normal((n, 3)) + np.array([0.0, 0.0, cone])
    field *= 40_000 / np.linalg.norm(field, axis=1)[:, None]
    raw = field @ np.linalg.inv(WHOLE[3:].reshape(3, 3)).T + WHOLE[:3]
    raw += noise * rng.standard_normal((n, 3))
    return np.column_stack([np.arange(1.0, n + 1), raw, np.full(n, 40_000.0), np.ones(n)])


def prior(m: int = 10, bias_sd: float = 500.0, external: float = 20.0) -> states.FilterState:
    covariance = np.diag([external**2, *[bias_sd**2] * 3, *[0.02**2] * 6])[:m, :m]
    return states.start_filter(np.array([0, *STATE[1:4] + 300.0, *MATRIX]), covariance, 0.0)


def test_the_jacobian_is_that_of_the_distance_residual() -> None:
    row, h = rows_of(1)[0], [0.0] * 10
    r, steepness = reading.find_distance(STATE.tolist(), row.tolist(), 100.0, h, 10)
    expected, jacobian = magnitude_residual(
        row[None, 1:4], WHOLE[:3], WHOLE[3:].reshape(3, 3), row[4] + STATE[0], 100.0
    )
    assert r == pytest.approx(expected[0], abs=1e-8)
    assert h[1:] == pytest.approx((jacobian @ model_basis("full"))[0], rel=1e-9, abs=1e-7)
    for k in range(10):
        step = np.zeros(10)
        step[k] = 1e-3 if k < 4 else 1e-7
        ahead, behind = (
            reading.find_distance(
                (STATE + sign * step).tolist(), row.tolist(), 0.0, [0.0] * 10, 10
            )[0]
            for sign in (1, -1)
        )
        assert h[k] == pytest.approx((ahead - behind) / (2 * step[k]), rel=1e-5, abs=1e-5)
    assert steepness == pytest.approx(-1 / h[0])


@pytest.mark.parametrize("m", [4, 7, 10])
def test_updates_are_those_of_the_textbook(m: int) -> None:
    """The plain Kalman equations, in the covariance itself, give the same for every size."""
    model = states.Model(100.0, 20.0, 600.0, 3.0, 1e-5 if m == 10 else 0.0)
    rows = rows_of(40)
    before = prior(m)
    after, _, _ = kalman.advance(before, model, rows, compiled=False)
    x, p, last = before.state.copy(), before.covariance, 0.0
    for row in rows:
        decay = np.eye(m)
        decay[0, 0] = np.exp(-(row[0] - last) / 600.0)
        x[0] *= decay[0, 0]
        walked = [400 * (1 - decay[0, 0] ** 2), *[9.0] * 3, *[model.matrix_walk**2] * 6][:m]
        p = decay @ p @ decay.T + np.diag(walked)
        last, h = row[0], [0.0] * 10
        r, _ = reading.find_distance(x.tolist(), row.tolist(), 100.0, h, 10)
        jacobian = np.array(h[:m])
        gain = p @ jacobian / (jacobian @ p @ jacobian + 1e4)
        x[:m] -= gain * r
        p = p - np.outer(gain, jacobian @ p)
    assert after.state == pytest.approx(x, rel=1e-8, abs=1e-9)
    assert after.covariance == pytest.approx(p, rel=1e-6, abs=1e-12)


def test_numba_gives_the_same_to_rounding() -> None:
    pytest.importorskip("numba")
    model = states.Model(100.0, 20.0, 600.0, 3.0, 1e-6)
    plain, seen, _ = kalman.advance(prior(), model, rows_of(500), compiled=False)
    fast, also, _ = kalman.advance(prior(), model, rows_of(500), compiled=True)
    assert fast.state == pytest.approx(plain.state, rel=1e-12)
    assert fast.covariance == pytest.approx(plain.covariance, rel=1e-9, abs=1e-15)
    assert also.residual == pytest.approx(seen.residual, abs=1e-6)


def test_a_filter_whose_sums_are_lists_beside_arrays_goes_on() -> None:
    pytest.importorskip("numba")
    model = states.Model(100.0)
    fast, _, _ = kalman.advance(prior(), model, rows_of(50), compiled=True)
    mixed, row = states.forget_sums(fast), rows_of(51)[50:]
    one, _, _ = kalman.take_one(mixed, model, row[0].tolist())
    after, _, _ = kalman.advance(mixed, model, row, compiled=True)
    assert one.state == pytest.approx(after.state, rel=1e-12)


def test_without_numba_the_plain_source_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    model = states.Model(100.0)
    plain, _, _ = kalman.advance(prior(), model, rows_of(50), compiled=False)
    monkeypatch.setattr(kalman, "compile_filter", lambda: None)
    without, _, _ = kalman.advance(prior(), model, rows_of(50), compiled=True)
    assert np.array_equal(without.state, plain.state)


def test_a_belief_gives_its_covariance_back() -> None:
    root = np.random.default_rng(0).standard_normal((10, 10))
    assert states.start_filter(STATE, root @ root.T, 0.0).covariance == pytest.approx(root @ root.T)
    singular = np.outer(root[0], root[0])
    assert states.start_filter(STATE, singular, 0.0).covariance == pytest.approx(singular, abs=1e-9)


def test_a_possible_jump_widens_the_bias_and_nothing_else() -> None:
    before = prior()
    after = states.widen_for_jump(before, 2000.0)
    added = np.diag([0, *[2000.0**2] * 3, *[0] * 6])
    assert after.covariance == pytest.approx(before.covariance + added, rel=1e-12)


@pytest.mark.slow
def test_it_stays_a_covariance_over_many_updates() -> None:
    """Precise readings in a narrow cone from a prior of 50 µT: condition 1e16, walk off."""
    pytest.importorskip("numba")
    n = 200_000
    belief = prior(bias_sd=50_000.0, external=0.0)
    model = states.Model(0.1, jump_level=0.0, gate=np.inf)
    rows = rows_of(n, noise=0.1, cone=20.0)
    for _ in range(10):  # 2·10⁶ updates
        belief, seen, _ = kalman.advance(belief, model, rows, linearised=STATE)
        rows[:, 0] += n
    assert len(seen.residual) == n
    assert (belief.diagonal >= 0).all()
    sd = np.sqrt(np.diag(belief.covariance)[1:])
    correlation = belief.covariance[1:, 1:] / np.outer(sd, sd)
    assert np.linalg.eigvalsh(correlation).min() > -1e-12
    _, jacobian = magnitude_residual(
        rows[:, 1:4], WHOLE[:3], WHOLE[3:].reshape(3, 3), rows[:, 4] + STATE[0], 0.1
    )
    jacobian = jacobian @ model_basis("full")
    known = 10 * jacobian.T @ jacobian / 0.1**2 + np.diag([1 / 50_000.0**2] * 3 + [2500.0] * 6)
    assert sd == pytest.approx(np.sqrt(np.diag(np.linalg.inv(known))), rel=0.01)


def test_an_outlier_is_refused_and_moves_nothing() -> None:
    rows = rows_of(300)
    belief, _, _ = kalman.advance(prior(), states.Model(100.0), rows)
    stray = rows[-1:].copy()
    stray[0, 0] += 1.0
    stray[0, 1:4] *= 1.1
    after, seen, _ = kalman.advance(belief, states.Model(100.0), stray)
    assert not seen.used[0]
    assert np.array_equal(after.state, belief.state)


def test_the_onset_of_a_step_is_found() -> None:
    rng = np.random.default_rng(1)
    toward = rng.standard_normal((100, 3)) / 3
    innovation = rng.standard_normal(100)
    innovation[60:] += toward[60:] @ [9.0, -6.0, 3.0]
    nothing, none = np.zeros(100), np.empty((0, 3))
    jacobian = np.pad(toward, ((0, 0), (1, 6)))
    found = find_onset(
        kalman.Predictions(nothing, nothing, nothing > 0, innovation, jacobian, none)
    )
    assert abs(found - 60) <= 2
