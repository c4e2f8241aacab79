"""`fit_latency` against readings late by an exact amount, and `undelayed` against truth."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.attitude.latency import fit_latency
from agonic.attitude.undo_latency import undelayed
from agonic.errors import AgonicError, CoverageError
from agonic.maths.rotations.angles import angle_deg
from agonic.maths.rotations.attitude import angles_deg, yaw_pitch_roll
from agonic.simulation import magnet_attached, simulate, with_outliers
from agonic.simulation.draws import draw_directions

FINE_HZ = 1000


def late(
    kind: str,
    *,
    seed: int,
    late_ms: int,
    rate_Hz: float = 50.0,
    duration_s: float = 40.0,
    noise: float = 200.0,
    attitude_deg: float = 0.0,
    gyro_deg_s: float = 0.0,
    **settings,
) -> ag.Samples:
    """Readings of `late_ms` ago, picked from rows a millisecond apart: no interpolation at all.

    Noise is added afterwards, to readings, attitude (turns about random axes) and gyro; the gyro
    has a bias of 0.5°/s.
    """
    n = int(duration_s * FINE_HZ)
    made = simulate(kind, n=n + FINE_HZ, rate_Hz=FINE_HZ, noise=0.0, seed=seed, **settings).samples
    rng = np.random.default_rng([seed, 1])
    rows = FINE_HZ // 2 + np.round(np.arange(0, n, FINE_HZ / rate_Hz)).astype(int)
    now = made.select(rows)
    shake = Rotation.from_rotvec(rng.normal(0, np.radians(attitude_deg), (len(rows), 3)))
    turned = yaw_pitch_roll(now.heading_deg, now.pitch_deg, now.roll_deg) * shake
    roll, pitch, heading = angles_deg(turned.as_matrix())
    rate = now.rotation_rate + np.radians(0.5 * draw_directions(rng, 1))
    rate = rate + rng.normal(0, np.radians(gyro_deg_s), rate.shape)
    return now.with_columns(
        field=made.field[rows - late_ms] + rng.normal(0, noise, (len(rows), 3)),
        roll_deg=roll,
        pitch_deg=pitch,
        heading_deg=heading,
        rotation_rate=rate,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "methods", "settings"),
    [
        ("hand", ["attitude"], {"rate_Hz": 100.0}),
        ("hand", ["attitude"], {"attitude_deg": 0.3, "noise": 50.0, "late_ms": 7}),
        ("hand", ["attitude"], {"rate_Hz": 10.0, "duration_s": 80.0, "late_ms": 33}),
        ("tumble", ["gyro"], {"gyro_deg_s": 0.1, "late_ms": -13}),
        (
            "flight",
            ["attitude", "gyro"],
            {
                "rate_Hz": 25.0,
                "duration_s": 100.0,
                "attitude_deg": 0.3,
                "gyro_deg_s": 0.1,
                "noise": 50.0,
                "late_ms": 47,
                "stray_nT_A": (0.0, 0.0, 0.0),
            },
        ),
    ],
)
def test_latency_is_unbiased_and_its_standard_error_honest(kind, methods, settings) -> None:
    settings = {"late_ms": 3, **settings}
    logs = [late(kind, seed=seed, **settings) for seed in range(8)]
    for method in methods:
        fits = [fit_latency(log, method=method) for log in logs]
        assert all(fit.known and fit.method == method for fit in fits)
        errors = [1000 * fit.latency_s - settings["late_ms"] for fit in fits]
        told = [1000 * fit.sd_s for fit in fits]
        z = np.array(errors) / np.array(told)
        assert abs(z.mean()) < 0.85  # 2.4 standard errors of the mean of eight
        assert 0.2 < np.sqrt(np.mean(z**2)) < 1.55  # 10 Hz hardly resolves a hand: told so
        assert np.median(told) < (2.0 if kind == "flight" else 0.6)


@pytest.mark.slow
def test_rows_do_not_attract_the_latency() -> None:
    """A noisy attitude interpolated between rows is less noisy there; that must not count."""
    found = []
    for late_ms in (20, 25, 30, 35, 40):
        samples = late("hand", seed=late_ms, late_ms=late_ms, attitude_deg=1.0, noise=30.0)
        found.append(1000 * fit_latency(samples).latency_s - late_ms)
    assert np.abs(found).max() < 0.5  # of 20 ms from row to row


@pytest.mark.slow
def test_strays_and_a_magnet_do_not_move_it() -> None:
    samples = late("hand", seed=2, late_ms=14, rate_Hz=100.0, duration_s=100.0)
    spoilt = with_outliers(0.02, seed=1)(samples)
    spoilt = magnet_attached(35.0, (20_000.0, -5_000.0, 9_000.0), until=70.0)(spoilt)
    for method in ("attitude", "gyro"):
        fit = fit_latency(spoilt, method=method)
        assert 1000 * fit.latency_s == pytest.approx(14, abs=0.4)
        assert fit.significant


def test_it_needs_no_calibration_no_unit_and_no_mounting() -> None:
    samples = late("hand", seed=4, late_ms=20)
    mounted = Rotation.from_euler("ZYX", [130, -50, 20], degrees=True)
    other = ag.Samples(
        **{
            **samples.columns(),
            "field": mounted.apply(samples.field.copy()) @ np.diag([0.004, 0.006, 0.005])
            + [900, 0, -300],
        },
        unit="raw",
    )
    ours, theirs = fit_latency(samples), fit_latency(other)
    assert theirs.latency_s == pytest.approx(ours.latency_s, abs=3 * ours.sd_s)
    assert theirs.unit == "raw"


@pytest.mark.parametrize("method", ["attitude", "gyro"])
def test_no_latency_is_not_significant(method: str) -> None:
    fit = fit_latency(late("hand", seed=9, late_ms=0), method=method)
    assert (fit.known, fit.significant) == (True, False)
    assert fit.status.startswith("No delay")


@pytest.mark.slow
@pytest.mark.parametrize("method", ["attitude", "gyro"])
def test_a_sensor_at_rest_tells_nothing(method: str) -> None:
    noisy = late("static", seed=1, late_ms=15, attitude_deg=0.05, gyro_deg_s=0.05)
    for samples in (noisy, simulate("static", n=2000, seed=1).samples):
        fit = fit_latency(samples, method=method)
        assert (fit.known, fit.significant) == (False, False)
        assert "not determined" in fit.status
        assert fit.findings[0].move


def test_steady_circles_about_one_axis_tell_nothing_against_a_free_mounting() -> None:
    """Being late by τ is there the same as a mounting turned by ωτ."""
    t = np.arange(3000) / 50
    heading = 40.0 * t % 360
    field = yaw_pitch_roll(heading, 0 * t, 0 * t).apply([20_000.0, 0.0, 43_000.0], inverse=True)
    field += np.random.default_rng(0).normal(0, 100, field.shape)
    samples = ag.Samples(time=t, field=field, roll_deg=0 * t, pitch_deg=0 * t, heading_deg=heading)
    assert not fit_latency(samples).significant


def test_a_latency_beyond_the_search_is_not_known() -> None:
    fit = fit_latency(late("hand", seed=1, late_ms=150), limit_s=0.1)
    assert (fit.known, fit.significant) == (False, False)
    assert fit_latency(late("hand", seed=1, late_ms=150)).latency_s == pytest.approx(0.15, abs=1e-3)


def test_bad_input_is_named() -> None:
    samples = simulate("hand", n=1000).samples
    with pytest.raises(AgonicError, match="needs the times"):
        fit_latency(samples.with_columns(time=None))
    with pytest.raises(AgonicError, match="no columns of roll, pitch and heading, or of rotation"):
        fit_latency(samples.with_columns(heading_deg=None, rotation_rate=None))
    with pytest.raises(AgonicError, match="no columns of rotation rate;"):
        fit_latency(samples.with_columns(rotation_rate=None), method="gyro")
    with pytest.raises(AgonicError, match="method 'mag' is not known"):
        fit_latency(samples, method="mag")
    with pytest.raises(AgonicError, match="above zero"):
        fit_latency(samples, limit_s=0.0)
    with pytest.raises(CoverageError, match=r"only .* readings lie 0\.3 s or more from ends"):
        fit_latency(samples.select(np.arange(60)))
    assert fit_latency(samples.with_columns(heading_deg=None)).method == "tilt"
    assert fit_latency(samples.with_columns(heading_deg=None, roll_deg=None)).method == "gyro"


def test_undelayed_readings_meet_the_attitude_they_were_made_in() -> None:
    delayed_ = late("hand", seed=5, late_ms=30, noise=0.0)
    prompt = late("hand", seed=5, late_ms=0, noise=0.0)
    on_time = undelayed(delayed_, 0.030)
    made = simulate("hand", n=41_000, rate_Hz=FINE_HZ, noise=0.0, seed=5)

    def off(samples: ag.Samples) -> np.ndarray:
        turned = yaw_pitch_roll(samples.heading_deg, samples.pitch_deg, samples.roll_deg)
        seen = turned.apply(made.field_n, inverse=True)
        return angle_deg(made.truth.correct(samples.field), seen)

    assert np.sqrt(np.mean(off(on_time) ** 2)) < 0.1
    assert np.sqrt(np.mean(off(delayed_) ** 2)) > 3.0
    assert len(on_time) == len(prompt) - 2
    assert on_time.rejected == {"nothing recorded at the moment of the reading": 2}
    np.testing.assert_allclose(on_time.time, delayed_.time[2:] - 0.030)


def test_undelayed_turns_through_north_and_over_the_top() -> None:
    samples = ag.Samples(
        time=[0.0, 1.0, 2.0],
        field=np.eye(3),
        roll_deg=[170.0, -170.0, -170.0],
        pitch_deg=[0.0, 0.0, 20.0],
        heading_deg=[350.0, 350.0, 350.0],
        throttle=[0.0, 1.0, 0.0],
        station=[1.0, 2.0, 2.0],
        second=2 * np.eye(3),
        acceleration=[[0, 0, -9.0], [0, 0, -10.0], [0, 0, -9.0]],
    )
    on_time = undelayed(samples, 0.75)
    np.testing.assert_allclose(on_time.time, [0.25, 1.25])
    np.testing.assert_allclose(on_time.roll_deg, [175.0, -170.0])
    np.testing.assert_allclose(on_time.pitch_deg, [0.0, 5.0], atol=1e-12)
    np.testing.assert_allclose(on_time.heading_deg, [350.0, 350.0])
    np.testing.assert_allclose(on_time.throttle, [0.25, 0.75])
    assert on_time.station.tolist() == [1.0, 2.0]
    np.testing.assert_allclose(on_time.acceleration[:, 2], [-9.25, -9.75])
    np.testing.assert_array_equal(on_time.field, np.eye(3)[1:])
    np.testing.assert_array_equal(on_time.second, 2 * on_time.field)


def test_undelayed_drops_what_fell_into_a_gap_and_everything_beyond_the_log() -> None:
    time = np.concatenate([np.arange(100) * 0.01, 5 + np.arange(100) * 0.01])
    samples = ag.Samples(time=time, field=np.ones((200, 3)), temperature=time)
    on_time = undelayed(samples, 0.05)
    assert len(on_time) == 190
    np.testing.assert_allclose(on_time.temperature, on_time.time)
    early = undelayed(samples, -0.05)
    assert len(early) == 190
    assert undelayed(samples, 0.0).rejected == {}
    with pytest.raises(CoverageError, match="no reading is left"):
        undelayed(samples, 2.0)


def test_fitted_and_undone_nothing_is_left() -> None:
    samples = late("hand", seed=11, late_ms=25, rate_Hz=100.0)
    again = fit_latency(undelayed(samples, fit_latency(samples).latency_s))
    assert abs(again.latency_s) < 3 * again.sd_s
    assert not again.significant


@pytest.mark.parametrize(("kind", "attitude_deg"), [("car", 0.0), ("boat", 0.3), ("flight", 0.3)])
def test_on_time_is_not_called_late(kind: str, attitude_deg: float) -> None:
    """A car's few gentle turns, and attitudes whose errors last for seconds."""
    z = []
    for seed in range(8):
        samples = simulate(kind, n=2500, seed=seed).samples
        noise = np.random.default_rng(seed).standard_normal((3000, 3))
        error = attitude_deg * lfilter([np.sqrt(1 - 0.99**2)], [1, -0.99], noise, axis=0)[500:]
        roll, pitch, heading = error.T
        fit = fit_latency(
            samples.with_columns(
                roll_deg=samples.roll_deg + roll,
                pitch_deg=samples.pitch_deg + pitch,
                heading_deg=samples.heading_deg + heading,
            )
        )
        assert not fit.significant
        z.append(fit.latency_s / fit.sd_s)
    assert np.sqrt(np.mean(np.square(z))) < 1.3


def test_a_car_without_noise_is_on_time() -> None:
    """What is left out as too small to see must be smaller than the noise, not than the field."""
    fit = fit_latency(simulate("car", n=3000, seed=7, noise=0.0).samples)
    assert 1000 * abs(fit.latency_s) < 3.0


def test_a_dead_magnetometer_tells_no_latency() -> None:
    samples = simulate("hand", n=2000, seed=1).samples
    with pytest.raises(ag.CoverageError, match="never change"):
        fit_latency(samples.with_columns(field=np.zeros((2000, 3))))
