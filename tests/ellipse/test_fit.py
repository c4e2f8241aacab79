"""A two-axis compass against truth: error over σ, the Cramér–Rao bound, and what is refused."""

import numpy as np
import pytest

from agonic.ellipse.fit import fit_ellipse
from agonic.ellipse.maths.conic import find_start
from agonic.errors import AgonicError, CoverageError, LogError
from agonic.reference import Reference
from agonic.samples import Samples

BIAS = np.array([3000.0, -1500.0])
MATRIX = np.array([[1.1, 0.05], [0.05, 0.93]])
H, Z = 19_000.0, 41_000.0
PLACE = Reference.horizontal_vertical(H, Z)
LOCAL = [0, 1, 3, 4, 6]
NOISE = 150.0


def record(
    seed: int, *, turns: float = 1.0, n: int = 600, noise: float = NOISE, tilt_deg: float = 0.0
) -> Samples:
    """A vehicle that turns out and back, and rocks by `tilt_deg` within some seconds."""
    rng, t = np.random.default_rng(seed), np.arange(n) / 10
    heading = 2 * np.pi * turns * np.interp(t, [0, t[-1] / 2, t[-1]], [0, 1, 0])
    ahead, right = np.radians(tilt_deg) * np.array([np.sin(t / 1.1), np.cos(t / 1.4)])
    field = np.stack([H * np.cos(heading) - Z * ahead, -H * np.sin(heading) + Z * right], axis=1)
    raw = field @ np.linalg.inv(MATRIX) + BIAS + rng.normal(size=(n, 2)) * noise
    return Samples(field=np.column_stack([raw, np.zeros(n)]), time=t, axes="xy")


def numbers(fit) -> np.ndarray:
    return np.array([*fit.bias[:2], fit.matrix[0, 0], fit.matrix[1, 1], fit.matrix[0, 1]])


TRUTH = np.array([*BIAS, 1.1, 0.93, 0.05])


def compute_bound(samples: Samples) -> np.ndarray:
    """The Cramér–Rao bound (5,) by numerical derivatives of the distance along the normal.

    Written without the code under test: each reading's own heading is an unknown that is
    eliminated by looking along the normal of the ellipse only.
    """
    n = len(samples)
    heading = 2 * np.pi * np.interp(np.arange(n), [0, (n - 1) / 2, n - 1], [0, 1, 0])

    def curve(p: np.ndarray) -> np.ndarray:
        w = np.array([[p[2], p[4]], [p[4], p[3]]])
        u = H * np.stack([np.cos(heading), -np.sin(heading)], axis=1)
        return u @ np.linalg.inv(w) + p[:2]

    step = np.array([1.0, 1.0, 1e-5, 1e-5, 1e-5])
    moved = [
        (curve(TRUTH + s * e) - curve(TRUTH - s * e)) / (2 * s)
        for s, e in zip(step, np.eye(5), strict=True)
    ]
    u = H * np.stack([np.cos(heading), -np.sin(heading)], axis=1)
    normal = u @ MATRIX
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    jacobian = np.stack([np.sum(m * normal, axis=1) for m in moved], axis=1)
    return NOISE * np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))


@pytest.mark.slow
def test_errors_are_as_large_as_stated_and_reach_the_bound() -> None:
    z, error = [], []
    for seed in range(50):
        fit = fit_ellipse(record(seed), PLACE)
        error.append(numbers(fit) - TRUTH)
        z.append(error[-1] / fit.sd[LOCAL])
        assert fit.verdict == "good"
    assert 0.8 < np.sqrt(np.mean(np.square(z))) < 1.05  # terms that a clean log cannot exclude
    assert np.abs(np.mean(z, axis=0)).max() < 0.25
    over_bound = np.sqrt(np.mean(np.square(error), axis=0)) / compute_bound(record(0))
    assert over_bound == pytest.approx(1.0, abs=0.2)


@pytest.mark.slow
def test_three_quarters_of_the_circle_are_honest_too() -> None:
    z = []
    for seed in range(28):
        fit = fit_ellipse(record(seed, turns=0.8), PLACE)
        z.append((numbers(fit) - TRUTH) / fit.sd[LOCAL])
    assert 0.8 < np.sqrt(np.mean(np.square(z))) < 1.05


@pytest.mark.parametrize("turns", [0.05, 0.2, 0.4, 0.6])
@pytest.mark.parametrize("noise", [5.0, 150.0, 1000.0])
def test_less_of_the_circle_is_refused(turns, noise) -> None:
    fit = fit_ellipse(record(1, turns=turns, noise=noise), PLACE)
    assert fit.verdict == "refused"
    assert not fit.remarks
    assert {one.name for one in fit.findings} & {"coverage", "static"}


def test_few_readings_of_the_whole_circle_will_do() -> None:
    fit = fit_ellipse(record(0, n=32, noise=8.0), PLACE)
    assert fit.seen_deg == 360.0
    assert fit.verdict == "good"


def test_without_a_place_the_shape_is_the_same() -> None:
    known, alone = fit_ellipse(record(2), PLACE), fit_ellipse(record(2))
    assert np.trace(alone.matrix[:2, :2]) == pytest.approx(2.0)
    gain = np.trace(known.matrix[:2, :2]) / 2
    assert alone.matrix[:2, :2] * gain == pytest.approx(known.matrix[:2, :2], rel=1e-9)
    assert alone.heading_sd_deg == pytest.approx(known.heading_sd_deg, rel=1e-6)
    assert "no place was given" in " ".join(alone.remarks)


@pytest.mark.slow
def test_the_standard_error_of_the_heading_is_that_of_headings() -> None:
    heading = np.radians(np.arange(0.0, 360.0, 5.0))
    raw = H * np.stack([np.cos(heading), -np.sin(heading)], axis=1) @ np.linalg.inv(MATRIX) + BIAS
    off, stated = [], []
    for seed in range(28):
        fit = fit_ellipse(record(seed), PLACE)
        field = fit.calibration.correct(np.column_stack([raw, np.zeros(len(raw))]))
        found = np.arctan2(-field[:, 1], field[:, 0])
        off.append(np.degrees(np.angle(np.exp(1j * (found - heading)))))
        stated.append(fit.heading_sd_deg)
    assert 0.7 < np.sqrt(np.mean(np.square(off))) / np.mean(stated) < 1.05


def test_a_tilt_while_turning_is_to_be_checked_and_makes_the_error_larger() -> None:
    level, rocking = fit_ellipse(record(3), PLACE), fit_ellipse(record(3, tilt_deg=2.0), PLACE)
    assert rocking.verdict == "check"
    (found,) = (one for one in rocking.findings if one.name == "correlated noise")
    assert "from tilt, or from something magnetic that moved" in found.what
    assert max(rocking.shares, key=rocking.shares.__getitem__) == "correlated noise"
    assert rocking.heading_sd_deg > 3 * level.heading_sd_deg
    off = numbers(rocking) - TRUTH
    assert np.abs(off / rocking.sd[LOCAL]).max() < 4


def test_a_recorded_tilt_is_to_be_checked() -> None:
    made, angle = record(4), 2.0 * np.sin(np.arange(600))
    tilted = made.with_columns(roll_deg=angle, pitch_deg=0 * angle)
    found = {one.name: one for one in fit_ellipse(tilted, PLACE).findings}
    assert found["attitude"].severity == "check"


def test_outliers_do_not_move_it() -> None:
    made, rng = record(5), np.random.default_rng(5)
    field = made.field.copy()
    rows = rng.choice(len(field), 90, replace=False)
    field[rows, :2] += rng.normal(size=(90, 2)) * 15_000
    fit = fit_ellipse(made.with_columns(field=field), PLACE)
    assert fit.weights[rows].mean() < 0.15
    assert np.abs((numbers(fit) - TRUTH) / fit.sd[LOCAL]).max() < 4


@pytest.mark.parametrize(("size", "at"), [(800.0, 600), (3000.0, 360)])
def test_a_bias_that_moved_is_named(size, at) -> None:
    made = record(6, turns=2.0, n=1200)
    field = made.field.copy()
    field[at:, 0] += size
    fit = fit_ellipse(made.with_columns(field=field), PLACE)
    (found,) = (one for one in fit.findings if one.name == "field changed")
    assert fit.verdict == "refused"
    assert found.moments == pytest.approx([made.time[at]], abs=2.0)


@pytest.mark.parametrize("size", [400.0, 2000.0])
def test_a_bias_that_drifts_is_calibrated_with_its_mean(size) -> None:
    """A tenth of the field, from one end to the other: before, four times as uncertain as it was
    wrong, and always to be checked."""
    for seed in range(4):
        made = record(seed, turns=2.0, n=1200)
        field = made.field.copy()
        field[:, 0] += size * np.linspace(-0.5, 0.5, 1200)
        fit = fit_ellipse(made.with_columns(field=field), PLACE)
        assert fit.verdict == "good"
        assert "bias drift" in {one.name for one in fit.findings}
        assert np.abs((numbers(fit) - TRUTH) / fit.sd[LOCAL]).max() < 4
        assert fit.heading_sd_deg < 0.12


@pytest.mark.parametrize("name", ["clipping", "frozen axis"])
def test_readings_that_a_damaged_sensor_gives_are_left_out_and_named(name) -> None:
    made = record(9, turns=2.0, n=1200)
    field = made.field.copy()
    if name == "clipping":
        field[:, 0] = np.minimum(field[:, 0], 17_000.0)
    else:
        field[100:200, 0] = field[100, 0]
    fit = fit_ellipse(made.with_columns(field=field), PLACE)
    assert fit.verdict == "check"
    assert name in {one.name for one in fit.findings}
    assert np.abs((numbers(fit) - TRUTH) / fit.sd[LOCAL]).max() < 4


def test_one_way_is_noted() -> None:
    once = record(7)[:300]
    notes = {one.name for one in fit_ellipse(once, PLACE).findings}
    assert notes == {"one way"}


def test_the_start_withstands_a_third_of_outliers() -> None:
    rng, angle = np.random.default_rng(8), np.linspace(0, 2 * np.pi, 300)
    points = np.stack([1 + 1.2 * np.cos(angle), np.sin(angle)], axis=1)
    points[rng.choice(300, 100, replace=False)] = rng.normal(size=(100, 2)) * 3
    assert find_start(points) == pytest.approx([1.0, 0.0, 0.0, 1 / 1.2, 1.0, 0.0], abs=0.1)


def test_what_cannot_be_fitted_says_why() -> None:
    with pytest.raises(CoverageError, match="5 readings cannot determine"):
        fit_ellipse(record(0)[:5])
    still = Samples(field=np.tile([20_000.0, 100.0, 0.0], (50, 1)), axes="xy")
    with pytest.raises(CoverageError, match="never changes"):
        fit_ellipse(still)
    with pytest.raises(AgonicError, match="three axes"):
        fit_ellipse(Samples(field=np.eye(3) * 20_000))
    with pytest.raises(AgonicError, match="horizontal part only"):
        fit_ellipse(record(0), Reference.constant(50_000))
    with pytest.raises(LogError, match="nothing along z"):
        Samples(field=np.eye(3) * 20_000, axes="xy")
    with pytest.raises(LogError, match='"xyz", or "xy"'):
        Samples(field=np.eye(3) * 20_000, axes="xz")
