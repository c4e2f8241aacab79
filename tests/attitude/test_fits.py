"""Levelled, vector and interference fits: truth, honesty, what they refuse, real flights."""

import re
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.attitude.fit import fit_levelled, fit_vector
from agonic.attitude.interference import fit_interference
from agonic.attitude.problem import Settings, normalise
from agonic.field.place import field_along
from agonic.maths.equation.channels import compute_residuals
from agonic.maths.equation.starting_values import fit_at_once
from agonic.maths.equation.symmetric import pack_symmetric
from agonic.maths.rotations.attitude import down_b
from agonic.maths.rotations.tilt import heading_by_vectors_deg
from agonic.simulation import simulate

PLACE = ag.Reference.horizontal_vertical(25_000.0, 43_301.27018922)
STRAY = (60.0, -35.0, 90.0)


def flown(seed: int = 0, *, stray=(0.0, 0.0, 0.0), tilt_sd_deg: float = 0.0, n=3000, **settings):
    """A banked flight; the logged roll and pitch may wander by `tilt_sd_deg` over two seconds."""
    made = simulate("flight", n=n, rate_Hz=25.0, stray_nT_A=stray, seed=seed, **settings)
    samples = made.samples
    if tilt_sd_deg:
        kept = np.exp(-1 / 50)
        white = np.random.default_rng(seed + 999).standard_normal((n, 2))
        white[1:] *= np.sqrt(1 - kept**2)
        wrong = tilt_sd_deg * lfilter([1.0], [1.0, -kept], white, axis=0)
        samples = samples.with_columns(
            roll_deg=samples.roll_deg + wrong[:, 0], pitch_deg=samples.pitch_deg + wrong[:, 1]
        )
    return made, samples


@pytest.mark.parametrize("channels", [("magnitude", "dip"), ("magnitude", "dip", "azimuth")])
def test_a_known_field_is_linear_in_what_starts_a_fit_with_it(channels: tuple[str, ...]) -> None:
    """Without noise nothing is left at the start, be it by the whole field or by its vertical part;
    where the field never turns there is none."""
    made = simulate("tumble", n=3000, noise=0.0)
    current = 10.0 * np.sin(np.arange(3000) / 300.0) ** 2
    samples = made.samples.with_columns(
        field=made.samples.field + np.outer(current, STRAY), disturbers={"motor1_A": current}
    )
    settings = Settings(sources=("motor1_A",))
    reference = ag.Reference.vector(made.field_n, frame="n")
    problem, scale = normalise(samples, reference, channels, "free", settings)
    start = fit_at_once(problem, robust=True)
    assert start is not None
    for channel in channels:
        assert np.abs(compute_residuals(problem, channel, start) * scale.size).max() < 1e-3
    level = problem._replace(dip=problem.dip._replace(down=np.tile([0.0, 0.0, 1.0], (3000, 1))))
    assert fit_at_once(level, robust=True) is None


def error_deg(samples: ag.Samples, field: np.ndarray, declination_deg: float = 0.0) -> np.ndarray:
    """The heading by the field less the logged one."""
    down = down_b(samples.roll_deg, samples.pitch_deg)
    heading = heading_by_vectors_deg(field, down) + declination_deg
    return (heading - samples.heading_deg + 180.0) % 360.0 - 180.0


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.slow
def test_another_flight_keeps_its_heading_within_the_stated_error() -> None:
    """Bank ±27°, one magnetometer, 20 nT noise, full matrix and bias."""
    errors, stated = [], []
    for seed in range(8):
        made, samples = flown(seed, noise=20.0, tilt_sd_deg=0.3)
        fit = fit_levelled(samples, PLACE, gauge="symmetric")
        other, _ = flown(seed + 500, noise=0.0, calibration=made.truth)
        field = fit.calibration.correct(other.samples.field)
        errors.append(rms(error_deg(other.samples, field)))
        spread = fit.calibration.uncertainty(other.samples.field)
        down = down_b(other.samples.roll_deg, other.samples.pitch_deg)
        east = np.cross(down, field)
        size = np.linalg.norm(east, axis=1)
        east /= size[:, None]
        variance = np.einsum("ni,nij,nj->n", east, spread, east)
        stated.append(float(np.degrees(np.sqrt(np.mean(variance / size**2)))))
    assert max(errors) < 0.3
    assert rms(np.array(errors)) < 1.1 * rms(np.array(stated)) * 1.25  # eight flights scatter so


def draws(kind: str, k: int, **settings: Any) -> np.ndarray:
    """Errors over standard errors of `k` flights, (k, m)."""
    z = []
    for seed in range(k):
        stray = STRAY if kind == "interference" else (0.0, 0.0, 0.0)
        made, samples = flown(seed, stray=stray, n=2000, noise=100.0, **settings)
        if kind == "vector":
            fit = fit_vector(samples, ag.Reference.vector(made.field_n, frame="n"))
        elif kind == "levelled":
            fit = fit_levelled(samples, PLACE)
        else:
            fit = fit_interference(samples, PLACE)
        found, truth = fit.calibration, made.truth
        error = np.concatenate(
            [found.bias - truth.bias, pack_symmetric(found.matrix - truth.matrix)]
        )
        sd = fit.sd[:9]
        if kind == "interference":
            slope = np.linalg.solve(truth.matrix, STRAY)
            error = np.append(error, found.coefficients[:, 0] - slope)
            sd = np.append(sd, fit.sd[-3:])
        z.append(error / sd)
    return np.array(z)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "tilt_sd_deg"),
    [("levelled", 0.0), ("levelled", 0.5), ("vector", 0.5), ("interference", 0.0)],
)
def test_error_over_sd_is_standard_normal(kind: str, tilt_sd_deg: float) -> None:
    z = draws(kind, 30, tilt_sd_deg=tilt_sd_deg)
    # nine or twelve correlated numbers of 30 flights scatter as some 100: 0.07
    assert rms(z) == pytest.approx(1.0, abs=0.2)
    assert np.abs(z.mean(axis=0)).max() < 4 / np.sqrt(30)


def test_a_turn_of_the_sensor_is_found_where_it_is_and_only_there() -> None:
    _, samples = flown(1)
    straight = fit_levelled(samples, PLACE)
    assert "misaligned by" not in straight.status
    assert straight.coverage.heading_sd_deg < 0.5
    turn = Rotation.from_euler("yx", [3.0, 2.0], degrees=True)
    turned = samples.with_columns(field=samples.field @ turn.as_matrix().T)
    fit = fit_levelled(turned, PLACE)
    assert fit.calibration.gauge == "free"
    assert "misaligned by" in fit.status
    assert len(fit.sd) == 12
    assert rms(error_deg(turned, fit.calibration.correct(turned.field))) < 1.0


def test_a_mix_of_two_sensors_cancels_what_the_current_does_to_both() -> None:
    made, samples = flown(2, stray=STRAY, n=4000)
    rng = np.random.default_rng(3)
    opposite = made.field_b - np.outer(samples.current_A, STRAY)
    second = opposite @ np.diag([1.05, 0.95, 1.1]) + [900.0, -300.0, 4000.0]
    both = samples.with_columns(second=second + 200.0 * rng.normal(size=second.shape))
    plain = fit_levelled(samples, PLACE, gauge="symmetric")
    mix = fit_interference(both, PLACE, ["second"], gauge="symmetric")
    before = rms(error_deg(both, plain.calibration.correct(both.field)))
    after = rms(error_deg(both, ag.apply(mix.calibration, both).field))
    assert after < 0.5 * before
    assert [f.name for f in mix.findings if f.name == "placement"] == ["placement"]
    assert "opposite ways" in mix.status


def test_the_magnitude_alone_finds_a_current_too() -> None:
    rng = np.random.default_rng(4)
    made = simulate("tumble", n=4000, noise=50.0)
    current = rng.uniform(0.0, 30.0, 4000)
    field = made.samples.field + np.outer(current, [40.0, -20.0, 10.0])
    samples = made.samples.with_columns(field=field, current_A=current, roll_deg=None)
    fit = fit_interference(samples, ag.Reference.constant(50_000.0))
    assert fit.calibration.coefficients[:, 0] == pytest.approx([40.0, -20.0, 10.0], abs=2.0)
    assert fit.ok


@pytest.mark.parametrize(
    ("changed", "reference", "error", "words"),
    [
        ({"roll_deg": None}, PLACE, ag.LogError, "no roll"),
        ({}, ag.Reference.constant(50_000.0), ag.UnitError, "--at"),
        ({"current_A": None}, PLACE, ag.LogError, "no current_A"),
        ({"current_A": np.full(3000, 7.0)}, PLACE, ag.CoverageError, "never changes"),
        ({"field": np.ones((3000, 3))}, PLACE, ag.CoverageError, "never change"),
    ],
)
def test_what_is_missing_is_named(changed, reference, error, words) -> None:
    samples = flown(0)[1].with_columns(**changed)
    with pytest.raises(error, match=words):
        fit_levelled(samples, reference, sources=("current_A",))


def test_settings_that_make_no_sense_are_refused() -> None:
    samples = flown(0)[1]
    with pytest.raises(ag.AgonicError, match="gauge"):
        fit_levelled(samples, PLACE, gauge="tight")
    with pytest.raises(ag.AgonicError, match="above zero"):
        fit_levelled(samples, PLACE, turn_sd_deg=-1.0)
    spoilt = samples.with_columns(
        roll_deg=np.where(np.arange(len(samples)) < 5, samples.roll_deg, np.nan)
    )
    with pytest.raises(ag.CoverageError, match=r"left out: 2995 rows: NaN or infinite roll_deg"):
        fit_levelled(spoilt, PLACE)
    with pytest.raises(ag.CoverageError, match="too few"):
        fit_levelled(samples.select(np.arange(5)), PLACE)
    with pytest.raises(ag.AgonicError, match="frame='n'"):
        fit_vector(samples, PLACE)


@pytest.mark.slow
def test_a_sensor_mounted_by_another_right_angle_is_refused_with_the_mounting() -> None:
    samples = flown(5)[1]
    mounted = samples.with_columns(field=samples.field[:, [1, 0, 2]] * [1.0, -1.0, 1.0])
    fit = fit_levelled(mounted, PLACE)
    assert fit.verdict == "refused"
    assert fit.findings[0].name == "mounting"
    assert "x points left, y forward, z down" in fit.status or "x points right" in fit.status


def test_a_flight_without_turns_is_told_to_turn() -> None:
    made = simulate("circle", n=1500, tilt_deg=2.0, period_s=600.0, noise=300.0)
    samples = made.samples
    fit = fit_levelled(samples.select(samples.time < 20.0), PLACE, soft_iron_sd=None)
    assert fit.verdict == "refused"
    assert "turn through all headings" in fit.status


# ---- a quadrotor: what its log gives, scored against the logged yaw --------------------------


@pytest.fixture(scope="module")
def quadrotor(recordings) -> dict[str, ag.Samples]:
    log = ag.open_log(recordings / "vehicle" / "ardupilot" / "log171.bin")
    return {s.name: s.select((s.time >= 84.0) & (s.time <= 236.0)) for s in log.sensors}


def held_out(samples: ag.Samples, fit, **settings) -> np.ndarray:
    """Heading errors of alternate 8 s blocks by the fit to the others, and the declination."""
    expected = field_along(samples)
    north, east, _ = np.atleast_2d(expected.reference.values).mean(axis=0)
    block = ((samples.time - samples.time[0]) // 8).astype(int) % 2 == 0
    errors = []
    for rows in (block, ~block):
        found = fit(samples.select(rows), expected.reference.select(rows), **settings)
        rest = samples.select(~rows)
        field = ag.apply(found.calibration, rest).field
        errors.append(error_deg(rest, field, np.degrees(np.arctan2(east, north))))
    return np.concatenate(errors)


@pytest.mark.recordings
def test_a_real_flight_is_put_right_without_its_yaw(quadrotor) -> None:
    samples = quadrotor["MAG2"]
    as_flown = (samples.field - samples.logged.bias) @ samples.logged.matrix.T
    assert 19.0 < rms(error_deg(samples, as_flown, 12.39)) < 24.0
    levelled = held_out(samples, fit_levelled, sources=("current_A",))
    assert rms(levelled) < 6.5  # measured 5.2
    pair = samples.with_second(quadrotor["MAG3"])
    mix = held_out(pair, fit_interference, sources=("second",))
    assert rms(mix) < 5.5  # measured 5.0


@pytest.mark.recordings
def test_the_placement_of_a_real_pair_is_told(quadrotor) -> None:
    pair = quadrotor["MAG2"].with_second(quadrotor["MAG3"])
    fit = fit_interference(pair, field_along(pair).reference, ["second"])
    told = next(f for f in fit.findings if f.name == "placement")
    assert "neither alike nor opposite" in told.what


def test_half_a_circle_flown_level_is_refused() -> None:
    """The standard error alone would pass it: what it states is what the prior says."""
    samples = flown(3, noise=50.0, n=12_000)[1]
    level = np.abs(samples.roll_deg) < 6.0
    half = samples.select(level & (np.abs(samples.heading_deg - 180.0) < 95.0))
    fit = fit_levelled(half, PLACE)
    (finding,) = [f for f in fit.findings if f.name == "coverage"]
    assert finding.severity == "refuse"
    assert "leave a gap of 1" in finding.what
    assert "turn through all headings" in finding.move
    whole = fit_levelled(samples.select(level), PLACE)
    assert "leave a gap" not in " ".join(f.what for f in whole.findings)


@pytest.mark.recordings
def test_a_log_carried_about_level_is_refused(recordings) -> None:
    samples = ag.read(recordings / "vehicle" / "ardupilot" / "center_0003.bin")
    result = ag.calibrate(samples, ag.wmm().along(samples))
    assert result.verdict == "refused"
    told = re.search(r"the headings leave a gap of (\d+)°", result.fit.status.lower())
    assert told
    assert 160 <= int(told[1]) <= 185
