"""What keeps a network up to date: sums, the affine step, the judge and the schedule."""

from dataclasses import replace

import numpy as np
import pytest

from agonic.calibration.affine import Affine
from agonic.calibration.retraining import RetrainerParams, Window
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError
from agonic.maths.estimation.changes import cusum
from agonic.network.fit import fit_network
from agonic.network.retraining.acceptance import (
    Unseen,
    choose_best,
    estimate_noise,
    find_stuck,
    is_better,
    judge,
)
from agonic.network.retraining.candidates import MOST, VISITS, add_rows, find_common_error
from agonic.network.retraining.posterior import describe_prior, train_on
from agonic.network.retraining.schedule import begin, find_due, reschedule, start, take_rows
from agonic.network.simulate import simulate_nonaffine

PARAMS = RetrainerParams()
LIMITS = {"bias_sd": 0.05, "matrix_sd": 0.02}


def move(running, rows: Window, *, bias_sd: float, matrix_sd: float):
    """What is running after a step of the base alone."""
    params = replace(PARAMS, bias_sd=bias_sd, matrix_sd=matrix_sd)
    prior = describe_prior(running)
    return train_on(running, prior, rows, params, least=1.0, weights=False)[0]


def directions(rng: np.random.Generator, n: int) -> np.ndarray:
    v = rng.normal(size=(n, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def window(raw: np.ndarray, wanted: np.ndarray) -> Window:
    return Window(time=np.arange(float(len(raw))), raw=raw, wanted=wanted)


class TestSums:
    def test_rows_one_by_one_and_at_once_come_to_the_same(self) -> None:
        z = np.random.default_rng(0).normal(size=(3000, 3))
        whole = cusum.advance(cusum.start_sums(3), z, drift=0.3, alarm=0.0, correlation=1.7)
        sums = cusum.start_sums(3)
        for row in z:
            clipped = np.clip(row, -4.0, 4.0)
            size = np.maximum(sums.size + (np.stack([clipped, -clipped]) - 0.3) / 1.7, 0.0)
            sums = cusum.Sums(size, np.where(size > 0, sums.age + 1, 0))
        np.testing.assert_allclose(whole.sums.size, sums.size, atol=1e-9)
        np.testing.assert_array_equal(whole.sums.age, sums.age)

    def test_false_alarms_come_as_often_as_siegmund_says(self) -> None:
        rng, k, h = np.random.default_rng(1), 0.5, 4.0
        lengths = []
        for _ in range(400):
            sums, n = cusum.start_sums(1), 0
            while True:
                seen = cusum.advance(sums, rng.normal(size=(512, 1)), drift=k, alarm=h)
                n, sums = n + seen.rows, seen.sums
                if seen.alarmed:
                    break
            lengths.append(n)
        d = 2 * k * (h + 1.166)
        one_side = (np.exp(d) - d - 1) / (2 * k**2)  # Siegmund's approximation
        assert np.mean(lengths) == pytest.approx(one_side / 2, rel=0.15)

    @pytest.mark.parametrize("sign", [-1.0, 1.0])
    def test_shift_of_either_sign_is_dated(self, sign: float) -> None:
        rng, onsets = np.random.default_rng(2), []
        for _ in range(50):
            z = rng.normal(size=(600, 3))
            z[400:, 1] += 3.0 * sign
            seen = cusum.advance(cusum.start_sums(3), z, drift=1.0, alarm=10.0)
            assert seen.alarmed
            assert 400 < seen.rows < 420
            onsets.append(seen.rows - seen.age)
        assert np.median(onsets) == pytest.approx(400, abs=2)
        assert np.abs(np.array(onsets) - 400).max() < 20

    def test_single_strays_do_not_alarm(self) -> None:
        z = np.random.default_rng(3).normal(size=(5000, 3))
        z[::40] = 1e6
        assert not cusum.advance(cusum.start_sums(3), z, drift=1.0, alarm=10.0).alarmed

    def test_residuals_that_last_count_as_one(self) -> None:
        rng, z, length = np.random.default_rng(4), np.zeros((20_000, 1)), 21.0
        noise = rng.normal(size=len(z))
        for k in range(1, len(z)):  # 1 + 2 Σ 0.9ᵏ = 19
            z[k] = 0.9 * z[k - 1] + np.sqrt(1 - 0.81) * noise[k]
        assert cusum.advance(cusum.start_sums(1), z, drift=1.0, alarm=6.0).alarmed
        quiet = cusum.advance(cusum.start_sums(1), z, drift=1.0, alarm=6.0, correlation=length)
        assert not quiet.alarmed


class TestStep:
    def test_errors_are_as_large_as_stated(self) -> None:
        rng, scores = np.random.default_rng(0), []
        base = Affine(bias=[100.0, -50.0, 20.0], matrix=np.diag([1.02, 0.98, 1.0]))
        for _ in range(60):
            field = 50_000.0 * directions(rng, 200)
            matrix = base.matrix + 0.005 * rng.normal(size=(3, 3))
            bias = base.bias + 500.0 * rng.normal(size=3)
            raw = field @ np.linalg.inv(matrix).T + bias + 50.0 * rng.normal(size=field.shape)
            step = move(base, window(raw, field), **LIMITS)
            error = np.concatenate([step.bias - bias, _free(step.matrix - matrix)])
            scores.append(error / step.sd)
        assert np.abs(np.mean(scores, axis=0)).max() < 0.55  # four standard errors of a mean
        assert np.std(scores) == pytest.approx(1.0, abs=0.08)

    def test_what_a_few_readings_do_not_show_stays(self) -> None:
        rng = np.random.default_rng(1)
        base = Affine(bias=[100.0, -50.0, 20.0], matrix=np.eye(3))
        near = np.array([0.0, 0.0, 1.0]) + 0.05 * rng.normal(size=(50, 3))
        field = 50_000.0 * near / np.linalg.norm(near, axis=1, keepdims=True)
        shift = np.array([300.0, -200.0, 100.0])
        raw = field + base.bias + shift + 20.0 * rng.normal(size=field.shape)
        limits = {"bias_sd": PARAMS.bias_sd, "matrix_sd": PARAMS.matrix_sd}
        step = move(base, window(raw, field), **limits)
        np.testing.assert_allclose(step.correct(raw).mean(axis=0), field.mean(axis=0), atol=10.0)
        opposite = -field
        far = step.correct(opposite + base.bias + shift) - opposite
        before = base.correct(opposite + base.bias + shift) - opposite
        assert np.abs(far).max() < np.abs(before).max()
        sd = np.sqrt(np.diagonal(step.uncertainty(opposite + base.bias + shift), 0, 1, 2))
        assert np.abs(far / sd).max() < 4.0

    def test_network_on_top_stays_as_it_was(self) -> None:
        made = simulate_nonaffine(n=3000, hysteresis=0.0, seed=1)
        network = fit_network(made.samples, made.reference, hidden=6, compared=False).calibration
        shift = np.array([500.0, 300.0, -400.0])
        some = slice(0, 400)
        step = move(network, window(made.samples.field[some] + shift, made.field[some]), **LIMITS)
        np.testing.assert_array_equal(step.weights, network.weights)
        later = made.samples.field[1000:]
        before, _ = network.evaluated(later, {})
        after, _ = step.evaluated(later + shift, {})
        assert np.sqrt(np.mean((after - before) ** 2)) < 40.0  # of shifts of 410 nT rms

    def test_magnitudes_find_a_bias_and_no_turn(self) -> None:
        rng = np.random.default_rng(2)
        base = Affine(bias=[0.0, 0.0, 0.0], matrix=np.eye(3))
        field = 50_000.0 * directions(rng, 500)
        raw = field + [400.0, -100.0, 250.0] + 30.0 * rng.normal(size=field.shape)
        size = np.linalg.norm(field, axis=1, keepdims=True)
        step = move(base, window(raw, size), **LIMITS)
        score = (step.bias - [400.0, -100.0, 250.0]) / step.sd[:3]
        assert np.abs(score).max() < 4.0
        np.testing.assert_allclose(step.matrix, step.matrix.T, atol=1e-4)


def _free(matrix: np.ndarray) -> np.ndarray:
    """Entries in the order of the covariance in the free gauge: xx yy zz xy xz yz yx zx zy."""
    rows, columns = [0, 1, 2, 0, 0, 1, 1, 2, 2], [0, 1, 2, 1, 2, 2, 0, 0, 1]
    return matrix[rows, columns]


class TestJudge:
    def unseen(self, running, candidate, **settings) -> Unseen:
        values = {"moves": 0.001, "strength": 50_000.0, "noise": 20.0, **settings}
        return Unseen(running=running, candidate=candidate, **values)

    def errors(self, sd: float, n: int = 300, seed: int = 0) -> np.ndarray:
        return sd * np.random.default_rng(seed).normal(size=(n, 3))

    def test_what_runs_wins_ties(self) -> None:
        wins = 0
        for seed in range(200):
            one, other = self.errors(20.0, seed=seed), self.errors(20.0, seed=1000 + seed)
            wins += judge(self.unseen(one, other), PARAMS).accepted
        assert wins <= 3  # three standard errors on one side: 0.14 %

    def test_clearly_better_candidate_wins_whatever_errors_they_share(self) -> None:
        shared = self.errors(100.0, seed=5)
        told = self.unseen(shared + self.errors(40.0, seed=6), shared, noise=100.0)
        verdict = judge(told, PARAMS)
        assert verdict.accepted
        assert "better" in verdict.reason
        assert verdict.candidate_rms < verdict.running_rms

    def test_lasting_errors_are_not_taken_for_many(self) -> None:
        rng, wins = np.random.default_rng(7), 0
        for _ in range(200):
            one, other = (20.0 * np.repeat(rng.normal(size=(15, 3)), 20, axis=0) for _ in range(2))
            wins += is_better((one, other))
        assert wins <= 8

    @pytest.mark.parametrize(
        ("word", "settings"),
        [
            ("wrong reference: the candidate moves", {"moves": 0.5}),
            ("wrong reference, or a disturbance", {"noise": 5.0}),
            ("wrong reference: the best candidate", {"noise": None, "strength": 100.0}),
        ],
    )
    def test_wrong_reference_is_rejected_in_words(self, word: str, settings: dict) -> None:
        told = self.unseen(self.errors(200.0), self.errors(20.0, seed=1), **settings)
        verdict = judge(told, PARAMS)
        assert not verdict.accepted
        assert verdict.poisoned
        assert verdict.reason.startswith(word)

    def test_outliers_are_counted(self) -> None:
        candidate = self.errors(20.0)
        candidate[::5] += 3000.0
        verdict = judge(self.unseen(candidate + 1.0, candidate), PARAMS)
        assert verdict.poisoned
        assert verdict.reason.startswith("outliers: 20 %")

    def test_simpler_candidate_wins_ties(self) -> None:
        simple, rich = self.errors(20.0), self.errors(19.9, seed=3)
        assert choose_best([simple, rich]) == 0
        assert choose_best([simple, 0.5 * rich]) == 1

    def test_stuck_readings_are_told_from_a_slow_sensor(self) -> None:
        raw = np.repeat(directions(np.random.default_rng(0), 50), 4, axis=0)
        assert find_stuck(window(raw, raw)) == ""  # a log that runs four times as fast
        raw[100:150] = raw[100]
        assert "50 of 200 readings are one and the same" in find_stuck(window(raw, raw))

    def test_noise_is_that_of_a_row_and_its_length(self) -> None:
        errors = np.repeat(self.errors(30.0, n=400), 5, axis=0)
        errors[7] = 1e5
        sd, length = estimate_noise(errors)
        assert sd == pytest.approx(30.0, rel=0.1)
        assert 3.0 < length < 7.0


class TestReservoir:
    def test_it_is_bounded_spread_over_directions_and_holds_the_last_trainings(self) -> None:
        rng, base = np.random.default_rng(0), Affine(bias=np.zeros(3), matrix=np.eye(3))
        kept = window(np.empty((0, 3)), np.empty((0, 3)))
        for visit in range(12):
            field = 50_000.0 * directions(rng, 2000)
            field[200:] = field[0]  # it rests for most of the time
            rows = replace(window(field, field), time=2000.0 * visit + np.arange(2000.0))
            kept = add_rows(kept, rows, base, visit)
        assert 100 < len(kept) <= MOST * VISITS
        assert (np.diff(kept.time) > 0).all()
        assert kept.time[0] > 2000.0 * 5
        assert (kept.raw == field[0]).all(axis=1).mean() < 0.1

    def test_error_that_a_visit_shares_is_found_beside_drift_and_noise(self) -> None:
        rng, base = np.random.default_rng(3), Affine(bias=np.zeros(3), matrix=np.eye(3))
        found = []
        for _ in range(40):
            kept = window(np.empty((0, 3)), np.empty((0, 3)))
            state = start(base, PARAMS)
            for visit in range(6):
                field = 50_000.0 * directions(rng, 400)
                shared = 30.0 * rng.normal(size=3) + 25.0 * visit
                raw = field + shared + 40.0 * rng.normal(size=field.shape)
                rows = replace(window(raw, field), time=400.0 * visit + np.arange(400.0))
                kept = add_rows(kept, rows, base, visit)
                state = replace(state, reservoir=kept, noise=40.0, reference_sd=99.0)
                if visit < 2:
                    assert find_common_error(state, rows) == 99.0
            found.append(find_common_error(state, rows))
        assert np.sqrt(np.mean(np.square(found))) == pytest.approx(30.0, rel=0.15)

    def test_error_of_a_world_model_averages_out_along_a_track(self) -> None:
        rng, phase = np.random.default_rng(4), np.arange(1440.0) * 2 * np.pi / 14.4  # a day of it
        state = replace(start(None, PARAMS), reference_sd=125.0)
        along = (35_000.0 + 12_000.0 * np.cos(2 * phase))[:, None] * directions(rng, 1440)
        assert 3.0 < find_common_error(state, window(along, along)) < 15.0
        short = np.repeat(along[:7], 300, axis=0)  # half an orbit
        assert 40.0 < find_common_error(state, window(short, short)) <= 125.0
        at_home = 48_000.0 * directions(rng, 1440)  # one place errs alike for ever
        assert find_common_error(state, window(at_home, at_home)) == 125.0


class TestSchedule:
    def run(self, params: RetrainerParams, times: np.ndarray, chunks: list[int]) -> list[int]:
        """The rows after which something is due, when nothing ever comes of it."""
        state, due_rows, done = start(None, params), [], 0
        state = begin(state, params, float(times[0]))
        for stop in [*np.cumsum(chunks).tolist(), len(times)]:
            while done < stop:
                due = find_due(state, params, times[done:stop])
                end = stop if due is None else done + due.row + 1
                rows = np.zeros((end - done, 3))
                part = Window(time=times[done:end], raw=rows, wanted=rows)
                state, done = take_rows(state, params, part), end
                if due is not None:
                    due_rows.append(done)
                    state = reschedule(state, params)
        return due_rows

    def test_periods_in_readings_and_in_seconds(self) -> None:
        times = np.arange(2000) * 0.1
        by_count = RetrainerParams(window_n=500, every_n=300)
        assert self.run(by_count, times, []) == [500, 800, 1100, 1400, 1700, 2000]
        by_time = RetrainerParams(window_s=50.0, every_s=30.0)
        assert self.run(by_time, times, [])[:3] == [501, 801, 1101]

    def test_chunks_make_no_difference_with_gaps_in_time(self) -> None:
        rng = np.random.default_rng(0)
        times = np.cumsum(rng.exponential(0.1, 3000)) + 40.0 * (np.arange(3000) > 1500)
        params = RetrainerParams(window_s=40.0, every_s=25.0, window_n=900)
        chunks = rng.integers(1, 60, 90).tolist()
        assert self.run(params, times, chunks) == self.run(params, times, [])

    def test_window_is_bounded_in_readings_and_in_seconds(self) -> None:
        params = RetrainerParams(window_s=10.0, window_n=80)
        state = begin(start(None, params), params, 0.0)
        rows = np.zeros((300, 3))
        dense = Window(time=np.arange(300) * 0.01, raw=rows, wanted=rows)
        assert len(take_rows(state, params, dense).window) == 80
        sparse = Window(time=np.arange(300) * 1.0, raw=rows, wanted=rows)
        assert len(take_rows(state, params, sparse).window) == 11


@pytest.mark.parametrize(
    "settings",
    [
        {"window_s": 0.0},
        {"every_n": -1},
        {"alarm": -1.0},
        {"fewest": 3},
        {"target": "turn"},
        {"base": None, "target": "magnitude"},
        {"inputs": ("warmth",)},
        {"misfit": float("nan")},
    ],
)
def test_params_that_make_no_sense_are_refused(settings: dict) -> None:
    with pytest.raises(AgonicError):
        RetrainerParams(**settings)


def test_a_thermal_base_that_is_moved_keeps_its_shape_and_grows_its_errors() -> None:
    rng = np.random.default_rng(4)
    base = Thermal(
        bias=[[100.0, -50.0, 20.0], [40.0, 10.0, -5.0]],
        matrix=[np.eye(3), 0.01 * np.diag([1.0, -1.0, 0.5])],
        centre_C=20.0,
        half_range_C=30.0,
        covariance=np.eye(18) * 1e-6,
    )
    warmth = rng.uniform(0.0, 40.0, 600)
    raw = rng.normal(0.0, 25_000.0, (600, 3))
    jump = np.array([300.0, -200.0, 150.0])
    wanted = base.correct(raw - jump, temperature=warmth)
    length = np.linalg.norm(wanted, axis=1, keepdims=True) + rng.normal(0.0, 5.0, (600, 1))
    for known, most in ((wanted, 3.0), (length, 6.0)):
        rows = Window(time=np.arange(600.0), raw=raw, wanted=known, columns={"temperature": warmth})
        moved = move(base, rows, bias_sd=0.1, matrix_sd=0.05)
        assert np.abs(moved.bias[0] - base.bias[0] - jump).max() < most
        np.testing.assert_allclose(moved.bias[1], base.bias[1])
        assert moved.gauge == "free"
        assert (np.diag(moved.covariance)[:6:2] > 1e-6).all()
