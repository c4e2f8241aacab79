"""`Retrainer` on streams: what changes is learned, what is wrong is not, halves make the whole."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

import agonic as ag
from agonic.calibration.network import Network
from agonic.calibration.retraining import RetrainerParams
from agonic.cli.simulate import train_on_ground
from agonic.field.place import field_along
from agonic.inflight.simulation.orbit import simulate_orbit
from agonic.maths.rotations.attitude import rot_nb
from agonic.network.fit import fit_network
from agonic.network.retraining import Retrainer
from agonic.network.simulate import SimulatedField, simulate_nonaffine, simulate_paper

CHANGE_S = 15.0
JUMP = np.array([400.0, -250.0, 150.0])
PARAMS = RetrainerParams(window_s=15.0)


def ground_of(made: SimulatedField, base: str | None = "affine", seed: int = 0) -> Network:
    """A network trained on what the paper's sensor read before it changed."""
    before = made.select(made.samples.time < CHANGE_S)
    fit = fit_network(
        before.samples, before.reference, base=base, compared=False, restarts=1, seed=seed
    )
    return fit.calibration


def streamed(retrainer: Retrainer, made: SimulatedField, chunk: int) -> np.ndarray:
    """The residuals of all readings, in chunks."""
    parts = []
    for start in range(0, len(made.field), chunk):
        part = made.select(slice(start, start + chunk))
        parts.append(retrainer.update(part.samples, part.reference).residual)
    return np.concatenate(parts)


def spoilt(made: SimulatedField, rows: np.ndarray, raw=None, field=None) -> SimulatedField:
    """The same with other readings or another field in some of the rows."""
    readings, known = np.array(made.samples.field), np.array(made.field)
    if raw is not None:
        readings[rows] = raw(readings[rows])
    if field is not None:
        known[rows] = field(known[rows])
    samples = made.samples.with_columns(field=readings)
    return SimulatedField(samples=samples, field=known, facts=made.facts)


@pytest.mark.slow
@pytest.mark.parametrize(("base", "seeds"), [(None, 8), ("affine", 6)])
def test_published_change_is_learned_with_every_seed(base: str | None, seeds: int) -> None:
    for seed in range(seeds):
        made = simulate_paper(33.0, seed=seed)
        time = made.samples.time
        ground = ground_of(made, base, seed)
        frozen, _ = ground.evaluated(made.samples.field, {})
        late = time >= CHANGE_S
        assert 25.0 < np.linalg.norm((frozen - made.field)[late].mean(axis=0)) < 40.0
        retrainer = Retrainer(ground, PARAMS)
        residual = np.abs(streamed(retrainer, made, 100))
        learned = time >= CHANGE_S + 1.0
        assert residual[learned].max() < 10.0
        assert retrainer.ok
        [change] = retrainer.state.changes
        assert change.onset == pytest.approx(CHANGE_S, abs=0.05)
        assert change.time - CHANGE_S < 1.0  # within the chunk in which it was detected


def test_pieces_of_any_size_make_the_whole(tmp_path: Path) -> None:
    made = simulate_paper(32.0, seed=3)
    ground = ground_of(made)
    whole, pieces = Retrainer(ground, PARAMS), Retrainer(ground, PARAMS)
    expected = streamed(whole, made, 10_000)
    parts = []
    rng, done = np.random.default_rng(1), 0
    while done < len(made.field):
        part = made.select(slice(done, done + int(rng.integers(1, 400))))
        parts.append(pieces.update(part.samples, part.reference).residual)
        pieces = Retrainer.resume(pieces.save(tmp_path / "state.json"))
        done += len(part.field)
    np.testing.assert_allclose(np.concatenate(parts), expected, rtol=0, atol=1e-6)
    assert [(one.n, one.why, one.accepted) for one in pieces.retrainings] == [
        (one.n, one.why, one.accepted) for one in whole.retrainings
    ]
    np.testing.assert_allclose(pieces.calibration.weights, whole.calibration.weights, rtol=1e-6)


@pytest.fixture(scope="module")
def minute() -> tuple[SimulatedField, Network]:
    """A tumbling sensor for a minute, and a network of its first 25 seconds."""
    made = simulate_nonaffine(n=6000, rate_Hz=100.0, hysteresis=0.0, seed=2)
    before = made.select(slice(0, 2500))
    fit = fit_network(before.samples, before.reference, hidden=6, compared=False)
    return made, fit.calibration


@pytest.mark.slow
@pytest.mark.parametrize(
    ("word", "settings"),
    [
        (
            "outliers",
            {
                "raw": lambda r: (
                    r
                    + 3000.0
                    * np.random.default_rng(0).choice([-1.0, 0.0, 0.0, 0.0, 1.0], (len(r), 1))
                )
            },
        ),
        ("wrong reference", {"field": lambda f: np.roll(f, 400, axis=0)}),
        ("wrong reference", {"field": lambda f: f * 1000.0}),
        ("wrong reference", {"field": lambda f: f[:, [1, 0, 2]] * [1.0, 1.0, -1.0]}),
        ("stuck", {"raw": lambda r: np.broadcast_to(r[0], r.shape)}),
    ],
)
def test_poisoned_stretch_is_rejected_with_its_reason(word: str, settings: dict, minute) -> None:
    # ten seconds from the thirtieth on are spoilt
    made, ground = minute
    bad = np.arange(3000, 4000)
    retrainer = Retrainer(ground, RetrainerParams(window_n=2500, every_n=500))
    residual = streamed(retrainer, spoilt(made, bad, **settings), 250)
    poisoned = [one for one in retrainer.retrainings if one.poisoned]
    assert any(word in one.reason for one in poisoned), [one.reason for one in poisoned]
    assert not any(one.accepted for one in retrainer.retrainings if 3100 < one.n <= 4000)
    after = slice(5000, None)
    expected, _ = ground.evaluated(made.samples.field[after], {})
    allowed = 1.05 * np.sqrt(np.mean((expected - made.field[after]) ** 2))
    assert np.sqrt(np.mean(residual[after] ** 2)) < allowed


def test_steady_sensor_raises_no_alarm() -> None:
    ground = ground_of(simulate_paper(CHANGE_S, directions="space", seed=5))
    made = simulate_paper(CHANGE_S, rate_Hz=800.0, directions="space", seed=6)
    retrainer = Retrainer(ground, RetrainerParams(window_n=1500))
    streamed(retrainer, made, 1000)
    assert {one.why for one in retrainer.retrainings} == {"period"}


@pytest.mark.slow
@pytest.mark.parametrize("kept", [0.9, 0.97])
def test_noise_with_memory_is_no_change(kept: float) -> None:
    """Nothing says at first how long residuals last; the readings before an alarm do."""
    for seed in range(3):
        made = simulate_paper(90.0, directions="space", noise=1e-6, seed=seed)
        early = made.samples.time < CHANGE_S
        response = np.linalg.lstsq(
            np.column_stack([made.field, np.ones(len(early))])[early],
            made.samples.field[early],
            rcond=None,
        )[0]
        steady = np.column_stack([made.field, np.ones(len(early))]) @ response
        stirred = np.random.default_rng(seed).normal(size=(len(early) + 300, 3))
        noise = lfilter([np.sqrt(1 - kept**2)], [1.0, -kept], stirred, axis=0)[300:]
        made = spoilt(made, np.arange(len(early)), raw=lambda _, r=steady + 2.0 * noise: r)
        retrainer = Retrainer(ground_of(made.select(slice(0, 3000)), seed=seed), PARAMS)
        streamed(retrainer, made.select(slice(3000, None)), 250)
        assert {one.why for one in retrainer.retrainings} == {"period"}


@pytest.mark.slow
def test_affine_step_keeps_what_the_network_had_learned() -> None:
    made = simulate_nonaffine(n=9000, hysteresis=0.0, seed=4)
    jump = np.arange(6000, 9000)
    shifted = spoilt(made, jump, raw=lambda r: r + JUMP)
    before = made.select(slice(0, 6000))
    ground = fit_network(before.samples, before.reference, hidden=6, compared=False).calibration
    retrainer = Retrainer(ground, RetrainerParams(window_n=3000, alarm=10.0))
    residual = streamed(retrainer, shifted, 50)
    [change] = retrainer.state.changes
    assert change.what == "an affine step"
    clean, _ = ground.evaluated(made.samples.field, {})
    usual = np.sqrt(np.mean((clean - made.field)[jump] ** 2))
    soon = slice(6000 + 200, 6000 + 600)  # 200 readings later, ten a second
    assert np.sqrt(np.mean(residual[soon] ** 2)) < 2.0 * usual
    assert np.sqrt(np.mean(residual[-1000:] ** 2)) < 1.2 * usual
    error = retrainer.calibration.base.bias - ground.base.bias - JUMP
    assert np.abs(error).max() < 60.0


def test_magnitude_alone_follows_a_jump_of_the_bias() -> None:
    made = simulate_nonaffine(n=8000, hysteresis=0.0, saturation=0.0, cross=0.0, seed=6)
    jump = np.arange(4000, 8000)
    shifted = spoilt(made, jump, raw=lambda r: r + JUMP)
    before = made.select(slice(0, 4000))
    known = ag.Reference.magnitude(np.linalg.norm(before.field, axis=1))
    ground = fit_network(before.samples, known, target="magnitude", compared=False).calibration
    retrainer = Retrainer(ground, RetrainerParams(window_n=2000))
    for start in range(0, 8000, 100):
        part = shifted.select(slice(start, start + 100))
        known = ag.Reference.magnitude(np.linalg.norm(part.field, axis=1))
        retrainer.update(part.samples, known)
    moved = retrainer.calibration.base.bias - ground.base.bias
    np.testing.assert_allclose(moved, JUMP, atol=15.0)


def test_starts_from_nothing_with_an_affine_where_that_is_enough() -> None:
    made = simulate_paper(15.0, directions="space", seed=1)
    retrainer = Retrainer(None, RetrainerParams(window_n=1000))
    seen = retrainer.update(made.samples, made.reference)
    assert np.isnan(seen.residual[:999]).all()
    assert retrainer.calibration.kind == "affine"
    assert np.abs(seen.residual[1000:]).max() < 12.0


def test_field_in_north_east_down_is_turned_by_the_attitude() -> None:
    rng = np.random.default_rng(0)
    n = 1200
    roll, pitch, heading = rng.uniform(-60, 60, n), rng.uniform(-60, 60, n), rng.uniform(0, 360, n)
    north = np.array([18_000.0, 500.0, 45_000.0])
    body = np.einsum("nji,j->ni", rot_nb(roll, pitch, heading), north)
    offset = np.array([250.0, -100.0, 75.0])
    samples = ag.Samples(
        time=np.arange(n) / 10.0,
        field=body + offset + rng.normal(0, 20, (n, 3)),
        roll_deg=roll,
        pitch_deg=pitch,
        heading_deg=heading,
        frame="b",
    )
    retrainer = Retrainer(None, RetrainerParams(window_n=1000))
    retrainer.update(samples, ag.Reference.vector(north, frame="n"))
    assert retrainer.calibration.frame_out == "b"
    np.testing.assert_allclose(retrainer.calibration.bias, [250.0, -100.0, 75.0], atol=15.0)


@pytest.mark.slow
@pytest.mark.parametrize("every_s", [1.0, 10.0])
@pytest.mark.parametrize("changed", [{}, {"drift": 400.0}, {"jump": 600.0}])
def test_half_orbits_forget_nothing(every_s: float, changed: dict) -> None:
    """Windows that show half of the directions, under a ring current that no model has: no worse
    than the ground's network left as it is, or trained on the whole flight at once."""
    n = int(54_000 / every_s)
    squares = np.zeros(3)
    for seed in (1, 2):
        made = simulate_orbit(n=n, rate_Hz=1 / every_s, noise=0.0, seed=seed, **changed)
        noise = 100.0 * np.random.default_rng((seed, 3)).standard_normal((n, 3))
        samples = made.samples.with_columns(field=made.samples.field + noise)
        ground, known = train_on_ground(made, 100.0, seed), field_along(samples).reference
        some = np.arange(0, n, max(int(10 / every_s), 1))
        fit = fit_network(samples.select(some), known.select(some), start=ground, compared=False)
        params = RetrainerParams(window_s=2820.0, every_s=2820.0, window_n=4000)
        retrainer = Retrainer(ground, params)
        truth = made.rot_nb.apply(made.field_n, inverse=True)
        for start in range(0, n, 141):
            rows = np.arange(start, min(start + 141, n))
            raw, beside = made.samples.field[rows], {"temperature": made.samples.temperature[rows]}
            for k, one in enumerate((ground, fit.calibration, retrainer.calibration)):
                squares[k] += ((one.evaluated(raw, beside)[0] - truth[rows]) ** 2).sum()
            retrainer.update(samples.select(rows), known.select(rows))
        assert len(retrainer.retrainings) > 15
    never, everything, kept = np.sqrt(squares / (6 * n))
    assert kept < 1.05 * min(never, everything)


def test_magnitude_that_was_asked_for_stays_with_a_network_of_vectors() -> None:
    ground = ground_of(simulate_paper(CHANGE_S, directions="space", seed=1))
    asked = RetrainerParams(target="magnitude", window_n=500)
    retrainer = Retrainer(ground, asked)
    assert retrainer.params.target == "magnitude"
    made = simulate_paper(CHANGE_S, directions="space", seed=2)
    known = ag.Reference.magnitude(np.linalg.norm(made.field, axis=1))
    seen = retrainer.update(made.samples, known)
    assert seen.residual.shape[1] == 1
    assert len(retrainer.retrainings) > 1
    field = retrainer.calibration.evaluated(made.samples.field, {})[0]
    assert np.sqrt(np.mean((field - made.field) ** 2)) < 3.0


@pytest.mark.slow
def test_memory_stays_bounded() -> None:
    made = simulate_paper(60.0, rate_Hz=200.0, seed=2)
    params = RetrainerParams(window_n=500, every_n=500)
    retrainer = Retrainer(ground_of(made), params)
    for start in range(0, len(made.field), 700):
        part = made.select(slice(start, start + 700))
        retrainer.update(part.samples, part.reference)
        assert len(retrainer.state.window) <= 500


def test_readings_that_do_not_meet_it_are_refused_in_words() -> None:
    made = simulate_paper(16.0)
    retrainer = Retrainer(ground_of(made), PARAMS)
    early = made.select(slice(0, 100))
    retrainer.update(early.samples, early.reference)
    with pytest.raises(ag.AgonicError, match="times must increase"):
        retrainer.update(early.samples, early.reference)
    late = made.select(slice(100, 200))
    with pytest.raises(ag.AgonicError, match="needs its components"):
        retrainer.update(late.samples, ag.Reference.constant(50_000.0))
    with pytest.raises(ag.FrameError):
        retrainer.update(late.samples.with_columns(frame="b"), late.reference)
    with pytest.raises(ag.LogError, match="without times"):
        retrainer.update(ag.Samples(field=late.samples.field), late.reference)
    with pytest.raises(ag.AgonicError, match="starts from a Network"):
        Retrainer(object())
    with pytest.raises(ag.AgonicError, match="shorter than"):
        RetrainerParams(window_n=10)


def test_file_without_the_posterior_of_its_trainings_says_so(tmp_path: Path) -> None:
    made = simulate_paper(33.0)
    retrainer = Retrainer(ground_of(made), PARAMS)
    retrainer.update(made.samples, made.reference)
    assert retrainer.state.accepted > 0
    path = retrainer.save(tmp_path / "state.json")
    assert "no posterior" not in Retrainer.resume(path).status
    record = json.loads(path.read_text())
    for name in ("covariance", "reservoir", "learned"):
        record["state"].pop(name)
    path.write_text(json.dumps(record))
    assert "the state has no posterior" in Retrainer.resume(path).status
    record["state"].pop("noise")
    path.write_text(json.dumps(record))
    with pytest.raises(ag.LogError, match="the state has no `noise`"):
        Retrainer.resume(path)


def test_damaged_file_is_told_so(tmp_path: Path) -> None:
    made = simulate_paper(16.0)
    retrainer = Retrainer(ground_of(made), PARAMS)
    path = retrainer.save(tmp_path / "state.json")
    assert Retrainer.resume(path).n == 0
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(ag.LogError, match="not a usable retraining file"):
        Retrainer.resume(path)
    path.write_text('{"schema": "agonic/track-state@1", "params": {}, "state": {}}')
    with pytest.raises(ag.LogError, match="not a usable retraining file"):
        Retrainer.resume(path)
