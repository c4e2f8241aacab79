"""`fit_north` and `fit_di_flux` against simulated truth and hand reductions."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.alignment.north import di_flux as kernel
from agonic.alignment.north.di_flux import fit_di_flux
from agonic.alignment.north.fit import fit_north
from agonic.alignment.session.laboratory import NorthSession, Sighting
from agonic.alignment.simulation.laboratory import simulate_di_flux, simulate_north
from agonic.errors import AgonicError, CoverageError
from agonic.maths.rotations.frames import ARCSEC_RAD


@pytest.mark.slow
def test_every_method_is_honest_and_the_sinusoid_best() -> None:
    z = {"swing": [], "reversal": [], "transit": [], "mark": [], "turn": []}
    for seed in range(40):
        made = simulate_north(seed=seed, constant_sd_arcsec=1e-9)
        fit = fit_north(made.session)
        assert fit.method == "swing"
        assert fit.by["swing"].sd_deg < 0.5 * min(
            fit.by["reversal"].sd_deg, fit.by["transit"].sd_deg
        )
        gyro = made.north_deg - made.session.constant_arcsec / 3600
        for name, found in fit.by.items():
            z[name].append((found.reading_deg - gyro) / found.sd_deg)
        mark = fit.azimuths[0]
        z["mark"].append(3600 * (mark.azimuth_deg - made.mark_azimuth_deg) / mark.sd_arcsec)
        off = Rotation.from_matrix(made.rot_mb @ fit.aligned.rot_mb.T).as_rotvec()
        z["turn"].append(off @ np.linalg.solve(fit.aligned.covariance, off))
    for name in ("swing", "reversal", "transit", "mark"):
        assert abs(np.mean(z[name])) < 0.45, name  # the transit has its own 0.4″ of curvature
        assert 0.75 < np.std(z[name]) < 1.3, name
    assert np.mean(z["turn"]) == pytest.approx(3.0, abs=1.0)  # χ² of three


def test_without_noise_north_and_alignment_are_exact() -> None:
    made = simulate_north(
        reading_sd_arcsec=1e-7,
        time_sd_s=1e-9,
        constant_sd_arcsec=0,
        noise=1e-6,
        reference_noise=1e-6,
        circle_sd_arcsec=1e-6,
        level_sd_arcsec=1e-6,
    )
    fit = fit_north(made.session)
    assert abs(fit.north_deg - made.north_deg) * 3600 < 1e-4
    turn = Rotation.from_matrix(made.rot_mb @ fit.aligned.rot_mb.T).magnitude() / ARCSEC_RAD
    # the reference is interpolated within a second of its slow waves
    assert turn < 0.01
    assert abs(fit.azimuths[0].azimuth_deg - made.mark_azimuth_deg) * 3600 < 1e-3
    reversal, transit = fit.by["reversal"], fit.by["transit"]
    gyro = fit.by["swing"].reading_deg
    assert abs(reversal.reading_deg - gyro) * 3600 < 1.0  # second order of the decay
    assert abs(transit.reading_deg - gyro) * 3600 < 1.0  # third order of the setting


def test_norths_own_error_turns_the_platform_about_down() -> None:
    made = simulate_north(seed=3)
    sure = fit_north(made.session).aligned
    unsure = fit_north(replace(made.session, constant_sd_arcsec=3.0)).aligned
    extra = unsure.covariance - sure.covariance
    down_m = unsure.rot_mb[:, 2]
    expected = (3.0**2 - made.session.constant_sd_arcsec**2) * ARCSEC_RAD**2
    # the tilts of the platform tell a little, to 17″, of what turns with it and what does not
    assert down_m @ extra @ down_m == pytest.approx(expected, rel=0.1)


def test_the_calibration_takes_readings_into_the_platforms_axes() -> None:
    made = simulate_north(noise=1e-3, reference_noise=1e-3, seed=2)
    fit = fit_north(made.session)
    calibration = fit.calibration
    assert (calibration.frame_in, calibration.frame_out) == ("m", "b")
    np.testing.assert_allclose(
        calibration.rotation.as_matrix(), made.rot_mb.T, atol=4 * fit.sd_arcsec * ARCSEC_RAD
    )


def test_a_mirror_looks_back() -> None:
    session = NorthSession(
        turning_deg=np.array([10.0, 12.0, 10.0, 12.0]),
        sightings=(
            Sighting(name="line", reading_deg=np.array([101.0])),
            Sighting(name="cube", reading_deg=np.array([101.0]), mirror=True),
        ),
    )
    line, cube = fit_north(session).azimuths
    assert (line.azimuth_deg, cube.azimuth_deg) == (90.0, 270.0)


def test_findings() -> None:
    made = simulate_north(orientations=3, seed=1)
    wrong = replace(made.session, turning_deg=made.session.turning_deg + 0.02)
    assert {f.name for f in fit_north(wrong).findings} == {"methods disagree"}
    swing = made.session.swing
    short = replace(swing, time_s=swing.time_s[:50], reading_deg=swing.reading_deg[:50])
    names = {f.name for f in fit_north(replace(made.session, swing=short)).findings}
    assert "short swing" in names
    platform = replace(made.session.platform, mirror=False, pitch_deg=np.array([9.0, 0, -9.0]))
    fit = fit_north(replace(made.session, platform=platform))
    assert "platform misfit" in {f.name for f in fit.findings}
    one = simulate_north(orientations=1).session
    assert fit_north(one).verdict == "refused"
    alone = NorthSession(turning_deg=np.array([10.0, 12.0, 10.0]))
    assert [f.name for f in fit_north(alone).findings] == ["no spread"]


@pytest.mark.parametrize("seed", range(4))
def test_what_would_explain_a_misfit_of_the_platform_is_said(seed: int) -> None:
    session = simulate_north(seed=seed, orientations=12).session
    platform = session.platform
    misread = platform.reading_deg + np.where(platform.orientation == 5, 100 / 3600, 0.0)
    fit = fit_north(replace(session, platform=replace(platform, reading_deg=misread)))
    found = next(f for f in fit.findings if f.name == "platform misfit")
    assert "orientation 5, off by" in found.what
    assert "stood still in orientation 5" in found.move
    number = session.magnetometer.station
    turn = np.where(number[:, None] > 6, [[20 / 3600, -30 / 3600, 25 / 3600]], 0.0)
    knocked = Rotation.from_rotvec(turn, degrees=True).apply(session.magnetometer.field.copy())
    samples = session.magnetometer.with_columns(field=knocked)
    fit = fit_north(replace(session, magnetometer=samples))
    found = next(f for f in fit.findings if f.name == "platform misfit")
    assert "a platform that moved by" in found.what
    assert "after orientation 6" in found.what


def test_a_session_that_cannot_be_names_every_mistake() -> None:
    with pytest.raises(AgonicError, match=r"too few.*all three"):
        NorthSession(turning_deg=np.array([1.0]), platform=simulate_north().session.platform)
    with pytest.raises(AgonicError, match="no readings of the gyro"):
        NorthSession()


def test_the_theodolites_jacobian() -> None:
    rng = np.random.default_rng(0)
    at = kernel.Settings(*rng.uniform(0, 6, (3, 12)), np.arange(12) % 3 == 0)
    params = np.array([0.3, 1.1, 2e-3, -3e-3, 1e-4, 48_000.0])
    _, jacobian = kernel.predict(params, at)
    for k in range(6):
        step = np.zeros(6)
        step[k] = 1e-6 * max(abs(params[k]), 1.0)
        slope = (kernel.predict(params + step, at)[0] - kernel.predict(params - step, at)[0]) / (
            2 * step[k]
        )
        np.testing.assert_allclose(jacobian[:, k], slope, rtol=1e-6, atol=1e-4)


def test_a_sheet_without_noise_is_undone() -> None:
    made = simulate_di_flux(noise=0.0, mark_sd_arcsec=0.0)
    fit = fit_di_flux(made.sheet)
    assert fit.declination_deg == pytest.approx(made.declination_deg, abs=1e-4 / 3600)
    assert fit.inclination_deg == pytest.approx(made.inclination_deg, abs=1e-4 / 3600)
    assert fit.collimation_arcsec == pytest.approx(
        (made.delta_arcsec, made.epsilon_arcsec), abs=1e-3
    )
    assert fit.offset == pytest.approx(made.offset, abs=1e-4)
    assert 3600 * fit.mark.collimation_deg == pytest.approx(4.0, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("inclination", [64.3, -55.0, 12.0])
def test_sheets_are_honest(inclination: float) -> None:
    """Three degrees of freedom: the median of Student's t is 0.765, of its widened sd 0.471."""
    z = []
    for seed in range(150):
        made = simulate_di_flux(inclination_deg=inclination, seed=seed)
        fit = fit_di_flux(made.sheet)
        assert fit.estimate.freedom == 3
        z.append(
            [
                3600 * (fit.declination_deg - made.declination_deg) / fit.declination_sd_arcsec,
                3600 * (fit.inclination_deg - made.inclination_deg) / fit.inclination_sd_arcsec,
                (fit.collimation_arcsec[0] - made.delta_arcsec) / fit.collimation_sd_arcsec[0],
                (fit.collimation_arcsec[1] - made.epsilon_arcsec) / fit.collimation_sd_arcsec[1],
                (fit.offset - made.offset) / fit.offset_sd,
            ]
        )
    middle = np.median(np.abs(z), axis=0)
    assert ((middle > 0.34) & (middle < 0.62)).all(), middle
    assert np.mean(np.abs(z) < 1.96) == pytest.approx(0.95, abs=0.03)


def test_findings_of_a_sheet() -> None:
    made = simulate_di_flux()
    misread = made.sheet.horizontal_deg.copy()
    misread[2:4] += 0.05
    fit = fit_di_flux(replace(made.sheet, horizontal_deg=misread))
    assert [f.name for f in fit.findings] == ["settings disagree"]
    alone = fit_di_flux(replace(made.sheet, mark_azimuth_deg=None))
    assert alone.declination_deg is None
    assert [f.name for f in alone.findings] == ["no mark"]
    no_scale = made.sheet.setting < 8
    short = replace(
        made.sheet,
        magnitude=None,
        **{
            name: getattr(made.sheet, name)[no_scale]
            for name in ("horizontal_deg", "zenith_deg", "reading", "setting", "time")
        },
    )
    assert "no scale" in {f.name for f in fit_di_flux(short).findings}
    assert fit_di_flux(short, magnitude=48_800.0).ok
    with pytest.raises(CoverageError, match="level and"):
        fit_di_flux(replace(short, zenith_deg=np.full(16, 90.0)))
    order = np.arange(18)
    order[[8, 9, 14, 15]] = [14, 15, 8, 9]  # the first of the inclination now looks south
    circles = {n: getattr(made.sheet, n)[order] for n in ("horizontal_deg", "zenith_deg")}
    assert "reads backwards" in {
        f.name for f in fit_di_flux(replace(made.sheet, **circles)).findings
    }


@pytest.mark.slow
@pytest.mark.parametrize("drift_arcsec", [5.0, 20.0])
def test_a_zero_that_drifts_is_told_and_stated(drift_arcsec: float) -> None:
    """The band of the gyro warms up: what it hangs at moves all the time."""
    z = []
    for seed in range(20):
        made = simulate_north(seed=seed, orientations=0)
        session = made.session
        time, turning = session.swing.time_s, session.turning_deg
        moved = replace(
            session,
            swing=replace(
                session.swing,
                reading_deg=session.swing.reading_deg + drift_arcsec / 3600 * time / time[-1],
            ),
            turning_deg=turning + drift_arcsec / 3600 * np.linspace(0, 1, len(turning)),
        )
        fit = fit_north(moved)
        assert fit.verdict == "check"
        assert "zero drifts" in [finding.name for finding in fit.findings]
        z.append(3600 * (fit.north_deg - made.north_deg) / fit.sd_arcsec)
    assert np.abs(z).max() < 3.0
    assert np.sqrt(np.mean(np.square(z))) < 1.4


@pytest.mark.parametrize("blunder_arcsec", [120.0, 3600.0])
def test_a_misread_turning_point_outweighs_the_stated_noise(blunder_arcsec: float) -> None:
    for seed in range(5):
        made = simulate_north(seed=seed, orientations=0)
        turning = made.session.turning_deg.copy()
        turning[seed % 8] += blunder_arcsec / 3600
        session = replace(made.session, turning_deg=turning, swing=None, transits=None)
        fit = fit_north(session)
        assert fit.verdict == "check"
        assert "readings scatter" in [finding.name for finding in fit.findings]
        assert abs(fit.north_deg - made.north_deg) * 3600 < 3.0 * fit.sd_arcsec


def test_transits_whose_zero_moves_outweigh_the_stated_noise() -> None:
    """A zero that moves by 60″ over four transits was good at up to four standard errors."""
    z = []
    for seed in range(8):
        made = simulate_north(seed=seed, orientations=0)
        session = replace(made.session, turning_deg=None, swing=None)
        assert fit_north(session).ok
        transits = session.transits
        moved = transits.setting_deg + np.linspace(-30, 30, 4) / 3600
        fit = fit_north(replace(session, transits=replace(transits, setting_deg=moved)))
        assert [finding.name for finding in fit.findings] == ["readings scatter"]
        z.append(3600 * (fit.north_deg - made.north_deg) / fit.sd_arcsec)
    assert np.abs(z).max() < 2.0


@pytest.mark.parametrize("settling", [False, True])
def test_a_platform_that_settles_is_told_and_in_the_standard_error(settling: bool) -> None:
    """By 30″ after each turn, of which 13″ are in the means: at 2″ stated once, good."""
    z = []
    for seed in range(4):
        made = simulate_north(seed=seed)
        session, field = made.session, made.session.magnetometer.field
        if settling:
            since = np.arange(len(field)) % 20
            turned = -30.0 * ARCSEC_RAD * np.expm1(-since / 15.0)
            about_down = Rotation.from_rotvec(np.outer(turned, made.rot_mb[:, 2]))
            moved = session.magnetometer.with_columns(field=about_down.apply(np.array(field)))
            session = replace(session, magnetometer=moved)
        fit = fit_north(session)
        told = "platform settles" in {finding.name for finding in fit.findings}
        assert told == settling
        assert fit.verdict == ("check" if settling else "good")
        off = Rotation.from_matrix(made.rot_mb @ fit.aligned.rot_mb.T).as_rotvec()
        z.append(off @ np.linalg.solve(fit.aligned.covariance, off) / 3)
    assert np.sqrt(np.mean(z)) < 1.5


@pytest.mark.slow
@pytest.mark.parametrize("stated", [True, False])
def test_turning_points_alone_allow_for_a_zero_that_drifts(stated: bool) -> None:
    """20″ over eight turning points: good and off by more than three sd in 17 and 5 of 30."""
    z, clean, told = [], [], 0
    for seed in range(30):
        made = simulate_north(seed=seed, orientations=0)
        plain = replace(made.session, swing=None, transits=None)
        if not stated:
            plain = replace(plain, reading_sd_arcsec=None)
        moved = 20.0 / 3600 * np.linspace(0, 1, len(plain.turning_deg))
        fit = fit_north(replace(plain, turning_deg=plain.turning_deg + moved))
        z.append((fit.north_deg - made.north_deg) * 3600 / fit.sd_arcsec)
        told += "zero drifts" in {finding.name for finding in fit.findings}
        steady = fit_north(plain)
        clean.append((steady.north_deg - made.north_deg) * 3600 / steady.sd_arcsec)
        assert steady.ok
    assert sum(np.abs(z) > 3) <= 1
    assert told > 5
    assert 0.7 < np.std(clean) < 1.3


def test_four_turning_points_of_known_noise_tell_a_zero_that_drifts() -> None:
    """Of 60 sessions with 20″ over four turning points 19 were good and off by more than 3 sd."""
    for seed in range(30):
        made = simulate_north(seed=seed, orientations=0)
        plain = replace(
            made.session, turning_deg=made.session.turning_deg[:4], swing=None, transits=None
        )
        assert fit_north(plain).ok
        moved = 20.0 / 3600 * np.linspace(0, 1, 4)
        fit = fit_north(replace(plain, turning_deg=plain.turning_deg + moved))
        off = abs(fit.north_deg - made.north_deg) * 3600 / fit.sd_arcsec
        assert not (fit.ok and off > 3)


def test_few_settings_are_known_no_better_than_a_circle_is_read() -> None:
    """Three residuals are small by chance: declinations were up to five standard errors off."""
    z = []
    for seed in range(30):
        made = simulate_di_flux(seed=seed)
        fit = fit_di_flux(made.sheet)
        off = fit.declination_deg - made.declination_deg
        z.append(off * 3600 / fit.declination_sd_arcsec)
    assert np.abs(z).max() < 3.0
    assert np.std(z) > 0.5
