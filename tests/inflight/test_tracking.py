"""The tracker: equal to the batch, honest, split or whole, deaf to strays, awake to jumps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.calibration.tracking import TrackerParams
from agonic.errors import AgonicError, FrameError, LogError, UnitError
from agonic.inflight.simulation.orbit import simulate_orbit
from agonic.inflight.tracking import Tracker, choose_walk, start, update
from agonic.maths.equation import gauge
from agonic.maths.equation.affine import magnitude_residual, model_basis, split
from agonic.maths.equation.symmetric import pack_symmetric, unpack_symmetric
from agonic.maths.estimation import leastsq
from agonic.simulation import random_calibration, simulate

NOISE = 100.0
PARAMS = TrackerParams(noise=NOISE)


def orbiting(
    seed: int = 0,
    *,
    n: int = 3000,
    walk: float = 0.0,
    external: float = 0.0,
    jump: np.ndarray | None = None,
    at: int = 1500,
    strays: float = 0.0,
):
    """A slowly tumbling sensor in a field that changes, 1 Hz: samples, reference, bias, truth."""
    rng = np.random.default_rng(seed)
    truth = random_calibration(rng, soft_iron=0.02, cross=0.01, bias=3000.0)
    time = np.arange(1.0, n + 1)
    magnitude = 40_000 + 8_000 * np.sin(time / 875)
    turns = Rotation.from_rotvec(np.outer(time, rng.standard_normal(3)) * 0.02)
    turns = turns * Rotation.from_rotvec(np.outer(time, rng.standard_normal(3)) * 0.009)
    decay = np.exp(-1 / 600)
    stirred = external * np.sqrt(1 - decay**2) * rng.standard_normal(n)
    stirred[0] = external * rng.standard_normal()
    size = magnitude + lfilter([1.0], [1.0, -decay], stirred)
    bias = truth.bias + np.cumsum(walk * rng.standard_normal((n, 3)), axis=0)
    if jump is not None:
        bias[at:] += jump
    field = size[:, None] * turns.apply([0.6, 0.0, 0.8])
    raw = field @ np.linalg.inv(truth.matrix).T + bias + NOISE * rng.standard_normal((n, 3))
    stray = rng.random(n) < strays
    raw[stray] += 5000 * rng.standard_normal((stray.sum(), 3))
    return ag.Samples(time=time, field=raw), ag.Reference.magnitude(magnitude), bias, truth


def batch(samples: ag.Samples, magnitude: float, at: np.ndarray) -> leastsq.Solution:
    """The most probable bias and matrix by the one solver, with the tracker's own prior."""
    basis = model_basis("full")
    size = magnitude
    whiten = np.diag(1 / np.array([size] * 3 + [0.1] * 6))
    centre = np.array([0, 0, 0, 1, 1, 1, 0, 0, 0.0])

    def pieces(params: np.ndarray):
        r, jacobian = magnitude_residual(samples.field, *split(basis @ params), magnitude, NOISE)
        yield r, jacobian @ basis

    return leastsq.solve(
        pieces, at, scale=NOISE, prior=lambda x: (whiten @ (x - centre), whiten), tolerance=1e-6
    )


@pytest.mark.slow
@pytest.mark.parametrize("n", [300, 5000])
def test_without_walk_it_equals_the_batch_fit(n: int) -> None:
    """From no knowledge at all, with a bias larger than the field."""
    for seed in range(3):
        made = simulate("tumble", n=n, noise=NOISE, seed=seed)
        assert made.samples.time is not None
        state, _ = update(
            start(None, PARAMS), PARAMS, made.samples.time, made.samples.field, 50_000.0
        )
        truth = np.concatenate([made.truth.bias, pack_symmetric(made.truth.matrix)])
        solution = batch(made.samples, 50_000.0, truth)
        sd = np.sqrt(np.diag(np.linalg.inv(solution.information)))
        assert np.abs((state.estimate.state[1:] - solution.params) / sd).max() < 0.05
        assert np.sqrt(np.diag(state.estimate.covariance)[1:]) == pytest.approx(sd, rel=0.08)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["held still", "all"])
def test_error_over_sd_is_standard_normal(kind: str) -> None:
    walk, external = (3.0, 60.0) if kind == "all" else (0.0, 0.0)
    params = replace(PARAMS, walk=walk, external_sd=external, bias_sd=2000.0)
    sd = np.array([300.0] * 3 + [0.003] * 6)
    z = []
    for seed in range(24):
        samples, reference, bias, truth = orbiting(seed, n=2500, walk=walk, external=external)
        rng = np.random.default_rng(1000 + seed)
        off = rng.standard_normal(9) * sd
        ground = replace(
            truth,
            matrix=truth.matrix + unpack_symmetric(off[3:]),
            covariance=np.diag(sd**2),
            bias=truth.bias + off[:3] + 2000 * rng.standard_normal(3),
        )
        tracker = Tracker(ground, params)
        tracker.update(samples, reference)
        now = tracker.calibration
        error = np.concatenate([now.bias - bias[-1], pack_symmetric(now.matrix - truth.matrix)])
        z.append(error / now.sd)
        assert not tracker.jumps
    # 24 draws of nine correlated errors scatter as some 96 numbers: 0.07
    assert np.std(z) == pytest.approx(1.0, abs=0.18)
    assert np.abs(np.mean(z, axis=0)).max() < 0.7  # 3.5 sd of 1/√24


@pytest.mark.slow
def test_a_walking_bias_is_followed() -> None:
    """It moves some 160 nT on an axis; four sensors that turn about more than one axis."""
    z = []
    for seed in (2, 5, 8, 9):
        samples, reference, bias, _ = orbiting(seed, walk=3.0)
        tracker = Tracker(params=replace(PARAMS, walk=3.0))
        tracker.update(samples, reference)
        late = tracker.history[tracker.history[:, 0] > 1000]
        error = late[:, 1:4] - bias[np.searchsorted(samples.time, late[:, 0])]
        assert np.sqrt(np.mean(error**2)) < 50
        z.append(error / late[:, 4:])
    assert np.sqrt(np.mean(np.square(z))) == pytest.approx(1.0, abs=0.25)


@pytest.mark.slow
def test_a_nanosatellite_is_followed_to_twenty_nanotesla() -> None:
    """A day with a ground calibration in temperature, a bias that moved 2 µT and drifts 200 nT."""
    made = simulate_orbit(moved=2000.0, drift=200.0, external=20.0, pointing="tumble", seed=1)
    terms = made.ground.degree + 1
    sd = np.full(9 * terms, 1e-9)
    sd[: 3 * terms : terms], sd[3 * terms :: terms] = 20.0, 3e-4
    ground = replace(made.ground, covariance=np.diag(sd**2))
    params = replace(PARAMS, walk=0.4, external_sd=20.0, external_time_s=7200.0, bias_sd=2000.0)
    tracker = Tracker(ground, params)
    tracker.update(made.samples, ag.igrf().along(made.samples))
    late = tracker.history[tracker.history[:, 0] > 6000]
    rows = np.searchsorted(made.samples.time, late[:, 0])
    shape = made.truth.bias_at(made.samples.temperature[rows])
    truth = made.bias[rows] - shape + made.truth.bias_at(ground.centre_C)
    error = late[:, 1:4] - truth
    assert np.sqrt(np.mean(error**2)) < 20
    assert np.sqrt(np.mean((error / late[:, 4:]) ** 2)) == pytest.approx(1.0, abs=0.3)
    now = tracker.state.thermal
    assert now is not None
    warm = now.bias_at([5.0]) - made.truth.bias_at([5.0])  # its shape in temperature is kept
    assert (
        np.abs(warm - (made.bias[-1:] - made.truth.bias_at(made.samples.temperature[-1:]))).max()
        < 60
    )


@pytest.mark.slow
@pytest.mark.parametrize("cuts", [[1000], [5, 17, 40, 1499, 1505, 1520, 1600, 2900]])
def test_split_is_whole(cuts: list[int], tmp_path: Path) -> None:
    """In pieces, saved and resumed between them, across the opening and a jump, to rounding."""
    samples, reference, _, _ = orbiting(2, walk=1.0, jump=np.array([2000.0, -1000, 1500]))
    params = replace(PARAMS, walk=1.0, external_sd=20.0)
    whole = Tracker(params=params)
    expected = whole.update(samples, reference)
    assert len(whole.jumps) == 1
    pieces, found = Tracker(params=params), []
    for rows in np.split(np.arange(len(samples)), cuts):
        found.append(pieces.update(samples.select(rows), reference.select(rows)).residual)
        pieces = Tracker.resume(pieces.save(tmp_path / "state.json"))
    assert pieces.state.estimate.state == pytest.approx(
        whole.state.estimate.state, rel=1e-9, abs=1e-6
    )
    assert pieces.calibration.covariance == pytest.approx(
        whole.calibration.covariance, rel=1e-6, abs=1e-14
    )
    assert np.concatenate(found) == pytest.approx(expected.residual, abs=1e-4)
    assert pieces.history == pytest.approx(whole.history, rel=1e-6, abs=1e-4)
    assert (pieces.n, pieces.refused) == (whole.n, whole.refused)
    assert [j.time for j in pieces.jumps] == [j.time for j in whole.jumps]


@pytest.mark.slow
def test_flagged_rows_are_passed_over() -> None:
    samples, reference, _, _ = orbiting(2, walk=1.0)
    on = np.arange(len(samples)) % 7 == 3
    spoilt = samples.with_columns(
        field=samples.field + 9000.0 * on[:, None], flagged=on.astype(float)
    )
    without, tracker = Tracker(params=PARAMS), Tracker(params=PARAMS)
    expected = without.update(samples.select(~on), reference.select(~on))
    found = tracker.update(spoilt, reference)
    assert found.residual == pytest.approx(expected.residual)
    assert tracker.n == (~on).sum()
    later = spoilt.select(on).with_columns(time=samples.time[-1] + 1.0 + np.arange(on.sum()))
    assert len(tracker.update(later, reference.select(on)).residual) == 0


def test_one_reading_at_a_time_is_the_same() -> None:
    samples, reference, _, _ = orbiting(3, n=700)
    params = replace(PARAMS, walk=1.0)
    whole, expected = update(
        start(None, params), params, samples.time, samples.field, reference.values
    )
    state = start(None, params)
    for time, raw, magnitude in zip(samples.time, samples.field, reference.values, strict=True):
        state, found = update(state, params, time, raw, magnitude)
    assert state.estimate.state == pytest.approx(whole.estimate.state, rel=1e-9)
    assert found.residual[0] == pytest.approx(expected.residual[-1], abs=1e-6)


@pytest.mark.slow
def test_jumps_are_found_dated_and_measured() -> None:
    """3 µT: within two minutes, dated to seconds, as large as it was; and nothing else is."""
    z = []
    for seed in range(5):
        jump = np.random.default_rng(70 + seed).standard_normal(3)
        jump *= 3000 / np.linalg.norm(jump)
        samples, reference, bias, _ = orbiting(seed, walk=1.0, jump=jump)
        tracker = Tracker(params=replace(PARAMS, walk=1.0))
        tracker.update(samples, reference)
        assert len(tracker.jumps) == 1
        (found,) = tracker.jumps
        assert abs(found.time - 1501) <= 20
        assert found.seen - 1501 < 120
        z += [
            *((found.shift - jump) / found.shift_sd),
            *((tracker.bias - bias[-1]) / tracker.bias_sd),
        ]
        assert [finding.name for finding in tracker.findings] == ["bias jumped"]
    assert np.sqrt(np.mean(np.square(z))) == pytest.approx(1.0, abs=0.3)


@pytest.mark.slow
def test_a_start_from_nothing_knows_how_little_it_knows() -> None:
    """One side to the Earth, the field turns once an orbit: for half of one several biases fit."""
    params = TrackerParams(walk=0.4, external_sd=20.0, history_s=0.0)
    moments, errors = (16, 64, 100, 512, 1000, 2048, 4200, 6000), []
    for seed in range(1, 6):
        made = simulate_orbit(n=6000, seed=seed, thermal=0.0, pointing="nadir")
        known = ag.igrf().along(made.samples).magnitudes(6000)
        state, done = start(None, params), 0
        for n in moments:
            rows = slice(done, n)
            times, raw = made.samples.time[rows], made.samples.field[rows]
            state, _ = update(state, params, times, raw, known[rows])
            errors.append((state.bias - made.bias[n - 1]) / state.bias_sd)
            done = n
        assert state.settled
        assert state.bias_sd.max() < 300.0
    z = np.array(errors)
    assert np.abs(z).max() < 5.0  # linear standard errors alone: up to 15 at first, 30 later
    assert np.sqrt(np.mean(z[len(moments) - 1 :: len(moments)] ** 2)) > 0.3  # nor is it too modest


@pytest.mark.slow
def test_a_jump_before_the_bias_has_settled_is_found() -> None:
    made = simulate_orbit(n=5000, seed=5, thermal=0.0, pointing="nadir", jump=3000.0, jump_at=0.5)
    tracker = Tracker(params=TrackerParams(noise=NOISE, walk=0.4, external_sd=93.0))
    tracker.update(made.samples, ag.igrf().along(made.samples))
    assert [abs(jump.time - 2500) <= 20 for jump in tracker.jumps] == [True]
    assert np.abs((tracker.bias - made.bias[-1]) / tracker.bias_sd).max() < 4


@pytest.mark.slow
def test_no_jump_is_found_where_there_is_none() -> None:
    samples, reference, _, _ = orbiting(4, n=60_000, walk=0.3, external=60.0, strays=0.01)
    tracker = Tracker(params=replace(PARAMS, walk=0.3, external_sd=60.0))
    tracker.update(samples, reference)
    assert tracker.jumps == ()


@pytest.mark.slow
@pytest.mark.parametrize("kept", [0.8, 0.99])
def test_noise_with_memory_is_no_jump_and_is_in_the_standard_error(kept: float) -> None:
    """As much of it as of white noise; a white model says 2.4 and 7.6, and sees jumps."""
    z = []
    for seed in range(4):
        samples, reference, bias, _ = orbiting(seed)
        rng = np.random.default_rng(7000 + seed)
        stirred = NOISE * np.sqrt(1 - kept**2) * rng.standard_normal((len(samples) + 200, 3))
        lasting = lfilter([1.0], [1.0, -kept], stirred, axis=0)[200:]
        tracker = Tracker()
        tracker.update(samples.with_columns(field=samples.field + lasting), reference)
        z.append((tracker.bias - bias[-1]) / tracker.bias_sd)
        assert not tracker.jumps
        assert kept > 0.98 or tracker.state.external_sd == pytest.approx(NOISE, rel=0.35)
    assert np.sqrt(np.mean(np.square(z))) < 1.8


@pytest.mark.slow
@pytest.mark.parametrize(("sd", "time_s"), [(60.0, 600.0), (150.0, 600.0), (100.0, 5000.0)])
def test_a_slow_error_of_the_reference_that_nobody_stated_is_no_jump_and_is_told(
    sd: float, time_s: float
) -> None:
    """By the first readings alone errors are up to 27 standard errors, in silence."""
    decay, told = np.exp(-1 / time_s), 0
    for seed in range(4):
        samples, reference, bias, _ = orbiting(seed)
        rng = np.random.default_rng(7000 + seed)
        warm = int(10 * time_s)
        stirred = sd * np.sqrt(1 - decay**2) * rng.standard_normal(len(samples) + warm)
        wrong = lfilter([1.0], [1.0, -decay], stirred)[warm:]
        tracker = Tracker()
        tracker.update(samples, ag.Reference.magnitude(reference.values + wrong))
        z = (tracker.bias - bias[-1]) / tracker.bias_sd
        assert not tracker.jumps
        assert np.abs(z).max() < 3.5 or not tracker.ok
        told += "correlated errors" in [finding.name for finding in tracker.findings]
    assert told >= 2 or time_s > 1000


@pytest.mark.slow
def test_white_noise_is_not_called_correlated() -> None:
    for seed in range(5):
        samples, reference, _, _ = orbiting(100 + seed)
        tracker = Tracker()
        tracker.update(samples, reference)
        assert tracker.findings == ()
        assert tracker.state.estimate.inflation.factor.max() < 2


def test_the_error_that_a_reference_states_is_taken_unless_another_is_given() -> None:
    samples, reference, _, _ = orbiting(1, n=100)
    stated = replace(reference, sd=90.0)
    for given, expected in ((None, 90.0), (0.0, 0.0), (20.0, 20.0)):
        params = replace(PARAMS, external_sd=given)
        tracker = Tracker(params=params)
        tracker.update(samples, stated)
        assert tracker.state.settle_params(params).model(NOISE).external_sd == expected


def test_strays_are_refused() -> None:
    samples, reference, bias, _ = orbiting(5, strays=0.05)
    clean, _, _, _ = orbiting(5)
    stray = np.abs(samples.field - clean.field).max(axis=1) > 0
    tracker = Tracker(params=PARAMS)
    found = tracker.update(samples, reference)
    off = np.abs(found.residual) > 10 * found.residual_sd
    assert not found.used[500:][off[500:]].any()
    assert found.used[500:][~stray[500:]].all()
    assert np.all(np.abs(tracker.bias - bias[-1]) < 4 * tracker.bias_sd)
    assert 0.5 * stray.sum() < tracker.refused <= stray.sum()


@pytest.mark.slow
def test_many_refusals_and_a_wrong_noise_are_said() -> None:
    samples, reference, _, _ = orbiting(6, strays=0.3)
    tracker = Tracker(params=PARAMS)
    tracker.update(samples, reference)
    assert "readings refused" in [finding.name for finding in tracker.findings]
    samples, reference, _, _ = orbiting(6)
    tracker = Tracker(params=replace(PARAMS, noise=3000.0))
    tracker.update(samples, reference)
    assert [finding.name for finding in tracker.findings] == ["innovations"]
    assert [finding.name for finding in Tracker(params=PARAMS).findings] == ["not settled"]


def test_a_noise_that_is_not_given_is_estimated() -> None:
    samples, reference, _, _ = orbiting(7)
    tracker = Tracker()
    tracker.update(samples, reference)
    assert tracker.state.noise == pytest.approx(NOISE, rel=0.25)  # from the first hundreds


@pytest.mark.parametrize("chosen", ["symmetric", "triangular", "free"])
def test_the_gauge_of_the_ground_calibration_stays(chosen: str) -> None:
    samples, reference, bias, truth = orbiting(8)
    covariance = np.diag([300.0**2] * 3 + [0.003**2] * 6)
    matrix = truth.matrix
    if chosen == "triangular":
        matrix, covariance = gauge.make_triangular(truth.matrix, covariance)
    if chosen == "free":
        matrix = Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix() @ truth.matrix
        covariance = np.diag([300.0**2] * 3 + [0.003**2] * 9)
    ground = replace(truth, matrix=matrix, covariance=covariance, gauge=chosen)
    tracker = Tracker(ground, PARAMS)
    tracker.update(samples, reference)
    now = tracker.calibration
    assert now.gauge == chosen
    assert now.sd is not None
    assert np.all(np.abs(now.bias - bias[-1]) < 4 * now.sd[:3])
    assert now.matrix == pytest.approx(matrix, abs=0.002)
    turned = now.matrix @ np.linalg.inv(matrix)  # what magnitudes do not tell did not change
    assert np.abs(turned - turned.T).max() < (0.004 if chosen == "triangular" else 5e-4)
    uncertainty = now.uncertainty(samples.field[:100])
    assert np.all(np.linalg.eigvalsh(uncertainty) > -1e-9)


@pytest.mark.parametrize(("solve", "moved"), [("bias", 3), ("gains", 6), ("full", 9)])
def test_only_what_is_asked_for_moves(solve, moved: int) -> None:
    samples, reference, _, truth = orbiting(9, n=1000)
    covariance = np.diag([300.0**2] * 3 + [1e-6] * 6)
    tracker = Tracker(replace(truth, covariance=covariance), replace(PARAMS, solve=solve))
    tracker.update(samples, reference)
    now = tracker.calibration
    change = np.concatenate([now.bias - truth.bias, pack_symmetric(now.matrix - truth.matrix)])
    assert np.count_nonzero(np.abs(change) > 1e-12) == moved


@pytest.mark.slow
def test_the_walk_is_chosen_by_prediction() -> None:
    samples, reference, _, _ = orbiting(10, n=1000, walk=10.0)
    choice = choose_walk(samples, reference, params=PARAMS)
    assert 3.0 < choice.walk < 35.0
    assert choice.residual_rms.min() < 0.9 * choice.residual_rms[0]
    still, reference, _, _ = orbiting(10, n=1000)
    assert choose_walk(still, reference, params=PARAMS).walk <= 0.32


@pytest.mark.recordings
def test_the_second_half_of_the_space_station_is_predicted(recordings: Path) -> None:
    """Started on the first half, with the walk chosen there; 0.25 µT was asked for."""
    samples, reference = space_station(recordings)
    half = len(samples) // 2
    first, second = np.arange(half), np.arange(half, len(samples))
    walk = choose_walk(samples.select(first), reference.select(first)).walk
    tracker = Tracker(params=TrackerParams(walk=walk))
    tracker.update(samples.select(first), reference.select(first))
    found = tracker.update(samples.select(second), reference.select(second))
    assert found.used.mean() > 0.95
    assert np.sqrt(np.mean(found.residual**2)) < 150


def space_station(recordings: Path) -> tuple[ag.Samples, ag.Reference]:
    """The recording from its own table, without the first minutes, in which a magnet was near."""
    import csv
    from datetime import UTC, datetime

    path = recordings / "orbit" / "iss_2021-04-16_all_photos_classified.csv"
    with path.open() as stream:
        rows = list(csv.DictReader(stream))[60:]

    def degrees(text: str) -> float:
        whole, minutes, seconds = (float(part) for part in text.strip().lstrip("+-").split(":"))
        size = whole + minutes / 60 + seconds / 3600
        return -size if text.strip().startswith("-") else size

    epoch = datetime(2021, 4, 16, tzinfo=UTC)
    moments = [datetime.strptime(row["time"], "%Y/%m/%d %H:%M:%S.%f") for row in rows]
    samples = ag.Samples(
        time=[(m.replace(tzinfo=UTC) - epoch).total_seconds() for m in moments],
        epoch=epoch,
        field=[[float(row[axis]) for axis in "xyz"] for row in rows],
        unit="uT",
        latitude_deg=[degrees(row["lat"]) for row in rows],
        longitude_deg=[degrees(row["lon"]) for row in rows],
        altitude_m=np.full(len(rows), 420e3),
    )
    return samples, ag.igrf().along(samples)


@pytest.mark.parametrize(
    ("change", "error", "said"),
    [
        ({"time": None}, LogError, "needs them"),
        ({"unit": "raw"}, UnitError, "follows readings in nT"),
        ({"frame": "b"}, FrameError, "other axes"),
        ({}, AgonicError, "only what is new"),
    ],
)
def test_what_does_not_fit_is_said(change, error, said: str) -> None:
    samples, reference, _, _ = orbiting(11, n=100)
    tracker = Tracker(params=PARAMS)
    tracker.update(samples, reference)
    with pytest.raises(error, match=said):
        tracker.update(replace(samples, **change), reference)


@pytest.mark.parametrize(
    ("settings", "said"),
    [({"noise": 0.0}, "noise"), ({"walk": -1.0}, "walk"), ({"solve": "all"}, "solve")],
)
def test_settings_are_checked(settings, said: str) -> None:
    with pytest.raises(AgonicError, match=said):
        TrackerParams(**settings)


@pytest.mark.slow
def test_dates_put_logs_in_order() -> None:
    """A second log that counts its seconds from another epoch goes on where the first ended."""
    from datetime import UTC, datetime, timedelta

    samples, reference, _, _ = orbiting(12, n=1000)
    epoch = datetime(2026, 5, 1, tzinfo=UTC)
    whole = Tracker(params=PARAMS)
    whole.update(samples.with_columns(epoch=epoch), reference)
    tracker, rows = Tracker(params=PARAMS), np.arange(500)
    tracker.update(samples.with_columns(epoch=epoch).select(rows), reference.select(rows))
    later = samples.select(rows + 500)
    later = later.with_columns(time=later.time - 400, epoch=epoch + timedelta(seconds=400))
    tracker.update(later, reference.select(rows + 500))
    assert tracker.bias == pytest.approx(whole.bias, rel=1e-9)
    with pytest.raises(LogError, match="knows the date"):
        tracker.update(samples, reference)


@pytest.mark.parametrize("text", ["", "{}", "[1, 2]", '{"schema": "agonic/calibration@1"}'])
def test_another_file_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    path.write_text(text)
    with pytest.raises(LogError, match="not a usable track file"):
        Tracker.resume(path)
    with pytest.raises(LogError, match="there is no such file"):
        Tracker.resume(tmp_path / "none.json")


def test_a_damaged_state_is_refused(tmp_path: Path) -> None:
    samples, reference, _, _ = orbiting(13, n=100)
    tracker = Tracker(params=PARAMS)
    with pytest.raises(AgonicError, match="update the tracker before"):
        tracker.save(tmp_path / "state.json")
    tracker.update(samples, reference)
    path = tracker.save(tmp_path / "state.json")
    whole = path.read_text()
    for damaged in (whole[:-40], whole.replace('"watch":[', '"watch":[1.0,', 1)):
        path.write_text(damaged)
        with pytest.raises(LogError, match="not a usable track file"):
            Tracker.resume(path)
