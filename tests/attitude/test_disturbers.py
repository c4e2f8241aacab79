"""Which recorded disturbers join a fit: the ones that do, and not those that only seem to."""

from __future__ import annotations

import numpy as np
import pytest

import agonic as ag
from agonic.attitude.disturbers.choice import choose_sources, judge_disturbers, list_candidates
from agonic.attitude.problem import Settings
from agonic.simulation import simulate

PLACE = ag.Reference.horizontal_vertical(25_000.0, 43_301.27)
NOISE = 100.0


def flight(seed: int, n: int = 2000) -> ag.Samples:
    """A vehicle whose own current is switched off."""
    flown = simulate("flight", n=n, noise=NOISE, stray_nT_A=(0.0, 0.0, 0.0), seed=seed)
    return flown.samples.with_columns(current_A=None, throttle=None)


def duties(seed: int, n: int = 2000, *, alike: bool = False) -> dict[str, np.ndarray]:
    """Four motors that share the throttle and differ by what steers, all smooth over a second."""
    rng = np.random.default_rng(seed)
    smooth = np.stack(
        [np.convolve(row, np.ones(20) / 20**0.5, "same") for row in rng.normal(size=(5, n))]
    )
    own = 0.0 if alike else 0.08
    return {
        f"motor{k + 1}_duty": np.clip(0.5 + 0.08 * smooth[4] + own * smooth[k], 0.05, 1.0)
        for k in range(4)
    }


def test_motors_are_found_each_for_itself() -> None:
    """Coefficients of four motors: error over standard error as it should be."""
    rng = np.random.default_rng(0)
    ratios = []
    for seed in range(4):
        added = rng.normal(0.0, 6000.0, (3, 4))
        columns = duties(seed)
        x = np.stack([columns[name] ** 1.5 for name in columns], axis=1)
        quiet = flight(seed)
        samples = quiet.with_columns(field=quiet.field + x @ added.T, disturbers=columns)
        choice = choose_sources(samples, PLACE, Settings())
        assert choice.sources == tuple(f"motor{k}_duty^1.5" for k in (1, 2, 3, 4))
        assert 0.5 < choice.gain < 1.0
        fit = ag.fit_levelled(samples, PLACE, sources=choice.sources)
        assert fit.calibration.needs == tuple(columns)
        errors = (fit.calibration.coefficients - added).ravel()
        ratios.append(errors / fit.sd[-12:])
        np.testing.assert_allclose(fit.calibration.typical, x.mean(axis=0), rtol=0.1)
    ratio = np.concatenate(ratios)
    assert abs(ratio.mean()) < 0.4
    assert 0.8 < ratio.std() < 1.2


def test_a_flight_after_minutes_on_the_ground_is_judged_in_flight() -> None:
    """The current is that of what was seen from all directions, and the heading's error there."""
    rng, quiet = np.random.default_rng(0), flight(0, n=1500)
    rows = np.r_[np.zeros(3000, dtype=int), np.arange(1500)]
    current = np.r_[np.zeros(3000), 20.0 + rng.normal(size=1500)]
    noise = rng.normal(0.0, NOISE, (4500, 3)) * (rows == 0)[:, None]
    samples = ag.Samples(
        time=np.arange(4500) / 10,
        field=quiet.field[rows] + np.outer(current, (300.0, -200.0, 100.0)) + noise,
        unit="nT",
        roll_deg=quiet.roll_deg[rows],
        pitch_deg=quiet.pitch_deg[rows],
        current_A=current,
    )
    fit = ag.fit_levelled(samples, PLACE, sources=("current_A",))
    assert fit.calibration.typical[0] > 17.0
    alone = ag.fit_levelled(samples.select(np.arange(3000, 4500)), PLACE, sources=("current_A",))
    assert fit.coverage.heading_sd_deg < 2.0 * alone.coverage.heading_sd_deg


def test_what_only_goes_with_the_attitude_is_not_taken() -> None:
    """Throttle in a climb and current against the wind: they follow pitch and heading only."""
    taken = 0
    for seed in range(8):
        quiet = flight(seed)
        rng = np.random.default_rng(seed)
        wind = np.cos(np.radians(quiet.heading_deg))
        columns = {
            "motor1_duty": 0.5 + 0.02 * quiet.pitch_deg + 0.01 * rng.normal(size=len(quiet)),
            "esc1_A": 12.0 + 4.0 * wind + 0.2 * rng.normal(size=len(quiet)),
        }
        samples = quiet.with_columns(disturbers=columns)
        taken += bool(choose_sources(samples, PLACE, Settings()).sources)
    assert taken == 0


def test_a_disturber_beside_one_that_goes_with_the_attitude_keeps_its_own() -> None:
    """The heater has a field, the throttle follows pitch: only the heater is taken."""
    quiet = flight(3)
    rng = np.random.default_rng(3)
    heater = np.repeat(rng.integers(0, 2, len(quiet) // 50), 50) * 2.0
    columns = {
        "motor1_duty": 0.5 + 0.02 * quiet.pitch_deg + 0.01 * rng.normal(size=len(quiet)),
        "heater_A": heater,
    }
    field = quiet.field + heater[:, None] * np.array([300.0, -200.0, 400.0])
    samples = quiet.with_columns(field=field, disturbers=columns)
    choice = choose_sources(samples, PLACE, Settings())
    assert choice.sources == ("heater_A",)
    fit = ag.fit_levelled(samples, PLACE, sources=choice.sources)
    z = (fit.calibration.coefficients[:, 0] - [300.0, -200.0, 400.0]) / fit.sd[-3:]
    assert np.abs(z).max() < 3.5


def test_columns_that_always_move_together_are_tried_as_their_sum_only() -> None:
    samples = flight(0).with_columns(disturbers=duties(0, alike=True))
    together = "motor1_duty+motor2_duty+motor3_duty+motor4_duty"
    assert list_candidates(samples) == [(f"{together}^1.5",), (together,)]


def test_calibrate_takes_what_disturbs_and_says_so() -> None:
    columns = duties(1)
    x = np.stack([columns[name] ** 1.5 for name in columns], axis=1)
    quiet = flight(1)
    added = np.array([[9e3, 0, 0, -4e3], [0, 7e3, 2e3, 0], [-3e3, 0, 8e3, 5e3]])
    samples = quiet.with_columns(field=quiet.field + x @ added.T, disturbers=columns)
    result = ag.calibrate(samples, PLACE)
    assert result.fit.verdict == "good"
    assert result.fit.calibration.needs == tuple(columns)
    assert "motor1…4_duty^1.5 move the readings" in result.reason
    (said,) = [one for one in result.fit.findings if one.name == "disturbers"]
    assert "variance of held-out residuals by" in said.what


def test_readings_of_few_levels_beside_a_current_end_in_a_verdict() -> None:
    """Steps as large as the field leave singular sums, not a traceback."""
    quiet = flight(1)
    coarse = quiet.with_columns(
        field=np.round(quiet.field / 70_000.0) * 70_000.0, disturbers=duties(1)
    )
    assert ag.calibrate(coarse, PLACE).verdict == "refused"


@pytest.mark.parametrize("source", ["motor1_duty^", "^2", "a b", "second^2", "x^9", "heater_A>"])
def test_a_source_that_is_none_is_refused(source: str) -> None:
    samples = flight(0, 300)
    with pytest.raises(ag.AgonicError, match=r"source|vector"):
        ag.fit_levelled(samples, PLACE, sources=(source,))


def test_a_recording_tells_which_disturbers_it_can_tell_apart() -> None:
    """Expected standard errors are those of the fit; what moves together is named."""
    quiet = flight(2)
    judged = judge_disturbers(quiet.with_columns(disturbers=duties(2)), noise=NOISE)
    assert [one.move for one in judged] == [""] * 4
    columns = duties(2)
    fit = ag.fit_levelled(
        quiet.with_columns(disturbers=columns),
        PLACE,
        sources=tuple(f"{name}^1.5" for name in columns),
    )
    stated = fit.sd[-12:].reshape(3, 4).mean(axis=0)
    expected = np.array([one.sd for one in judged])
    np.testing.assert_allclose(expected, stated, rtol=0.5)
    alike = judge_disturbers(quiet.with_columns(disturbers=duties(2, alike=True)))
    assert all("motor" in one.move and len(one.along) == 3 for one in alike)
    follows = {"heater_A": 2.0 + np.sin(np.radians(quiet.pitch_deg))}
    (one,) = judge_disturbers(quiet.with_columns(disturbers=follows))
    assert one.attitude > 0.99
    assert "only followed the attitude" in one.move
    with pytest.raises(ag.LogError, match="nothing that could disturb changes"):
        judge_disturbers(quiet)


@pytest.mark.slow
def test_heater_and_torquers_of_a_satellite_are_found_by_the_magnitude_alone() -> None:
    """No attitude: what an ampere and an A m² add is told by the steadiness of the magnitude."""
    z = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        quiet = simulate("tumble", n=3000, noise=NOISE, seed=seed).samples.with_columns(
            roll_deg=None, pitch_deg=None, heading_deg=None, acceleration=None, rotation_rate=None
        )
        columns = {"heater_A": np.repeat(rng.integers(0, 2, 60), 50) * 2.0}
        columns |= {f"torquer_{a}_Am2": np.repeat(rng.uniform(-1, 1, 100), 30) for a in "xyz"}
        added = rng.normal(0.0, 700.0, (3, 4))
        field = quiet.field + np.stack([*columns.values()], axis=1) @ added.T
        samples = quiet.with_columns(field=field, disturbers=columns)
        result = ag.calibrate(samples, ag.Reference.constant(50_000.0))
        assert (result.verdict, result.method) == ("good", "interference")
        assert set(result.fit.calibration.needs) == set(columns)
        order = [list(columns).index(name) for name in result.fit.calibration.needs]
        errors = result.fit.calibration.coefficients - added[:, order]
        z.append(errors.ravel() / result.fit.sd[9:])
    ratio = np.concatenate(z)
    assert abs(ratio.mean()) < 0.4
    assert 0.75 < ratio.std() < 1.25
