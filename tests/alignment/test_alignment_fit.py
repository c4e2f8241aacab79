"""The alignment with a star sensor: truth recovered, bounds met, mistakes found by name."""

from __future__ import annotations

from dataclasses import replace

import erfa
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.alignment.figures import draw_axes
from agonic.alignment.session.earth import load_earth_rotation
from agonic.alignment.session.observed import observe
from agonic.alignment.session.session import Pier
from agonic.alignment.simulation.session import SimulatedSession, simulate_session
from agonic.alignment.star_sensor.budget import error_budget
from agonic.alignment.star_sensor.fit import fit_alignment
from agonic.alignment.star_sensor.plan import plan_alignment
from agonic.alignment.star_sensor.result import AlignmentFit
from agonic.errors import AgonicError, CoverageError, UnitError, ValidityError
from agonic.maths.equation.symmetric import pack_symmetric
from agonic.maths.rotations.frames import ARCSEC_RAD, angles_323_deg, from_323_deg
from agonic.maths.rotations.vectors import skew
from tests.alignment.nights import MATRIX, at_other_times, names

FIELD = 49_509.0
QUIET = {"noise": 0.0, "reference_noise": 0.0, "across_sd_arcsec": 0.0, "about_sd_arcsec": 0.0}


def error_arcsec(fit: AlignmentFit, made: SimulatedSession) -> np.ndarray:
    """By how much the alignment is off, about the magnetometer's axes."""
    return Rotation.from_matrix(made.rot_mc @ fit.rot_mc.T).as_rotvec() / ARCSEC_RAD


# ---- the truth ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("truth", "solve"),
    [
        ({}, ("alignment",)),
        ({"pier": (40.0, -25.0, 12.0)}, ("pier",)),
        ({"bias": (120.0, -60.0, 15.0), "matrix": MATRIX}, ("bias", "matrix")),
        ({"bias": (9000.0, -7000.0, 3000.0)}, ("bias",)),
        ({"reference_turn_arcsec": (300.0, -200.0, 100.0)}, ("reference",)),
    ],
    ids=["alone", "pier", "bias and matrix", "large bias", "reference"],
)
def test_without_noise_the_truth_is_found(truth: dict, solve: tuple[str, ...]) -> None:
    """To 0.01″ and 1e-4 nT."""
    made = simulate_session(**QUIET, **truth, seed=2)
    made = replace(made, session=replace(made.session, pier=Pier()))
    fit = fit_alignment(made.session, solve=solve)
    found = fit.solution.unknowns
    assert np.abs(error_arcsec(fit, made)).max() < 0.01
    assert np.abs(found.bias - made.bias).max() < 1e-4
    assert np.abs(found.matrix - made.matrix).max() * FIELD < 1e-4
    assert np.abs(found.offset - made.offset).max() < 1e-4
    assert np.abs(fit.residuals).max() < 1e-4
    across = fit.reference_turn_arcsec - made.reference_turn / ARCSEC_RAD
    assert np.abs(across).max() < 0.01


def test_the_model_is_that_of_the_patent() -> None:
    """Eqs. 8 to 11 from elementary matrices, angle by angle, without any code of the fit."""
    made = simulate_session(**QUIET, seed=4, refraction="removed", aberration="removed")
    session, alpha = made.session, np.radians(angles_323_deg(made.rot_mc))
    earth = load_earth_rotation()
    for row in (0, 100, 333):
        a, b, c = np.radians(angles_323_deg(session.star.rot_ci[row]))
        cis_sim = erfa.rz(c, erfa.ry(b, erfa.rz(a, np.eye(3))))
        cis_cts = earth.rot_ei(session.star.time[row])[0]
        latitude, longitude = np.radians([52.0725, 12.6750])
        ref_cts = erfa.rz(-longitude, erfa.ry(np.pi / 2 + latitude, np.eye(3)))
        sim_csc = erfa.rz(alpha[2], erfa.ry(alpha[1], erfa.rz(alpha[0], np.eye(3))))
        clock = int(session.magnetometer.time[row])
        expected = sim_csc @ cis_sim @ cis_cts.T @ ref_cts @ session.reference.field[clock]
        np.testing.assert_allclose(session.magnetometer.field[row], expected, atol=1e-6)


@pytest.mark.parametrize("effect", ["refraction", "aberration"])
def test_starlight_is_straightened(effect: str) -> None:
    """A sensor that leaves the effect in and one that takes it out give the same alignment."""
    for treatment in ("present", "removed"):
        made = simulate_session(**QUIET, **{effect: treatment}, seed=3)
        assert np.abs(error_arcsec(fit_alignment(made.session), made)).max() < 0.01


def test_what_is_reported_is_one_rotation() -> None:
    made = simulate_session(seed=1)
    fit = fit_alignment(made.session)
    w, x, y, z = fit.quat_wxyz
    vector = np.array([0.3, -0.5, 0.8])
    np.testing.assert_allclose(Rotation.from_quat([x, y, z, w]).apply(vector), fit.rot_mc @ vector)
    np.testing.assert_allclose(from_323_deg(*fit.angles_deg), fit.rot_mc, atol=1e-12)
    field = fit.calibration.correct(made.session.magnetometer.field[:1])
    np.testing.assert_allclose(field[0], fit.rot_mc.T @ made.session.magnetometer.field[0])
    draws = np.random.default_rng(0).multivariate_normal(np.zeros(3), fit.covariance[:3, :3], 4000)
    turned = Rotation.from_rotvec(draws).as_matrix() @ fit.rot_mc
    away = (angles_323_deg(turned) - fit.angles_deg) * 3600
    np.testing.assert_allclose(away.std(axis=0), fit.angles_sd_arcsec, rtol=0.05)
    quats = Rotation.from_matrix(turned).as_quat(canonical=True)[:, [3, 0, 1, 2]]
    np.testing.assert_allclose(quats.std(axis=0), fit.quat_sd, rtol=0.05)
    np.testing.assert_allclose(turned.std(axis=0) / ARCSEC_RAD, fit.matrix_sd_arcsec, rtol=0.06)


# ---- honesty -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def seeds() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors, standard errors and the Cramér–Rao bound of 150 nights, arcseconds.

    So many, because the ratio to the bound is then known to 3 %."""
    errors, sds, bounds = [], [], []
    for seed in range(150):
        made = simulate_session(seed=seed)
        fit = fit_alignment(made.session)
        errors.append(error_arcsec(fit, made))
        sds.append(fit.sd_arcsec)
        bounds.append(bound_arcsec(made))
    return np.array(errors), np.array(sds), np.array(bounds)


def bound_arcsec(made: SimulatedSession) -> np.ndarray:
    """The Cramér–Rao bound from every single reading, not from means over orientations."""
    seen = observe(made.session)
    stars = np.diag((np.array([3.0, 3.0, 20.0]) * ARCSEC_RAD) ** 2)
    turned = made.rot_mc @ seen.measured.rot_cn
    whole = np.zeros((3, 3))
    for k in range(len(seen)):
        across = skew(turned[k] @ seen.measured.reference[k])
        own = made.rot_mc @ stars @ made.rot_mc.T
        covariance = (0.5**2 + 0.3**2) * np.eye(3) + across @ own @ across.T
        whole += 20 * across.T @ np.linalg.inv(covariance) @ across
    return np.sqrt(np.diag(np.linalg.inv(whole))) / ARCSEC_RAD


@pytest.mark.slow
def test_errors_are_at_the_bound(seeds) -> None:
    errors, _, bounds = seeds
    assert np.sqrt((errors**2 / bounds**2).mean()) < 1.05
    assert np.linalg.norm(errors, axis=1).max() < 4.0
    assert np.sqrt((errors**2).mean()) < 1.0  # well below 2″, 0.49 nT in 50 000 nT


@pytest.mark.slow
def test_standard_errors_are_honest(seeds) -> None:
    errors, sds, _ = seeds
    z = errors / sds
    assert abs(z.mean()) < 3 / np.sqrt(z.size)
    assert z.std() == pytest.approx(1.0, abs=3 / np.sqrt(2 * z.size))


@pytest.mark.slow
def test_bias_matrix_and_pier_are_honest() -> None:
    """Twelve further unknowns at once, with a pier difference that is known to 2 nT."""
    z = []
    for seed in range(20):
        pier = np.array([5.0, -4.0, 3.0])
        made = simulate_session(seed=seed, pier=pier, bias=(100.0, 50.0, -20.0), matrix=MATRIX)
        drawn = pier + 2.0 * np.random.default_rng(seed + 1000).standard_normal(3)
        session = replace(made.session, pier=Pier(difference=drawn, sd=2.0))
        fit = fit_alignment(session, solve=("bias", "matrix"))
        found, sd = fit.solution.unknowns, fit.sd
        six = pack_symmetric(found.matrix - made.matrix)
        z.append(
            np.concatenate(
                [
                    error_arcsec(fit, made) / fit.sd_arcsec,
                    (found.bias - made.bias) / sd[9:12],
                    six[3:] / sd[15:18],
                    (found.offset - pier) / sd[6:9],
                ]
            )
        )
    z = np.array(z)
    assert z.std() == pytest.approx(1.0, abs=0.13)
    assert np.abs(z.mean(axis=0)).max() < 0.7


def test_noise_that_is_not_stated_is_taken_from_the_scatter() -> None:
    made = simulate_session(seed=6, readings=60)
    silent = replace(
        made.session,
        noise=None,
        reference_noise=None,
        star=replace(made.session.star, covariance=None),
    )
    stated, told = fit_alignment(made.session), fit_alignment(silent)
    np.testing.assert_allclose(told.sd_arcsec, stated.sd_arcsec, rtol=0.06)


@pytest.mark.slow
def test_residuals_larger_than_stated_widen_the_errors() -> None:
    made = simulate_session(seed=7, noise=5.0)
    session = replace(made.session, noise=0.5)
    fit = fit_alignment(session)
    assert names(fit) == {"session misfit"}
    assert fit.solution.inflation > 5
    assert np.abs(error_arcsec(fit, made) / fit.sd_arcsec).max() < 3.5


# ---- what is undetermined ----------------------------------------------------------------------


def test_parallel_orientations_are_refused_and_the_missing_turn_named() -> None:
    made = simulate_session(orientations=[(0, 60, 0)] * 5, seed=3)
    fit = fit_alignment(made.session)
    assert fit.verdict == "refused"
    assert fit.rank == 2
    assert fit.undetermined == (
        "the turn of the alignment about the field, which is the same in all orientations",
    )
    assert "azimuth" in fit.status
    assert_helped(made, fit)


def assert_helped(made: SimulatedSession, fit: AlignmentFit) -> None:
    """With the orientations it asks for, the fit is accepted and near the truth."""
    more = [(0, 60, 0)] * 5 + list(fit.add) * 4
    again = simulate_session(orientations=more, seed=3)
    better = fit_alignment(again.session, wanted_sd_arcsec=10.0)
    assert better.verdict == "good"
    assert np.abs(error_arcsec(better, again) / better.sd_arcsec).max() < 4


def test_two_orientations_determine_it_but_not_well() -> None:
    made = simulate_session(orientations=[(0, 60, 0), (90, 50, 30)], seed=3)
    fit = fit_alignment(made.session)
    assert fit.rank == 3
    assert names(fit) == {"alignment loose", "reference unchecked"}
    assert fit.add
    assert np.abs(error_arcsec(fit, made) / fit.sd_arcsec).max() < 3


def test_two_orientations_do_not_determine_a_bias_as_well() -> None:
    made = simulate_session(orientations=[(0, 60, 0), (90, 50, 30)], seed=3)
    fit = fit_alignment(made.session, solve=("bias",))
    assert fit.verdict == "refused"
    assert "the turn of the alignment" in fit.undetermined[0]
    assert "the bias along" in fit.undetermined[0]


@pytest.mark.parametrize(
    ("solve", "words"),
    [
        (("reference",), "a turn of the reference about the field"),
        (("pier", "matrix"), "the common gain of the magnetometer"),
        (("reference", "pier"), "a turn of the reference about"),
    ],
)
def test_what_one_place_cannot_tell_is_named_and_the_alignment_kept(solve, words) -> None:
    made = simulate_session(seed=3)
    fit = fit_alignment(made.session, solve=solve)
    assert names(fit) == {"unknowns undetermined"}
    assert any(words in combination for combination in fit.undetermined)
    assert "it is not determined by the field at one place" in fit.status
    assert np.abs(error_arcsec(fit, made) / fit.sd_arcsec).max() < 3


def test_a_level_turntable_cannot_tell_a_wrong_clock_and_says_so() -> None:
    """Turned about the vertical only, 34″ by a clock wrong by a second leave no residual at all."""
    made = simulate_session(orientations=[(a, 60, 0) for a in range(0, 360, 20)], seed=1)
    star = replace(made.session.star, time=made.session.star.time + 1.0)
    late = replace(made.session, star=star)
    fit = fit_alignment(late)
    assert np.linalg.norm(error_arcsec(fit, made)) > 25.0 > 10 * fit.worst_sd_arcsec
    assert names(fit) == {"reference unchecked"}
    assert "add orientations" in fit.status
    known = fit_alignment(replace(late, reference_sd_arcsec=15.0), wanted_sd_arcsec=90.0)
    assert known.verdict == "good"
    assert np.abs(error_arcsec(known, made) / known.sd_arcsec).max() < 3


@pytest.mark.parametrize(("beta", "word"), [(0.0, "sum"), (180.0, "difference")])
def test_parallel_axes_are_no_trouble(beta: float, word: str) -> None:
    made = simulate_session(seed=3, mounting_deg=(30.0, beta, 20.0), mounting_sd_deg=0.0)
    fit = fit_alignment(made.session)
    assert fit.verdict == "good"
    assert f"only the {word} of α and γ" in fit.status
    assert np.abs(error_arcsec(fit, made) / fit.sd_arcsec).max() < 3


# ---- circumstances -----------------------------------------------------------------------------


def test_geodetic_coordinates_are_doubted() -> None:
    made = simulate_session(seed=8)
    site = replace(made.session.site, coordinates="geodetic")
    fit = fit_alignment(replace(made.session, site=site))
    assert names(fit) == {"geodetic coordinates"}
    budget = {effect.name: effect for effect in error_budget(fit)}
    assert budget["deflection of the vertical"].treatment == "not corrected"


@pytest.mark.slow
def test_predictions_of_the_earths_rotation_are_noted() -> None:
    earth = load_earth_rotation()
    made = simulate_session(seed=8)
    ahead = earth.measured_until + 20 * 86_400 - made.session.middle
    fit = fit_alignment(at_other_times(made.session, ahead), wanted_sd_arcsec=1e9)
    assert "predicted earth rotation" in names(fit)


def test_times_outside_the_table_are_refused() -> None:
    made = simulate_session(seed=8, orientations=4)
    with pytest.raises(ValidityError, match=r"after the end of the Earth rotation table .* 15″"):
        fit_alignment(at_other_times(made.session, 30 * 365.25 * 86_400))
    with pytest.raises(ValidityError, match="before the Earth rotation table begins"):
        fit_alignment(at_other_times(made.session, -60 * 365.25 * 86_400))


@pytest.mark.slow
def test_attitudes_that_scatter_too_much_are_told() -> None:
    made = simulate_session(seed=8, across_sd_arcsec=9.0)
    stated = np.diag((np.array([3.0, 3.0, 20.0]) * ARCSEC_RAD) ** 2)
    covariance = np.broadcast_to(stated, made.session.star.rot_ci.shape)
    star = replace(made.session.star, covariance=covariance)
    fit = fit_alignment(replace(made.session, star=star), wanted_sd_arcsec=5.0)
    assert names(fit) & {"attitude scatter", "session misfit"}


def test_units_and_orientations_that_do_not_meet() -> None:
    session = simulate_session(seed=8, orientations=4).session
    micro = session.magnetometer.with_columns(field=session.magnetometer.field / 1000)
    with pytest.raises(UnitError, match="one of the units is wrong"):
        fit_alignment(replace(session, magnetometer=micro))
    other = session.magnetometer.with_columns(station=session.magnetometer.station + 1)
    with pytest.raises(AgonicError, match="orientation 1 has star readings but none"):
        fit_alignment(replace(session, magnetometer=other))
    late = replace(session, star=replace(session.star, time=session.star.time + 86_400 * 3))
    with pytest.raises(AgonicError, match=r"never read at the same time: they are 3\.0 days apart"):
        fit_alignment(late)
    with pytest.raises(AgonicError, match="use one of alignment, reference, pier, bias, matrix"):
        fit_alignment(session, solve=("angles",))


# ---- the budget and the plan -------------------------------------------------------------------


def test_the_budget_has_the_sizes_of_the_textbooks() -> None:
    """2024: precession 24.2 years of 50.3″, the origins 1112″, 37 leap seconds 557″."""
    fit = fit_alignment(simulate_session(seed=1).session)
    sizes = {effect.name: effect.size_arcsec for effect in error_budget(fit)}
    assert sizes["precession"] == pytest.approx(24.2 * 50.29, rel=0.002)
    assert sizes["leap seconds"] == pytest.approx(557, abs=1)
    assert sizes["equation of the origins"] == pytest.approx(1111.8, abs=2)
    assert 2 < sizes["nutation"] < 20
    assert 0.1 < sizes["polar motion"] < 0.7
    assert sizes["UT1 − UTC"] < 13.5
    assert 15 < sizes["annual and diurnal aberration"] < 21.2
    assert 40 < sizes["refraction of the air"] < 90
    assert sizes["noise of the magnetometer"] == pytest.approx(
        0.5 / np.sqrt(20) / FIELD * 206265, rel=0.01
    )


@pytest.mark.parametrize("solve", [("alignment",), ("bias", "matrix")])
def test_a_plan_keeps_its_promise(solve: tuple[str, ...]) -> None:
    """A session taken by the plan has the standard errors that the plan foretold."""
    nominal = (37.0, 64.0, -112.0)
    plan = plan_alignment(
        [18_870, 1_390, 45_750], wanted_sd_arcsec=1.5, solve=solve, mounting_deg=nominal
    )
    made = simulate_session(orientations=plan.orientations, seed=2, mounting_sd_deg=0.1)
    fit = fit_alignment(made.session, solve=solve)
    assert plan.worst_sd_arcsec <= 1.5
    assert fit.worst_sd_arcsec == pytest.approx(plan.worst_sd_arcsec, rel=0.03)
    assert np.isinf(plan.sd_arcsec[0])
    assert (np.diff(plan.sd_arcsec[np.isfinite(plan.sd_arcsec)]) <= 1e-9).all()


def test_a_plan_is_better_than_chance() -> None:
    plan = plan_alignment([18_870, 1_390, 45_750], wanted_sd_arcsec=1.5)
    count = len(plan.orientations)
    drawn = [
        fit_alignment(simulate_session(orientations=count, seed=s).session).worst_sd_arcsec
        for s in range(8)
    ]
    assert plan.worst_sd_arcsec < np.median(drawn)


def test_plans_that_cannot_be() -> None:
    field = [18_870, 1_390, 45_750]
    with pytest.raises(CoverageError, match="leave the alignment at"):
        plan_alignment(field, wanted_sd_arcsec=0.01)
    with pytest.raises(AgonicError, match="a plan needs at least one reading"):
        plan_alignment(field, readings=0)


def test_the_figure_of_the_axes_ends_where_the_alignment_says() -> None:
    """The turns of the drawing, taken in steps, lead from one set of axes to the other."""
    made = simulate_session(seed=3)
    fit = fit_alignment(made.session)
    alpha, beta, gamma = np.radians(fit.angles_deg)
    about_z = Rotation.from_rotvec([0, 0, alpha])
    about_y = Rotation.from_rotvec(beta * about_z.apply([0, 1, 0]))
    tilted = about_y * about_z
    about_last = Rotation.from_rotvec(gamma * tilted.apply([0, 0, 1]))
    np.testing.assert_allclose((about_last * tilted).as_matrix().T, fit.rot_mc, atol=1e-12)
    drawn = draw_axes(*fit.angles_deg)
    assert all(f"{name}₃" in drawn for name in "xyz")
