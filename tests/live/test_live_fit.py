"""A calibration that grows: the same in pieces, bounded, honest, and worth obeying."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from agonic import CoverageError, Reference, fit_ellipsoid
from agonic.errors import AgonicError, LogError
from agonic.live.fit import LiveFit
from agonic.live.state import LiveParams

MATRIX = np.eye(3) + np.array([[0.05, 0.02, -0.01], [0.02, -0.03, 0.015], [-0.01, 0.015, 0.01]])
BIAS = np.array([20_000.0, -5000.0, 8000.0])
FIELD_N = 50_000 * np.array([np.cos(np.radians(60)), 0.0, np.sin(np.radians(60))])
RATE_HZ = 50
NOISE = 150.0


def readings(attitudes, rng, noise=NOISE):
    """What the sensor reads in attitudes (Rotation b → n)."""
    field = attitudes.inv().apply(FIELD_N)
    return field @ np.linalg.inv(MATRIX).T + BIAS + noise * rng.normal(size=field.shape)


def waved(rng, n):
    """Attitudes of a hand that waves at random about a rest pose, up to 60° about each axis."""
    time = np.arange(n) / RATE_HZ
    hertz = rng.uniform(0.1, 0.5, size=(4, 3))
    phase = rng.uniform(0, 2 * np.pi, size=(4, 3))
    angles = np.sin(2 * np.pi * hertz * time[:, None, None] + phase).mean(axis=1) * 2.0
    return Rotation.random(rng=rng) * Rotation.from_euler("ZYX", np.clip(angles, -1.05, 1.05))


def tumbled(rng, n):
    """Attitudes of a hand that turns every way at random, about a radian a second."""
    rates = gaussian_filter1d(rng.normal(size=(n, 3)), RATE_HZ / 2, axis=0)
    rates /= np.sqrt((rates**2).sum(axis=1).mean())
    attitude, path = Rotation.random(rng=rng), []
    for rate in rates:
        attitude = attitude * Rotation.from_rotvec(rate / RATE_HZ)
        path.append(attitude.as_quat())
    return Rotation.from_quat(path)


@pytest.fixture(scope="module")
def recording():
    rng = np.random.default_rng(7)
    return np.arange(3000) / RATE_HZ, readings(tumbled(rng, 3000), rng)


@pytest.mark.slow
def test_pieces_give_what_the_whole_gives(recording):
    time, field = recording
    whole = LiveFit(magnitude=50_000.0)
    field = field + 9000.0 * (np.abs(time - 31) < 0.5)[:, None]  # some of it is kept out
    whole.add(time, field)
    pieces = LiveFit(magnitude=50_000.0)
    cuts = np.sort(np.random.default_rng(1).integers(0, 3000, 40))
    for rows in np.split(np.arange(3000), cuts):
        pieces.add(time[rows], field[rows])
    a, b = whole.calibration, pieces.calibration
    np.testing.assert_allclose(a.bias, b.bias, rtol=1e-9)
    np.testing.assert_allclose(a.matrix, b.matrix, rtol=1e-9)
    assert 100 < whole.state.held == pieces.state.held
    np.testing.assert_array_equal(whole.state.waiting, pieces.state.waiting)
    np.testing.assert_array_equal(whole.state.kept, pieces.state.kept)
    np.testing.assert_array_equal(whole.state.repeats, pieces.state.repeats)
    assert whole.guidance.say == pieces.guidance.say


def test_it_agrees_with_the_fit_to_what_was_kept(recording):
    time, field = recording
    live = LiveFit(magnitude=50_000.0)
    live.add(time, field)
    fit = fit_ellipsoid(live.samples, Reference.constant(50_000.0), model="full")
    assert np.abs(live.calibration.bias - fit.calibration.bias).max() < 2 * fit.sd[:3].max()
    assert np.abs((live.calibration.bias - BIAS) / live.calibration.sd[:3]).max() < 4


@pytest.mark.slow
def test_memory_stays_bounded():
    rng = np.random.default_rng(2)
    live = LiveFit(magnitude=50_000.0)
    sizes = []
    for _ in range(8):
        live.add(np.arange(20_000.0), readings(Rotation.random(20_000, rng=rng), rng))
        sizes.append(len(live.state.kept))
    assert sizes[-1] < 25 * 768 + 15 * 768
    assert sizes[-1] - sizes[-2] < 800
    assert len(live.state.voxels.keys) <= 768


def test_units_and_shapes():
    in_microtesla = LiveFit(magnitude=50_000.0, unit="uT")
    rng = np.random.default_rng(3)
    field = readings(Rotation.random(500, rng=rng), rng)
    in_microtesla.add(np.arange(500.0), field / 1000)
    assert np.abs(in_microtesla.calibration.bias - BIAS).max() < 100
    with pytest.raises(AgonicError, match=r"times \(n,\)"):
        in_microtesla.add([0.0], field)
    with pytest.raises(AgonicError, match="above zero"):
        LiveParams(target_deg=0.0)


def test_no_calibration_before_the_sensor_turns():
    live = LiveFit(magnitude=50_000.0)
    live.add([0.0, 0.1], [[1.0, 2.0, 3.0]] * 2)
    assert live.fitted is None
    assert live.guidance.say == "turn the sensor slowly about all three axes"
    with pytest.raises(CoverageError, match="calibration yet"):
        _ = live.calibration


def names(live):
    return [finding.name for finding in live.guidance.findings]


def test_what_goes_wrong_is_told(recording):
    time, field = recording
    live = LiveFit(magnitude=50_000.0)
    live.add(time, field)
    assert names(live) == []
    near = BIAS + 1.18 * (field[:40] - BIAS)
    live.add(60 + time[:40], near)
    assert names(live) == ["near metal"]
    assert "18 % stronger" in live.guidance.findings[0].what
    assert not live.guidance.done
    live.add(61 + time[:100], np.where([False, True, False], field[7, 1], field[:100]))
    assert "frozen axis" in names(live)
    assert "axis y is frozen" in live.guidance.findings[0].what
    live.add(70 + time[:100], field[:100])
    assert names(live) == []
    live.add(80 + time[:100], np.full((100, 3), np.nan))
    assert "NaN" in names(live)


def test_a_disturbed_place_is_told():
    rng = np.random.default_rng(4)
    live = LiveFit(magnitude=42_000.0, source="world model")
    live.add(np.arange(800.0), readings(Rotation.random(800, rng=rng), rng))
    assert names(live) == ["off the model"]
    assert "18 % above the world model" in live.guidance.findings[0].what


def obeyed(rng, target_deg):
    """Radians turned until the target is reached by a hand that follows the arrow, 15° wrong.

    The hand turns at a radian a second, and looks at the page four times a second.
    """
    look, attitude, turn = RATE_HZ // 4, Rotation.random(rng=rng), rng.normal(size=3)
    live = LiveFit(magnitude=50_000.0, target_deg=target_deg)
    for k in range(400):
        said = live.guidance.turn
        if said is not None and np.linalg.norm(said) > 0.1:
            turn = said  # otherwise go on as before
        wrong = Rotation.from_rotvec(np.radians(15) * rng.normal(size=3) / np.sqrt(3))
        step = wrong.apply(turn / np.linalg.norm(turn)) / RATE_HZ
        path = attitude * Rotation.from_rotvec(step * np.arange(1, look + 1)[:, None])
        live.add((k * look + np.arange(look)) / RATE_HZ, readings(path, rng))
        attitude = path[-1]
        if live.fitted is not None and live.coverage.heading_sd_deg <= target_deg:
            return (k + 1) * look / RATE_HZ, live
    raise AssertionError("the target was never reached")


def radians_until(path, rng, target_deg):
    """Radians turned along a path until the target is reached."""
    live, look = LiveFit(magnitude=50_000.0, target_deg=target_deg), RATE_HZ // 4
    turned = np.cumsum((path[:-1].inv() * path[1:]).magnitude())
    field = readings(path, rng)
    for start in range(0, len(path) - look, look):
        live.add((start + np.arange(look)) / RATE_HZ, field[start : start + look])
        if live.fitted is not None and live.coverage.heading_sd_deg <= target_deg:
            return turned[start + look - 1]
    return np.inf


@pytest.fixture(scope="module")
def obedient():
    """Radians turned and the fit then, of eight hands that follow the arrow to half a degree."""
    return [obeyed(np.random.default_rng(100 + seed), 0.5) for seed in range(8)]


@pytest.mark.slow
def test_following_the_arrow_saves_half_the_turns(obedient):
    seeds = [np.random.default_rng(seed) for seed in range(3)]
    followed = np.median([turned for turned, _ in obedient])
    waving = np.median([radians_until(waved(rng, 9000), rng, 0.5) for rng in seeds])
    tumbling = np.median([radians_until(tumbled(rng, 3000), rng, 0.5) for rng in seeds])
    assert followed <= 0.5 * waving
    assert followed <= 0.6 * tumbling


@pytest.mark.slow
def test_the_standard_error_at_the_stop_is_honest(obedient):
    z = [(live.calibration.bias - BIAS) / live.calibration.sd[:3] for _, live in obedient]
    assert 0.7 < np.sqrt(np.mean(np.square(z))) < 1.4


def test_a_disturbance_that_lasts_is_told_however_long():
    rng = np.random.default_rng(6)
    live = LiveFit(magnitude=50_000.0)
    live.add(np.arange(600) / RATE_HZ, readings(tumbled(rng, 600), rng))
    told = []
    for k in range(4):  # first it is kept out; when it is as much as the rest the fit bends to it
        spoilt = BIAS + 1.18 * (readings(tumbled(rng, 600), rng) - BIAS)
        live.add(12 * (k + 1) + np.arange(600) / RATE_HZ, spoilt)
        told.append(names(live))
        assert not live.guidance.done
    assert told[0] == ["near metal", "disturbed"]
    assert all("disturbed" in said for said in told)


def passing_iron(time, attitudes, *, at, closest=0.15, speed=0.5, peak=0.2):
    """What a piece of iron adds that passes by the hand: a dipole, over the cube of its distance.

    `peak` of the field, m and m/s; fixed in the room.
    """
    share = peak / (1 + ((time - at) * speed / closest) ** 2) ** 1.5
    there = attitudes.inv().apply(50_000 * np.array([0.6, 0.3, 0.742]))
    return (share[:, None] * there) @ np.linalg.inv(MATRIX).T


@pytest.mark.slow
@pytest.mark.parametrize("turned", [tumbled, waved])
def test_iron_that_passes_leaves_nothing_behind(turned):
    for seed in range(2):
        rng = np.random.default_rng(seed)
        attitudes, time = turned(rng, 2000), np.arange(2000) / RATE_HZ
        good = readings(attitudes, rng)
        spoilt = good + passing_iron(time, attitudes, at=25.0)
        fits = [LiveFit(magnitude=50_000.0) for _ in range(2)]
        warned = 0
        fits[0].add(time, good)
        for rows in np.array_split(np.arange(2000), 50):
            fits[1].add(time[rows], spoilt[rows])
            warned += "near metal" in names(fits[1])
        without, passed = (fit.calibration for fit in fits)
        assert (np.abs(passed.bias - without.bias) < without.sd[:3]).all()
        assert fits[0].state.held == 0
        assert 1 < warned < 12
        assert names(fits[1]) == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1019, 1035, 1040])
def test_good_readings_are_let_in_where_little_was_seen(seed):
    """Paths whose first seconds lie in a plane: a fit to them is far off and sure of itself."""
    rng = np.random.default_rng(seed)
    field, live = readings(tumbled(rng, 3000), rng)[:1500], LiveFit(magnitude=50_000.0)
    for rows in np.array_split(np.arange(1500), 60):
        live.add(rows / RATE_HZ, field[rows])
    assert live.state.held == 0
    assert live.guidance.done
    assert np.abs((live.calibration.bias - BIAS) / live.calibration.sd[:3]).max() < 4


@pytest.mark.slow
def test_what_is_not_known_yet_is_not_complained_of():
    rng = np.random.default_rng(0)
    live = LiveFit(magnitude=50_000.0, source="the simulation")
    field = readings(tumbled(rng, 3000), rng)
    for rows in np.array_split(np.arange(500), 50):
        live.add(rows / RATE_HZ, field[rows])
        assert "off the model" not in names(live)
        assert live.guidance.say != "hold still"
    live = LiveFit(magnitude=42_000.0, source="the simulation")
    live.add(np.arange(3000) / RATE_HZ, field)
    assert "above the simulation;" in str(live.guidance.findings[0].sentence)


def test_what_waits_is_part_of_what_is_shown(recording):
    time, field = recording
    live = LiveFit(magnitude=50_000.0)
    live.add(time[:1000], field[:1000])
    assert live.boxes.counts.sum() == 1000
    assert 50 < len(live.state.waiting) < 100  # a second and a half at 50 Hz
    assert len(live.samples) == 1000
    slow = LiveFit(magnitude=50_000.0)
    slow.add(time[:1000] / 1000, field[:1000])  # 50 000 a second
    slow.add(1 + time / 1000, field)
    assert len(slow.state.waiting) <= 2000


@pytest.mark.slow
@pytest.mark.parametrize("cut", [0, 137, 1503])
def test_a_live_fit_that_was_saved_goes_on_exactly(recording, tmp_path, cut):
    time, field = recording
    whole = LiveFit(magnitude=50_000.0)
    spoilt = field + 9000.0 * (np.abs(time - 31) < 0.5)[:, None]
    first = LiveFit(magnitude=50_000.0)
    for live in (whole, first):
        live.add(time[:cut], spoilt[:cut])
    again = LiveFit.resume(first.save(tmp_path / "mag.live", origin="a wire"), origin="a wire")
    for live in (whole, again):
        live.add(time[cut:], spoilt[cut:])
    for name, value in vars(whole.state).items():
        np.testing.assert_equal(getattr(again.state, name), value, err_msg=name)
    np.testing.assert_array_equal(again.calibration.bias, whole.calibration.bias)
    np.testing.assert_array_equal(again.samples.field, whole.samples.field)
    assert again.guidance.say == whole.guidance.say


@pytest.mark.slow
def test_the_file_of_a_long_session_is_small(tmp_path):
    rng, live, sizes = np.random.default_rng(2), LiveFit(magnitude=50_000.0), []
    for k in range(6):
        time = 1000.0 * k + np.arange(50_000) / RATE_HZ
        live.add(time, readings(Rotation.random(50_000, rng=rng), rng))
        sizes.append(live.save(tmp_path / "mag.live").stat().st_size)
    assert sizes[-1] < 1.5e6
    assert sizes[-1] - sizes[-2] < 30_000


def test_a_state_that_cannot_be_gone_on_with(recording, tmp_path):
    time, field = recording
    live = LiveFit(magnitude=50_000.0, name="mag1")
    live.add(time[:200], field[:200])
    path = live.save(tmp_path / "mag1.live", origin="serial port /dev/ttyUSB0")
    closer = LiveFit.resume(path, LiveParams(name="mag1", target_deg=0.1, magnitude=49_000.0))
    assert closer.n == 200
    assert closer.calibration.magnitude == 49_000.0
    with pytest.raises(AgonicError, match=r"name 'mag1', not 'mag'"):
        LiveFit.resume(path, LiveParams())
    with pytest.raises(AgonicError, match="holds readings of serial port"):
        LiveFit.resume(path, origin="UDP port 14550")
    whole = path.read_bytes()
    for wrong in (b"", whole[:-9], b"[]", whole.replace(b"live-state@1", b"live-state@9")):
        path.write_bytes(wrong)
        with pytest.raises(LogError, match="not a usable state"):
            LiveFit.resume(path)


def test_enough_is_what_calibrate_will_call_good(recording):
    """Something magnetic came near by 3 % of the field: it is not enough to reach the target.
    A bend that leaves a heading as good as was asked for is no reason to go on."""
    time, field = recording
    live = LiveFit(magnitude=50_000.0)
    live.add(time, field + np.where(time[:, None] > 30, [1600.0, 0.0, 0.0], 0.0))
    assert live.coverage.heading_sd_deg < live.params.target_deg
    assert not live.guidance.done
    assert any("was not the same" in finding.what for finding in live.guidance.findings)
    bent = LiveFit(magnitude=50_000.0)
    bent.add(time, 300_000 * np.tanh(field / 300_000))
    assert bent.guidance.done
