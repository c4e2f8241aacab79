"""`fit_coil` against simulated truth, the plain formula and the error that it states."""

from dataclasses import replace
from datetime import UTC, datetime

import erfa
import numpy as np
import pytest

from agonic.alignment.coil.fit import fit_coil
from agonic.alignment.session.earth import load_earth_rotation
from agonic.alignment.simulation.laboratory import simulate_coil
from agonic.errors import AgonicError, CoverageError
from agonic.maths.rotations.angles import angle_deg
from agonic.maths.rotations.frames import rot_en


def pulled(error, covariance) -> float:
    """errorᵀ C⁺ error of a direction, whose covariance has rank two."""
    return float(error @ np.linalg.pinv(covariance, rcond=1e-6) @ error)


@pytest.mark.slow
def test_the_axis_is_known_to_an_arcsecond_and_says_so() -> None:
    """0.5 nT, 20 µT, 100 reversals with one reading between them."""
    errors, q, z = [], [], []
    for seed in range(120):
        made = simulate_coil(readings=1, seed=seed)
        fit = fit_coil(made.session)
        truth = made.vector / np.linalg.norm(made.vector)
        errors.append(3600 * float(angle_deg(fit.axis, truth)))
        q.append(pulled(fit.axis - truth, fit.directions["m"].covariance))
        z.append((fit.constant - 40_000) / fit.constant_sd)
    assert np.sqrt(np.mean(np.square(errors))) < 1.0
    assert np.mean(q) == pytest.approx(2.0, abs=0.5)  # χ² of two
    assert abs(np.mean(z)) < 0.3
    assert np.std(z) == pytest.approx(1.0, abs=0.2)


@pytest.mark.slow
def test_the_whole_chain_is_honest() -> None:
    q = {"b": [], "n": []}
    z = []
    for seed in range(80):
        made = simulate_coil(seed=seed)
        fit = fit_coil(made.session)
        n = fit.directions["n"]
        q["n"].append(pulled(n.axis - made.axis_n, n.covariance))
        z.append(3600 * (fit.geometric_deg - made.geometric_deg) / fit.geometric_sd_arcsec)
        assert 1.5 < n.sd_arcsec < 3.0
    assert np.mean(q["n"]) == pytest.approx(2.0, abs=0.5)
    assert np.std(z) == pytest.approx(1.0, abs=0.2)


def test_axes_in_earth_fixed_and_inertial_frames() -> None:
    made = simulate_coil()
    fit = fit_coil(made.session)
    site = made.session.site
    e, i = fit.directions["e"], fit.directions["i"]
    np.testing.assert_allclose(
        e.axis, rot_en(site.latitude_deg, site.longitude_deg) @ fit.directions["n"].axis, atol=1e-15
    )
    # the whole chain of the IAU in one call of ERFA
    ut1_tai, x, y = (float(v[0]) for v in load_earth_rotation().at(fit.time))
    tai = fit.time + 37.0
    rot_ei = erfa.c2t06a(
        2_440_587.5, (tai + 32.184) / 86_400, 2_440_587.5, (tai + ut1_tai) / 86_400, x, y
    )
    np.testing.assert_allclose(i.axis, rot_ei.T @ e.axis, atol=1e-9)
    assert i.sd_arcsec == pytest.approx(fit.directions["n"].sd_arcsec)
    azimuth, elevation = fit.directions["n"].angles_deg
    down = -np.sin(np.radians(elevation))
    np.testing.assert_allclose(fit.directions["n"].axis[2], down, atol=1e-12)
    assert 0 <= azimuth < 360


def test_reversal_cancels_bias_ambient_and_drift() -> None:
    """Without noise (B₊ − B₋)/2I is the vector; drift is taken out by the reference."""
    made = simulate_coil(noise=0.0, reference_noise=0.0, reversals=40, seed=4)
    alone = replace(made.session, attitude=None, alignment=None, geometric_axis=None)
    fit = fit_coil(alone)
    np.testing.assert_allclose(fit.estimate.linear, made.vector, atol=2e-3)
    current, field = fit.current, fit.stretches.field
    by_hand = np.diff(field, axis=0) / np.diff(current)[:, None]
    assert np.abs(by_hand.mean(axis=0) - made.vector).max() < 1.0  # the drift is still in it
    known = fit_coil(replace(made.session, geometric_axis=None))
    np.testing.assert_allclose(known.estimate.linear, made.vector, atol=2e-3)
    # bias and ambient a thousand times larger change nothing
    shifted = made.session.magnetometer.with_columns(field=made.session.magnetometer.field + 3e4)
    moved = fit_coil(replace(alone, magnetometer=shifted))
    np.testing.assert_allclose(moved.estimate.linear, fit.estimate.linear, atol=1e-6)


def test_the_reference_takes_drift_out_that_nothing_else_can() -> None:
    """The ambient steps to and fro nearly in time with the current."""
    made = simulate_coil(reversals=60, seed=1)
    session = made.session
    n = len(session.magnetometer)
    wave = 60 * np.sin(2 * np.pi * np.arange(n) / 10.7)  # a period is 10 s
    ambient = np.outer(wave, [1.0, -0.5, 2.0])
    rot_mn = session.alignment.rotation.as_matrix().T @ session.attitude.rot_pn
    rough = replace(
        session,
        magnetometer=session.magnetometer.with_columns(
            field=session.magnetometer.field + ambient @ rot_mn.T
        ),
        reference=session.reference.with_columns(field=session.reference.field + ambient),
    )
    truth = made.vector / np.linalg.norm(made.vector)
    with_reference = fit_coil(rough)
    without = fit_coil(replace(rough, reference=None))
    assert 3600 * angle_deg(with_reference.axis, truth) < 4 * with_reference.axis_sd_arcsec
    assert with_reference.axis_sd_arcsec < 1.0
    assert without.axis_sd_arcsec > 5 * with_reference.axis_sd_arcsec
    assert "no reference" in {f.name for f in without.findings}


def test_linearity_over_several_currents() -> None:
    made = simulate_coil(levels=(1.0, 0.5, 0.25), reversals=120, seed=2)
    fit = fit_coil(made.session)
    assert [round(level.current_A, 3) for level in fit.levels] == [0.125, 0.25, 0.5]
    assert fit.p_linear > 1e-3
    assert all(abs(level.departure) < 4 * level.sd for level in fit.levels)
    assert fit.ok
    # a shunt that reads 1 % wrong at the smallest current
    current = made.session.magnetometer.current_A.copy()
    current[np.abs(current) < 0.2] *= 0.99
    bent = replace(
        made.session, magnetometer=made.session.magnetometer.with_columns(current_A=current)
    )
    crooked = fit_coil(bent)
    assert crooked.verdict == "check"
    assert crooked.findings[0].name == "nonlinear"
    smallest = crooked.levels[0]
    assert 1e6 * smallest.departure / crooked.constant == pytest.approx(10_000, rel=0.1)


@pytest.mark.slow
def test_linear_currents_are_hardly_ever_called_nonlinear() -> None:
    p = [
        fit_coil(
            simulate_coil(levels=(1.0, 0.5), reversals=40, readings=2, seed=seed).session
        ).p_linear
        for seed in range(80)
    ]
    assert 0.3 < np.mean(p) < 0.7
    assert np.min(p) > 1e-4


def test_what_does_not_reverse_is_named_and_spoils_nothing() -> None:
    made = simulate_coil(levels=(1.0, 0.5), even=8.0, seed=5)
    fit = fit_coil(made.session)
    assert [f.name for f in fit.findings] == ["even in the current"]
    # 8 nT on each axis at 0.5 A
    np.testing.assert_allclose(fit.estimate.even * 0.25, 8.0, atol=0.5)
    truth = made.vector / np.linalg.norm(made.vector)
    assert 3600 * angle_deg(fit.axis, truth) < 4 * fit.axis_sd_arcsec


def test_settling_readings_are_left_out() -> None:
    made = simulate_coil(readings=6, seed=7)
    samples = made.session.magnetometer
    late = samples.field.copy()
    first = np.arange(len(samples)) % 6 == 0
    late[first] -= 0.1 * samples.current_A[first, None] * made.vector
    session = replace(made.session, magnetometer=samples.with_columns(field=late))
    spoilt, mended = fit_coil(session), fit_coil(replace(session, settle_s=1.5))
    assert abs(mended.constant - 40_000) < 4 * mended.constant_sd
    assert spoilt.constant / 40_000 == pytest.approx(1 - 0.1 / 6, abs=1e-4)


def test_a_field_that_has_not_settled_is_refused_and_named() -> None:
    """The coil follows its current with 1 s, a reading a second: the constant is 23 % too small."""
    made = simulate_coil(readings=5, seed=3)
    samples = made.session.magnetometer
    current, flowing = samples.current_A, np.array(samples.current_A)
    kept = np.exp(-1.0)
    for row in range(1, len(flowing)):
        flowing[row] = current[row - 1] + (flowing[row - 1] - current[row - 1]) * kept
    late = samples.field + (flowing - current)[:, None] * made.vector
    session = replace(made.session, magnetometer=samples.with_columns(field=late))
    fit = fit_coil(session)
    assert abs(fit.constant / 40_000 - 1) > 0.1
    assert fit.verdict == "refused"
    assert "settle_s" in fit.status
    assert "coil not settled" not in {f.name for f in fit_coil(made.session).findings}


def test_the_currents_own_scale_is_in_the_constant() -> None:
    made = simulate_coil(seed=1)
    fit = fit_coil(replace(made.session, current_sd=1e-4))
    assert fit.constant_sd == pytest.approx(4.0, rel=0.01)
    assert fit.axis_sd_arcsec == fit_coil(made.session).axis_sd_arcsec


def test_inertial_axes_need_a_date_that_the_earths_rotation_is_known_for() -> None:
    session = simulate_coil(reversals=10, begins=datetime(2150, 1, 1, tzinfo=UTC)).session
    fit = fit_coil(session)
    assert set(fit.directions) == {"m", "b", "n", "e"}
    assert [f.name for f in fit.findings] == ["no inertial axis"]
    geodetic = replace(session, site=replace(session.site, coordinates="geodetic"))
    assert "geodetic coordinates" in {f.name for f in fit_coil(geodetic).findings}


def test_sessions_that_cannot_be() -> None:
    made = simulate_coil(reversals=6)
    session = made.session
    with pytest.raises(AgonicError, match="no alignment leads there"):
        replace(session, alignment=None)
    with pytest.raises(AgonicError, match="column current_A"):
        replace(session, magnetometer=session.magnetometer.with_columns(current_A=None))
    with pytest.raises(CoverageError, match="3 stretches"):
        fit_coil(simulate_coil(reversals=2).session)
    positive = session.magnetometer.with_columns(current_A=session.magnetometer.current_A + 1.0)
    fit = fit_coil(replace(session, magnetometer=positive))
    assert "one polarity" in {f.name for f in fit.findings}


def spoilt(session, how: str):
    """A mistake that leaves no residual, or hardly one."""
    samples, reference = session.magnetometer, session.reference
    current = samples.current_A
    coil = np.outer(current, [0.0, 0.0, 40_000.0])
    warm = 1 + 0.01 * (1 - np.exp(-samples.time / 120))
    changed = {
        "axis not as drawn": {"magnetometer": samples.with_columns(current_A=-current)},
        "large current": {"magnetometer": samples.with_columns(current_A=1000 * current)},
        "coil in the reference": {
            "reference": reference.with_columns(field=reference.field + 0.01 * coil)
        },
        "ambient field differs": {"magnetometer": samples.with_columns(field=1.01 * samples.field)},
        "constant drifts": {"magnetometer": samples.with_columns(current_A=current / warm)},
    }
    return replace(session, **changed[how])


@pytest.mark.parametrize(
    "how",
    [
        "axis not as drawn",
        "large current",
        "coil in the reference",
        "ambient field differs",
        "constant drifts",
    ],
)
def test_a_mistake_that_leaves_no_residual_is_told(how: str) -> None:
    assert how in {found.name for found in fit_coil(spoilt(simulate_coil().session, how)).findings}


@pytest.mark.slow
def test_no_such_mistake_is_made_up() -> None:
    """Nor where the ambient field is stormy: what the reference sees, it sees of that."""
    rng = np.random.default_rng(3)
    for seed in range(20):
        made = simulate_coil(seed=seed)
        assert fit_coil(made.session).verdict == "good"
        session = made.session
        storm = np.cumsum(3 * rng.standard_normal(session.reference.field.shape), axis=0)
        onto_m = session.alignment.rotation.as_matrix().T @ session.attitude.rot_pn
        parts = {"reference": storm, "magnetometer": storm @ onto_m.T}
        windy = {
            name: (own := getattr(session, name)).with_columns(field=own.field + added)
            for name, added in parts.items()
        }
        assert fit_coil(replace(session, **windy)).verdict == "good"
