"""The platform's own field, from turning it beneath a magnetometer that stands still."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from agonic.alignment import error_budget, fit_alignment, read_session, simulate_session
from agonic.alignment.files.sessions import write_session
from agonic.alignment.remanence import fit_remanence
from agonic.alignment.simulation.session import simulate_remanence
from agonic.errors import LogError


def test_stated_errors_contain_the_error_over_many_turns() -> None:
    fits = [fit_remanence(simulate_remanence(remanence=20.0, seed=s)) for s in range(80)]
    scaled = np.array([(fit.size - 20.0) / fit.sd for fit in fits])
    assert abs(scaled.mean()) < 3 / np.sqrt(len(scaled))
    assert 0.8 < scaled.std() < 1.2


def test_a_clean_platform_is_not_blamed_and_iron_goes_round_twice() -> None:
    clean = [fit_remanence(simulate_remanence(noise=0.2, seed=seed)) for seed in range(40)]
    assert np.mean([fit.chance < 0.05 for fit in clean]) <= 0.15
    assert {fit.verdict for fit in clean} == {"good"}
    iron = fit_remanence(simulate_remanence(induced=5.0, seed=1))
    assert [finding.name for finding in iron.findings] == ["platform iron"]
    assert iron.induced == pytest.approx(5.0, abs=4 * iron.induced_sd)  # type: ignore[operator]


def test_a_drift_of_the_ambient_field_is_not_the_platforms() -> None:
    drifting = simulate_remanence(remanence=0.0, drift=80.0, noise=0.2, seed=4)
    assert drifting.epoch is not None
    assert drifting.time is not None
    assert fit_remanence(drifting).verdict == "good"
    turned = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    beside = drifting.with_columns(field=drifting.field @ turned.T + 100.0)
    magnetic = drifting.with_columns(
        field=drifting.field
        + 6.0 * np.sin(np.radians(drifting.heading_deg))[:, None] * [1.0, 0.0, 0.0]  # type: ignore[arg-type]
        + 6.0 * np.cos(np.radians(drifting.heading_deg))[:, None] * [0.0, 1.0, 0.0]  # type: ignore[arg-type]
    )
    fit = fit_remanence(magnetic, beside)
    assert fit.size == pytest.approx(6.0, abs=4 * fit.sd)


def test_an_ambient_field_that_swings_meanwhile_is_not_the_platforms() -> None:
    """Of 20 nT in the time of a turn: 50 standard errors from nothing, and the platform blamed."""
    z = []
    for seed in range(10):
        made = simulate_remanence(remanence=0.0, seed=seed)
        assert made.time is not None
        phase = np.random.default_rng(seed).uniform(0, 6)
        swing = np.sin(8.2 * made.time / made.time[-1] + phase)
        fit = fit_remanence(made.with_columns(field=made.field + np.outer(swing, [20, -20, 20])))
        z.append(fit.size / fit.sd)
        names = {finding.name for finding in fit.findings}
        assert names == {"remanence loose"}
    assert np.max(z) < 3.0


def test_half_a_circle_is_refused() -> None:
    turned = simulate_remanence(settings=12)
    assert turned.heading_deg is not None
    half = turned.select(np.flatnonzero(turned.heading_deg < 179))
    with pytest.raises(LogError, match="leave 210° of the circle empty"):
        fit_remanence(half)
    with pytest.raises(LogError, match="heading_deg"):
        fit_remanence(turned.with_columns(heading_deg=None))


@pytest.mark.slow
def test_an_alignment_names_the_platforms_field_and_its_budget_holds_it(tmp_path: Path) -> None:
    made = simulate_session(remanence=4.0, seed=2)
    write_session(made.session, tmp_path)
    session = read_session(tmp_path)
    fit = fit_alignment(session)
    assert "platform remanence" in [finding.name for finding in fit.findings]
    solved = fit_alignment(session, solve=("bias",))
    assert solved.verdict == "good"
    lines = {effect.name: effect for effect in error_budget(solved)}
    assert lines["remanence of the platform"].treatment == "solved for"
    assert lines["remanence of the platform"].size_arcsec == pytest.approx(18, abs=3)


def test_a_pier_is_corrected_only_where_its_difference_was_given() -> None:
    lines = {e.name: e for e in error_budget(fit_alignment(simulate_session(seed=1).session))}
    assert lines["difference between the piers"].treatment == "not known"
    given = simulate_session(pier=(3.0, -1.0, 4.0), seed=1).session
    lines = {e.name: e for e in error_budget(fit_alignment(given))}
    assert lines["difference between the piers"].treatment == "corrected"
    assert lines["remanence of the platform"].treatment == "not known"
