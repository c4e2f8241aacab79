"""The shape of a source: power, delay and time constant, found with their standard errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.attitude.disturbers.choice import choose_sources
from agonic.attitude.problem import Settings
from agonic.calibration.sources import parse_source
from agonic.calibration.timing import follow
from tests.attitude.test_disturbers import PLACE, duties, flight


@pytest.mark.slow
@pytest.mark.parametrize("late", [0.15, -0.1])
def test_how_late_a_source_is_recorded_is_found_and_undone(late: float) -> None:
    quiet, true = flight(1), duties(1)
    added = np.random.default_rng(1).normal(0.0, 5000.0, (3, 4))
    x = np.stack([duty**1.5 for duty in true.values()], axis=1)
    logged = {name: np.interp(quiet.time - late, quiet.time, duty) for name, duty in true.items()}
    samples = quiet.with_columns(field=quiet.field + x @ added.T, disturbers=logged)
    sources = choose_sources(samples, PLACE, Settings()).sources
    assert [parse_source(one).late_s for one in sources] == pytest.approx([late] * 4, abs=0.02)
    fit = ag.fit_levelled(samples, PLACE, sources=sources)
    assert {name: one.late_s for name, one in fit.calibration.timing.items()} == {
        name: parse_source(sources[0]).late_s for name in logged
    }
    corrected = ag.apply(fit.calibration, samples).field
    alone = ag.fit_levelled(samples, PLACE, sources=[one.split("@")[0] for one in sources])
    spread = [
        np.linalg.norm(c, axis=1).std()
        for c in (corrected, alone.calibration.correct(samples.field, **samples.disturbers))
    ]
    assert spread[0] < 0.6 * spread[1]
    with pytest.raises(ag.AgonicError, match="two delays"):
        ag.fit_levelled(samples, PLACE, sources=("motor1_duty@0.1", "motor1_duty^2"))


@pytest.mark.slow
@pytest.mark.parametrize("constant", [0.3, -0.8])
def test_the_time_constant_of_a_filter_is_found_with_its_standard_error(constant: float) -> None:
    """A current behind a filtered sensor, and a torquer whose field follows its command."""
    z = []
    for seed in range(1, 6):
        quiet, added = flight(seed), np.array([300.0, -200.0, 400.0])
        steps = np.repeat(np.random.default_rng(seed).uniform(0.0, 10.0, 200), 10)
        filtered = follow(quiet.time, steps, abs(constant))
        logged, acting = (filtered, steps) if constant > 0 else (steps, filtered)
        samples = quiet.with_columns(
            field=quiet.field + acting[:, None] * added, disturbers={"heater_A": logged}
        )
        choice = choose_sources(samples, PLACE, Settings())
        (found,) = choice.shapes
        assert found.what == "time constant"
        assert parse_source(choice.sources[0]).time_constant_s == pytest.approx(found.value, 1e-3)
        z.append((found.value - constant) / found.sd)
    assert np.abs(z).max() < 3.5
    assert np.sqrt(np.mean(np.square(z))) > 0.4
    fit = ag.fit_levelled(samples, PLACE, sources=choice.sources)
    np.testing.assert_allclose(
        fit.calibration.coefficients[:, 0], added, atol=4 * fit.sd[-3:].max()
    )


@pytest.mark.slow
def test_the_power_of_a_duty_is_found_where_it_is_another() -> None:
    columns, quiet = duties(4), flight(4)
    added = np.random.default_rng(4).normal(0.0, 9000.0, (3, 4))
    x = np.stack([duty**2.4 for duty in columns.values()], axis=1)
    samples = quiet.with_columns(field=quiet.field + x @ added.T, disturbers=columns)
    result = ag.calibrate(samples, PLACE)
    (found,) = result.disturbers.shapes
    assert found.what == "power"
    assert abs(found.value - 2.4) < 4 * found.sd < 0.6
    (said,) = [one for one in result.fit.findings if one.name == "disturbers"]
    assert "motor1…4_duty enters to the power 2." in said.what


def test_how_well_a_time_constant_is_known_is_kept_in_the_file(tmp_path: Path) -> None:
    quiet = flight(2)
    steps = np.repeat(np.random.default_rng(2).uniform(0.0, 10.0, 200), 10)
    logged = follow(quiet.time, steps, 0.4)
    samples = quiet.with_columns(
        field=quiet.field + steps[:, None] * [300.0, -200.0, 400.0], disturbers={"heater_A": logged}
    )
    made = ag.calibrate(samples, PLACE).calibration
    again = ag.load(ag.save(made, tmp_path / "mag.json"))
    assert again.sources == made.sources
    assert again.timing_sd_s == made.timing_sd_s
    assert 0.0 < again.timing_sd_s["heater_A"] < 0.05
    np.testing.assert_array_equal(ag.apply(again, samples).field, ag.apply(made, samples).field)


def test_what_moves_with_a_disturber_is_told_and_not_taken_too() -> None:
    """A throttle that makes the current: one stands for both."""
    quiet = flight(5)
    current = np.repeat(np.random.default_rng(5).uniform(0.0, 10.0, 100), 20)
    samples = quiet.with_columns(
        field=quiet.field + current[:, None] * [300.0, -200.0, 400.0],
        current_A=current,
        throttle=(current / 10.0) ** (2 / 3),
    )
    result = ag.calibrate(samples, PLACE)
    assert len(result.calibration.needs) == 1
    (said,) = [one for one in result.fit.findings if one.name == "disturbers"]
    assert "changed together with it and cannot be separated from it" in said.what
