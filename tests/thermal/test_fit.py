"""Temperature fits: truth, honesty at every temperature, the bound, and what is wrong by name."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.simulation.thermal import make_readings
from agonic.thermal.fit.fit import fit_binned, fit_thermal
from agonic.thermal.fit.readings import Facts
from agonic.thermal.maths.binned_sums import Binned
from agonic.thermal.maths.stations import list_standard_rotations
from agonic.thermal.simulation.campaign import Faults, simulate_campaign
from tests.thermal.chambers import FIELD, KNOWN, campaign, efficient, nine
from tests.thermal.coil import simulate_thermal_coil

AT = np.linspace(-10.0, 50.0, 13)
WIDE = {"bin_width_C": 2.0, "rate": False, "drift": False}
COARSE = {"bin_width_C": 2.0}
"""Bins wide enough for what no bin decides: a quarter of the means."""


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.fixture(scope="module")
def draws() -> dict[str, list[tuple[np.ndarray, np.ndarray, np.ndarray]]]:
    """Errors, standard errors and efficient errors at thirteen temperatures, by kind of fit.

    300 readings a leg at 20 nT tell as much as 5400 at 85 nT.
    """
    made: dict[str, list[tuple[np.ndarray, np.ndarray, np.ndarray]]] = {
        "unknown": [],
        "known": [],
        "off by 1°": [],
    }
    for seed in range(12):
        for kind, found in made.items():
            drawn = campaign(seed, fixture_deg=1.0 if kind == "off by 1°" else 0.0)
            stations = "unknown" if kind == "unknown" else "known"
            clock = drawn.samples.time if seed % 4 == 0 else None  # without: no slow changes
            samples = drawn.samples.with_columns(time=clock)
            fit = fit_thermal(samples, KNOWN, stations=stations, **WIDE)
            sd = fit.calibration.sd_at(AT) * np.array([1.0] * 3 + [FIELD] * 6)
            error = nine(fit.calibration, AT) - nine(drawn.truth, AT)
            found.append((error, sd, efficient(drawn, AT, turns=kind != "unknown")))
    return made


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["unknown", "known", "off by 1°"])
def test_error_over_sd_is_standard_normal_at_every_temperature(draws, kind: str) -> None:
    z = np.array([error / sd for error, sd, _ in draws[kind]])
    # nine coefficients of 12 campaigns, mildly correlated: a scatter of 0.08 or so
    assert np.sqrt(np.mean(z**2, axis=(0, 2))) == pytest.approx(np.ones(13), abs=0.25)
    assert rms(z) == pytest.approx(1.0, abs=0.13)
    assert np.abs(z.mean(axis=0)).max() < 4.5 / np.sqrt(12)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["unknown", "known"])
def test_it_attains_the_bound(draws, kind: str) -> None:
    """Against the linearised efficient estimator on the same readings."""
    for part in (slice(0, 3), slice(3, 9)):
        ours = rms(np.array([error[:, part] for error, _, _ in draws[kind]]))
        best = rms(np.array([least[:, part] for _, _, least in draws[kind]]))
        assert ours < 1.05 * best


@pytest.mark.slow
def test_fixture_errors_do_not_spoil_the_known_turns(draws) -> None:
    for part in (slice(0, 3), slice(3, 9)):
        known, off, alone = (
            rms(np.array([error[:, part] for error, _, _ in draws[kind]]))
            for kind in ("known", "off by 1°", "unknown")
        )
        assert known < 0.6 * alone
        assert off < 0.8 * alone


@pytest.mark.slow
def test_the_page_s_campaign_reaches_the_page_s_figures() -> None:
    """5400 readings at 100 nT: 1.3/1.6 nT by magnitude and 0.5/0.8 nT by turns were one draw's;
    the bound is 1.4/1.7 and 0.57/0.85. Here a tenth of the readings at 100/√10 nT, rms of six."""
    errors: dict[str, list[np.ndarray]] = {"unknown": [], "known": []}
    at = np.linspace(-9.5, 49.5, 60)
    for seed in range(3):
        made = campaign(100 + seed, n=540, noise=100.0 / np.sqrt(10.0))
        samples = made.samples.with_columns(time=None)  # no clock, no slow changes to look for
        for stations, found in errors.items():
            fit = fit_thermal(samples, KNOWN, stations=stations, **WIDE)
            found.append(nine(fit.calibration, at) - nine(made.truth, at))
    for stations, bias, matrix in (("unknown", 1.4, 1.75), ("known", 0.57, 0.86)):
        error = np.array(errors[stations])
        assert rms(error[:, :, :3]) < 1.25 * bias  # six draws scatter by some 10 %
        assert rms(error[:, :, 3:]) < 1.25 * matrix


@pytest.mark.slow
@pytest.mark.parametrize("stations", ["unknown", "known"])
def test_terms_that_are_not_needed_leave_no_trace(stations: str) -> None:
    made = campaign(11, n=540)
    plain = fit_thermal(made.samples, KNOWN, stations=stations, **WIDE)
    auto = fit_thermal(made.samples, KNOWN, stations=stations, bin_width_C=2.0)
    assert {test.larger for test in auto.tests} == {"rate", "drift", "ageing"}
    assert (auto.calibration.rate, auto.drift, auto.ageing) == (None, None, None)
    error = np.abs(nine(auto.calibration, AT) - nine(plain.calibration, AT))
    sd = plain.calibration.sd_at(AT) * np.array([1.0] * 3 + [FIELD] * 6)
    assert (error < 0.1 * sd).all()


def test_a_sensor_mounted_anywhere_is_found_with_its_mounting() -> None:
    mount = Rotation.from_euler("zyx", [100.0, -35.0, 160.0], degrees=True)
    made = campaign(3, mount=mount, fixture_deg=0.5)
    fit = fit_thermal(made.samples, KNOWN, stations="known", **WIDE)
    assert fit.reference_kind == "turns"
    assert fit.fixture is not None
    assert np.degrees((fit.fixture.mounting * mount.inv()).magnitude()) < 0.6
    assert fit.fixture.field_n == pytest.approx(made.field_n, abs=0.01 * FIELD)
    assert fit.fixture.sd_deg == pytest.approx(0.5, abs=0.2)
    assert max(fit.fixture.turned_deg.values()) < 2.5
    assert fit.ok


@pytest.mark.slow
def test_without_a_magnitude_the_mean_gain_is_one() -> None:
    made = campaign(1)
    plain = fit_thermal(made.samples, KNOWN, **WIDE).calibration
    free = fit_thermal(made.samples, **WIDE)
    gain = np.trace(plain.matrix[0]) / 3
    assert np.trace(free.calibration.matrix[0]) == pytest.approx(3.0)
    assert free.calibration.matrix == pytest.approx(plain.matrix / gain, abs=1e-6)
    assert free.calibration.magnitude == pytest.approx(FIELD / gain, rel=1e-6)
    assert "mean gain" in free.status
    z = []
    for seed in range(5):
        made = campaign(200 + seed)
        fit = fit_thermal(made.samples, **WIDE)
        scale = np.trace(made.truth.matrix_at(fit.calibration.centre_C)) / 3
        wanted = made.truth.matrix_at(AT) / scale
        error = fit.calibration.matrix_at(AT) - wanted
        z.append(error[:, [0, 1, 2], [0, 1, 2]] / fit.calibration.sd_at(AT)[:, 3:6])
    assert rms(np.array(z)) == pytest.approx(1.0, abs=0.3)


def test_counts_are_calibrated_to_nanotesla() -> None:
    made = campaign(2)
    counts = made.samples.with_columns(field=made.samples.field / 25.0, unit="raw")
    fit = fit_thermal(counts, KNOWN, **WIDE)
    same = fit_thermal(made.samples, KNOWN, **WIDE).calibration
    assert (fit.calibration.unit_in, fit.calibration.unit_out) == ("raw", "nT")
    assert fit.calibration.matrix == pytest.approx(25.0 * same.matrix, rel=1e-6, abs=1e-6)
    assert fit.calibration.bias == pytest.approx(same.bias / 25.0, abs=1e-4)


def test_each_temperature_by_itself_and_the_order() -> None:
    made = campaign(4, noise=5.0)
    fit = fit_thermal(made.samples, KNOWN, degree="auto", **WIDE)
    assert fit.calibration.degree == 3
    assert fit.variances is not None
    assert fit.variances.shape == (9, 6)
    assert fit.variances[:, 3:] == pytest.approx(np.ones((9, 3)), abs=0.9)
    assert (fit.variances[:3, 1] > 5).all()
    bins = fit.bins
    inner = slice(1, -1)
    truth = nine(made.truth, bins.temperature[inner])
    truth[:, 3:] /= FIELD
    for values, sd in ((bins.cooling, bins.cooling_sd), (bins.heating, bins.heating_sd)):
        z = (values[inner] - truth) / sd[inner]
        assert rms(z) == pytest.approx(1.0, abs=0.2)


def test_improvement_is_the_paper_s_ratio_on_the_rows() -> None:
    """The largest of twelve standard deviations of all readings, before over after."""
    made = campaign(5, noise=100.0)
    fit = fit_thermal(made.samples, KNOWN, **WIDE)
    after = ag.apply(fit.calibration, made.samples).field
    for column, values in enumerate((made.samples.field, after)):
        rows = np.column_stack([values, np.linalg.norm(values, axis=1)])
        sd = np.array([rows[made.samples.station == k].std(axis=0) for k in range(1, 13)])
        spread = fit.spread.after if column else fit.spread.before
        assert spread == pytest.approx(sd, rel=4e-3)  # bins of 2 °C
    assert (fit.spread.improvement > 5.0).all()


def test_hysteresis_is_found_as_a_term_in_the_rate() -> None:
    made = campaign(6, per_rate=40_000.0)
    plain = fit_thermal(made.samples, KNOWN, bin_width_C=2.0, rate=False)
    assert plain.hysteresis is not None
    rate = 12.0 / 300.0  # heating less cooling, °C/s
    assert plain.hysteresis.difference[:3] == pytest.approx(-rate * made.truth.rate, abs=25.0)
    assert "hysteresis" in {f.name for f in plain.findings}
    fit = fit_thermal(made.samples, KNOWN, bin_width_C=2.0)
    assert fit.calibration.rate == pytest.approx(made.truth.rate, abs=600.0)
    assert fit.calibration.needs == ("temperature", "temperature_rate")
    left = ag.apply(fit.calibration, made.samples).field - made.field_m
    steady = np.abs(made.samples.temperature - 20.0) < 26.0  # away from the sharp turns
    assert rms(left[steady]) < 22.0
    none = fit_thermal(campaign(6).samples, KNOWN, bin_width_C=2.0)
    assert none.calibration.rate is None


@pytest.mark.slow
def test_sums_fed_in_pieces_give_the_same_fit() -> None:
    made = campaign(7)
    whole = fit_thermal(made.samples, KNOWN, stations="known", bin_width_C=2.0)
    sums = Binned(2.0)
    for station in range(12, 0, -1):
        rows = made.samples.station == station
        part = made.samples.select(rows)
        sums.add(station, part.field, part.temperature, part.time)
    fit = fit_binned(sums, Facts("mag"), KNOWN, stations="known")
    assert fit.calibration.bias == pytest.approx(whole.calibration.bias, abs=1e-6)
    assert fit.n == whole.n


# ---- what goes wrong, by name -----------------------------------------------------------------


def faulty(seed: int = 1, **settings) -> tuple[ag.Samples, object]:
    faults = {key: settings.pop(key) for key in list(settings) if key in Faults.__annotations__}
    quiet = {"field_sd": 0.0, "hysteresis": 0.0, "anomalies": 0.0} | settings
    quiet = {"rate_Hz": 0.1} | quiet
    made = simulate_campaign("MMC5883MA", seed=seed, faults=Faults(**faults), **quiet)
    return made.campaign.samples(made.campaign.sensors[0]), made


def turns_of(made) -> dict[int, Rotation]:
    return made.description.rotations


def names(fit) -> set[str]:
    return {finding.name for finding in fit.findings}


def worst(fit, made) -> float:
    (truth,) = made.truth.values()
    return float(np.abs(nine(fit.calibration, AT[1:-1]) - nine(truth, AT[1:-1])).max())


@pytest.mark.slow
def test_nothing_is_said_of_a_good_campaign() -> None:
    samples, made = faulty()
    fit = fit_thermal(samples, KNOWN, stations=turns_of(made), **COARSE)
    assert fit.ok
    assert not names(fit) - {"anomalies"}
    assert worst(fit, made) < 25.0


@pytest.mark.slow
def test_missing_stations_are_named_and_what_remains_is_told() -> None:
    samples, made = faulty(missing=(2, 5, 9))
    fit = fit_thermal(samples, KNOWN, stations=turns_of(made), **COARSE)
    found = next(f for f in fit.findings if f.name == "missing stations")
    assert "stations 2, 5, 9 are missing" in found.what
    assert worst(fit, made) < 60.0
    few, _ = faulty(missing=(2, 3, 5, 6, 8, 9))
    alone = fit_thermal(few, KNOWN, **COARSE)
    assert alone.verdict == "refused"
    told = next(f for f in alone.findings if f.name == "undetermined")
    assert "stations='known'" in told.move


@pytest.mark.slow
def test_a_field_that_sways_is_not_told_to_lack_stations() -> None:
    samples, _ = faulty()
    sway = 1 + 0.05 * np.sin(samples.time[:, None] / 97.0)
    fit = fit_thermal(dataclasses.replace(samples, field=samples.field * sway), KNOWN, **COARSE)
    assert fit.verdict == "refused"
    told = next(f for f in fit.findings if f.name == "undetermined")
    assert "scatter beyond their noise" in told.move


@pytest.mark.slow
def test_a_stuck_thermometer_is_named() -> None:
    samples, _ = faulty(stuck="MMC5883MA")
    with pytest.raises(ag.CoverageError, match="thermometer stands still"):
        fit_thermal(samples, KNOWN)
    samples, made = faulty()
    stuck = samples.temperature.copy()
    stuck[samples.station == 4] = 21.0
    fit = fit_thermal(
        samples.with_columns(temperature=stuck), KNOWN, stations=turns_of(made), **COARSE
    )
    assert "thermometer stands still at station 4" in fit.status
    assert 4 not in fit.spread.stations
    assert worst(fit, made) < 40.0


def test_exchanged_stations_are_named_and_the_magnitude_used() -> None:
    samples, made = faulty(swapped=(3, 8))
    fit = fit_thermal(samples, KNOWN, stations=turns_of(made), **COARSE)
    assert fit.reference_kind == "magnitude"
    assert "stations 3, 8 look exchanged" in fit.status.lower()
    assert worst(fit, made) < 60.0


@pytest.mark.slow
def test_a_chamber_that_drifted_is_told_from_the_sensor() -> None:
    samples, made = faulty(drift=1000.0)
    fit = fit_thermal(samples, KNOWN, stations=turns_of(made), **COARSE)
    assert "field drifted" in names(fit)
    assert np.linalg.norm(fit.drift) == pytest.approx(1000.0, abs=100.0)
    assert worst(fit, made) < 120.0


MOVING = {"at rest": {}, "slow changes": {"field_sd": 50.0}, "drift": {"drift": 400.0}}


@pytest.mark.slow
@pytest.mark.parametrize("stations", ["known", "unknown"])
@pytest.mark.parametrize("field", list(MOVING))
def test_standard_errors_are_honest_in_a_field_that_moves(field: str, stations: str) -> None:
    """0.2 readings a second, hysteresis, a fixture off by 1°; every term is left to be found."""
    z = []
    for seed in range(3):
        samples, made = faulty(20 + seed, hysteresis=100.0, rate_Hz=0.2, **MOVING[field])
        turns = turns_of(made) if stations == "known" else "unknown"
        fit = fit_thermal(samples, KNOWN, stations=turns, **COARSE)
        assert ("field changes" in names(fit)) == (field == "slow changes")
        (truth,) = made.truth.values()
        sd = fit.calibration.sd_at(AT[1:-1]) * np.array([1.0] * 3 + [FIELD] * 6)
        z.append((nine(fit.calibration, AT[1:-1]) - nine(truth, AT[1:-1])) / sd)
    # four campaigns of nine coefficients scatter by 0.15 or so; a drift of which the magnitude
    # shows little is half believed, and standard errors are then up to 1.4 times too small
    assert 0.65 < rms(np.array(z)) < (1.55 if (field, stations) == ("drift", "unknown") else 1.35)


@pytest.mark.slow
@pytest.mark.parametrize("stations", ["known", "unknown"])
def test_another_field_at_each_station_is_in_the_standard_errors(stations: str) -> None:
    """50 nT on each axis, steady at a station: 3.9 to 4.6 standard errors without.

    The magnitude alone does not tell offsets from a step, which hides more: it is more careful.
    """
    z = []
    for seed in range(3):
        samples, made = faulty(40 + seed)
        beside = 50.0 * np.random.default_rng(900 + seed).standard_normal((13, 3))
        spoilt = samples.with_columns(field=samples.field + beside[samples.station.astype(int)])
        turns = turns_of(made) if stations == "known" else "unknown"
        fit = fit_thermal(spoilt, KNOWN, stations=turns, bin_width_C=3.0, rate=False)
        assert "field changes" in names(fit)
        (truth,) = made.truth.values()
        sd = fit.calibration.sd_at(AT[1:-1]) * np.array([1.0] * 3 + [FIELD] * 6)
        z.append((nine(fit.calibration, AT[1:-1]) - nine(truth, AT[1:-1])) / sd)
    assert (0.5 if stations == "known" else 0.2) < rms(np.array(z)) < 1.5


@pytest.mark.slow
def test_slow_changes_of_the_field_are_told_with_their_size() -> None:
    samples, made = faulty(3, field_sd=50.0)
    fit = fit_thermal(samples, KNOWN, stations=turns_of(made), **COARSE)
    assert "field changes" in names(fit)
    assert fit.field_sd == pytest.approx(45.0, abs=15.0)
    assert fit.drift is None


@pytest.mark.slow
def test_a_drift_near_what_can_be_seen_widens_the_errors() -> None:
    """Averaged over being there or not: neither dropped nor believed, and said so."""
    samples, made = faulty(1, drift=100.0)
    auto, without, sure = (
        fit_thermal(samples, KNOWN, stations=turns_of(made), drift=drift, **COARSE)
        for drift in ("auto", False, True)
    )
    sd = [rms(fit.calibration.sd_at(AT)[:, :3]) for fit in (without, auto, sure)]
    assert sd[0] < 1.05 * sd[1]
    assert sd[1] < 1.5 * sd[2]  # a mixture may be wider than either
    assert {"hoeting-1999", "mackay-1992"} <= set(auto.calibration.provenance.method)
    assert "hoeting-1999" not in without.calibration.provenance.method


def test_a_file_that_ends_in_the_middle_is_named() -> None:
    samples, made = faulty(truncated=(4,))
    fit = fit_thermal(samples, KNOWN, stations=turns_of(made), **COARSE)
    assert names(fit) & {"short recording", "one direction"}
    assert "station 4" in fit.status.lower()
    assert worst(fit, made) < 40.0


def test_kelvin_is_named_and_taken_off() -> None:
    samples, made = faulty(kelvin=True)
    fit = fit_thermal(samples, KNOWN, stations=turns_of(made), **COARSE)
    assert "kelvin" in names(fit)
    assert fit.calibration.validity.temperature_C == pytest.approx((-10.0, 50.0), abs=1.0)
    assert worst(fit, made) < 25.0


def test_anomalies_are_counted_where_they_are() -> None:
    made = campaign(8, noise=100.0)
    field = made.samples.field.copy()
    rows = np.array([50, 5000, 5100])
    field[rows] += 20_000.0
    fit = fit_thermal(made.samples.with_columns(field=field), KNOWN, **WIDE)
    assert sum(a.count for a in fit.anomalies) == 3
    assert {a.station for a in fit.anomalies} == set(made.samples.station[rows].astype(int))
    assert sorted(np.concatenate([a.times for a in fit.anomalies])) == pytest.approx(
        sorted(made.samples.time[rows])
    )


def test_a_small_range_is_named() -> None:
    made = campaign(9, n=1200)
    rows = np.abs(made.samples.temperature - 20.0) < 3.0
    fit = fit_thermal(made.samples.select(rows), KNOWN, degree=1)
    assert "small range" in names(fit)
    rows = np.abs(made.samples.temperature - 20.0) < 0.2
    with pytest.raises(ag.CoverageError, match="only runs from"):
        fit_thermal(made.samples.select(rows), KNOWN)


@pytest.mark.parametrize(
    ("changed", "settings", "error", "words"),
    [
        ({"temperature": None}, {}, ag.LogError, "no temperature"),
        ({"station": None}, {}, ag.LogError, "no station"),
        ({"field": np.ones((7200, 3))}, {}, ag.CoverageError, "stuck"),
        ({}, {"degree": 12}, ag.AgonicError, "degree 12"),
        ({}, {"stations": "some"}, ag.AgonicError, "'some'"),
        ({}, {"bin_width_C": -1.0}, ag.AgonicError, "above zero"),
        ({}, {"rate": "perhaps"}, ag.AgonicError, "perhaps"),
    ],
)
def test_what_is_wrong_is_told(changed, settings, error, words) -> None:
    samples = campaign(0).samples.with_columns(**changed)
    with pytest.raises(error, match=words):
        fit_thermal(samples, KNOWN, **settings)


# ---- a vector reference, like a coil -------------------------------------------------------------


COIL_AT = np.linspace(24.0, 66.0, 9)


@pytest.mark.slow
def test_a_coil_gives_both_gain_and_bias_terms() -> None:
    """Affine with linear temperature took AERO-VISTA's sensors from 4310 to 72 nT."""
    made = simulate_thermal_coil(seed=5)
    known = made.reference.values
    fit = fit_thermal(made.samples, made.reference, degree="auto")
    left = ag.apply(fit.calibration, made.samples).field - known
    assert rms(made.samples.field - known) == pytest.approx(4310.0, rel=0.15)
    assert rms(left) < 72.0
    assert (fit.reference_kind, fit.calibration.gauge, fit.calibration.degree) == (
        "vector",
        "free",
        1,
    )
    assert fit.noise == pytest.approx(70.0, rel=0.03)
    assert fit.variances.shape == (1, 6)
    assert fit.variances[0, 0] > 50.0 * fit.variances[0, 1]
    assert fit.variances[0, 1:] == pytest.approx(np.full(5, 70.0**2), rel=0.05)
    without = fit_thermal(made.samples, made.reference, degree=0)
    assert rms(ag.apply(without.calibration, made.samples).field - known) > 400.0
    others = np.linspace(24.5, 65.5, 300)  # temperatures between: the truth and not the noise
    clean = make_readings(made.truth, known[::13][:300], others, np.zeros(300))
    assert rms(fit.calibration.correct(clean, temperature=others) - known[::13][:300]) < 25.0


@pytest.mark.slow
def test_a_coil_s_standard_errors_are_honest_at_every_temperature() -> None:
    z = []
    for seed in range(12):
        made = simulate_thermal_coil(800, seed=seed)
        found = fit_thermal(made.samples, made.reference, degree=2).calibration
        error = np.hstack(
            [
                found.bias_at(COIL_AT) - made.truth.bias_at(COIL_AT),
                (found.matrix_at(COIL_AT) - made.truth.matrix_at(COIL_AT)).reshape(-1, 9),
            ]
        )
        sd = found.sd_at(COIL_AT)
        order = [0, 1, 2, 3, 7, 11, 4, 5, 8, 6, 9, 10]  # xx yy zz xy xz yz yx zx zy
        z.append(error[:, order] / sd)
    assert np.sqrt(np.mean(np.square(z), axis=(0, 2))) == pytest.approx(np.ones(9), abs=0.12)
    assert np.sqrt(np.mean(np.square(z), axis=(0, 1))) == pytest.approx(np.ones(12), abs=0.35)


def test_a_coil_is_no_worse_than_plain_least_squares_on_unseen_readings() -> None:
    """A bias that lags spoils whole stretches: they are no outliers, a few spikes are."""

    def off_by(lag: float, spikes: float) -> tuple[float, float]:
        made = simulate_thermal_coil(2000, gain=0.005, gain_drift=0.002, seed=4)
        rng, level = np.random.default_rng(5), made.samples.temperature
        field, scale = made.reference.values, (level[:, None] - 45.0) / 21.0
        slow = lag * (np.gradient(level) / np.abs(np.gradient(level)).max())[:, None] ** 3
        raw = made.samples.field + slow * [1.0, -0.6, 0.4] * (1 + field / 50_000.0)
        kept = rng.random(len(raw)) > spikes
        raw[~kept] += 3000.0 * rng.standard_normal((int((~kept).sum()), 3))
        seen = np.arange(2000) % 500 < 300
        parts = [scale**d * f for d in range(3) for f in (1.0, *(field.T[:, :, None] / 5e4))]
        design = np.concatenate([np.broadcast_to(p, (2000, 1)) for p in parts], axis=1)
        solution = np.linalg.lstsq(design[seen], raw[seen], rcond=None)[0]
        plain = (raw - design @ solution)[~seen & kept]
        samples = ag.Samples(field=raw[seen], temperature=level[seen])
        fit = fit_thermal(samples, ag.Reference.vector(field[seen], frame="m"), degree=2)
        left = fit.calibration.correct(raw, temperature=level) - field
        return rms(left[~seen & kept]), rms(plain)

    ours, plain = off_by(1000.0, 0.0)
    assert ours < 1.02 * plain
    ours, plain = off_by(0.0, 0.03)
    assert ours < 0.8 * plain


def test_a_coil_that_drives_two_axes_only_is_refused() -> None:
    made = simulate_thermal_coil()
    flat = made.reference.values * [1.0, 1.0, 0.0]
    with pytest.raises(ag.CoverageError, match="hardly changes"):
        fit_thermal(made.samples, ag.Reference.vector(flat, frame="b"))


def test_twelve_is_what_known_means() -> None:
    made = campaign(10)
    described = {
        k: Rotation.from_matrix(r) for k, r in enumerate(list_standard_rotations(), start=1)
    }
    known = fit_thermal(made.samples, KNOWN, stations="known", **WIDE)
    given = fit_thermal(made.samples, KNOWN, stations=described, **WIDE)
    assert given.calibration.bias == pytest.approx(known.calibration.bias, abs=1e-6)


@pytest.mark.slow
def test_station_within_what_the_fixture_promises_is_no_doubt() -> None:
    made = simulate_campaign("MMC5883MA", seed=4, rate_Hz=0.02)
    samples = made.campaign.samples("MMC5883MA")
    stations = made.description.rotations
    settings = {"stations": stations, "bin_width_C": 2.0}
    fit = fit_thermal(samples, ag.Reference.constant(48_000.0), **settings)
    assert fit.fixture is not None
    assert max(fit.fixture.turned_deg.values()) > 3.0
    assert fit.verdict == "good"
    fit = fit_thermal(samples, ag.Reference.constant(48_000.0), fixture_sd_deg=0.3, **settings)
    assert "fixture" in [finding.name for finding in fit.findings]
