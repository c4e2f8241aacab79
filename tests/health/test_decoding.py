"""Numbers that a logger decoded wrongly: each fault is named and undone, or refused."""

from collections.abc import Callable

import numpy as np
import pytest

import agonic as ag
from agonic.cli import run
from agonic.errors import CoverageError
from agonic.health.decoding import read_as, undo_decoding
from agonic.health.miscoding import KINDS
from agonic.simulation import simulate

COUNTS_PER_NT = (0.016, 0.0684)
Fault = Callable[[np.ndarray], np.ndarray]


def wrap(field: np.ndarray, period: float, low: float) -> np.ndarray:
    return (field - low) % period + low


def exchange(field: np.ndarray) -> np.ndarray:
    words = field.astype(int) % 65536
    return wrap((words & 255) * 256 + (words >> 8), 65536, -32768)


def take_low_before(field: np.ndarray) -> np.ndarray:
    low = field % 256
    return field - low + np.vstack([low[:1], low[:-1]])


def mark(value: float) -> Fault:
    def change(field: np.ndarray) -> np.ndarray:
        rows = np.random.default_rng(5).random(len(field)) < 0.01
        return np.where(rows[:, None], value, field)

    return change


FAULTS: dict[str, tuple[Fault, str]] = {
    "unsigned": (lambda f: wrap(f, 65536, 0), "signed numbers were printed as unsigned"),
    "wrapped": (lambda f: wrap(f, 1024, -512), "wrap at the end of their range"),
    "exchanged": (exchange, "the two bytes of each number were exchanged"),
    "signed low byte": (lambda f: f - 256 * (f % 256 >= 128), "the low byte was read as signed"),
    "low byte before": (take_low_before, "the low byte is that of the reading before"),
    "-4096": (mark(-4096), "a marker that stands for no reading"),
    "-32768": (mark(-32768), "a marker that stands for no reading"),
    "65535": (mark(65535), "a marker that stands for no reading"),
    "1e12": (mark(1e12), "over 10000 times as large as most"),
}


def count(motion: str, seed: int, per_nT: float, **settings) -> tuple[ag.Samples, np.ndarray]:
    """Readings in whole counts of a sensor, and its true bias."""
    made = simulate(motion, n=2000, noise=150.0, seed=seed, **settings)
    bias = np.array([9_000.0, -6_000.0, 3_000.0])
    field = np.round((made.samples.field - made.truth.bias + bias) * per_nT)
    return ag.Samples(time=made.samples.time, field=field, unit="raw"), bias * per_nT


@pytest.mark.parametrize("per_nT", COUNTS_PER_NT)
@pytest.mark.parametrize("name", FAULTS)
def test_each_fault_is_named_and_the_true_calibration_found(name: str, per_nT: float) -> None:
    damage, words = FAULTS[name]
    samples, bias = count("tumble", 3, per_nT, pace_s=3.0)
    if name == "wrapped":
        per_nT = 0.0109
        samples, bias = count("tumble", 3, per_nT, pace_s=3.0)
    result = ag.calibrate(samples.with_columns(field=damage(samples.field)))
    assert words in result.status.replace("A marker", "a marker")
    assert result.verdict != "refused"
    assert np.linalg.norm(result.calibration.bias - bias) < 4 * np.linalg.norm(result.fit.sd[:3])


@pytest.mark.parametrize("name", ["unsigned", "exchanged", "signed low byte"])
def test_rows_in_no_order_show_it_by_their_ellipsoid(name: str) -> None:
    damage, words = FAULTS[name]
    samples, _ = count("sphere", 1, 0.016)
    _, _, findings = undo_decoding(samples.with_columns(field=damage(samples.field)))
    assert words in findings[0].what


def test_one_axis_in_steps_of_its_own_is_read_in_them() -> None:
    made = simulate("tumble", n=3000, noise=150.0, seed=1, pace_s=3.0).samples.field.round(1)
    count = np.round(made[:, 0] / 2)
    damaged = made.copy()
    damaged[:, 0] = 2 * (count - 256 * (count % 256 >= 128))
    undone, _, (finding,) = undo_decoding(ag.Samples(field=damaged))
    assert "the low byte was read as signed" in finding.what
    assert np.abs(undone.field - made).max() < 2


def test_two_faults_are_undone_one_after_the_other() -> None:
    samples, _ = count("tumble", 2, 0.016)
    damaged = mark(-4096)(FAULTS["unsigned"][0](samples.field))
    undone, kept, findings = undo_decoding(samples.with_columns(field=damaged))
    assert {finding.name for finding in findings} == {"decoding", "outliers"}
    assert np.array_equal(undone.field, samples.field[kept])


def test_a_low_byte_whose_sign_spread_is_left_out() -> None:
    samples, _ = count("tumble", 2, 0.0684, pace_s=3.0)
    low = samples.field % 256
    damaged = np.where(low >= 128, low - 256, samples.field) * [1, 0, 0] + samples.field * [0, 1, 1]
    undone, kept, (finding,) = undo_decoding(samples.with_columns(field=damaged))
    assert "sign of the low byte was extended" in finding.what
    assert np.array_equal(undone.field, samples.field[kept])


@pytest.mark.parametrize("motion", ["tumble", "sphere", "hand", "circle", "boat", "car", "static"])
@pytest.mark.parametrize("per_nT", [1 / 150, 0.016, 1.0])
def test_logs_without_damage_are_taken_as_they_are(motion: str, per_nT: float) -> None:
    for seed, offset in enumerate((0, 32_768, 131_072)):
        samples, _ = count(motion, seed, per_nT)
        samples = samples.with_columns(field=samples.field + offset)
        assert undo_decoding(samples).samples is samples


def test_a_fit_of_damaged_readings_is_refused_by_its_name() -> None:
    samples, _ = count("tumble", 2, 0.016)
    fit = ag.fit_ellipsoid(samples.with_columns(field=FAULTS["unsigned"][0](samples.field)))
    assert fit.verdict == "refused"
    assert "printed as unsigned" in fit.status


def test_the_inverses_are_those_of_the_faults() -> None:
    numbers = np.array([5.0, 40_000.0, 65_535.0, 300.0])
    undone = {kind.word: kind.undo(numbers) for kind in KINDS if kind.word}
    assert undone["int16"].tolist() == [5.0, -25_536.0, -1.0, 300.0]
    assert undone["swapped"].tolist() == [1280.0, 16_540.0, -1.0, 11_265.0]
    assert undone["carried"].tolist() == [5.0, 40_000.0, 65_791.0, 300.0]
    assert undone["advanced"][:3].tolist() == [64.0, 40_191.0, 65_324.0]
    samples = ag.Samples(field=np.tile(numbers[:3], (3, 1)), unit="raw")
    assert read_as(samples, "int16").field[0].tolist() == [5.0, -25_536.0, -1.0]


def write(path, head: str, table: np.ndarray) -> str:
    np.savetxt(path, table, fmt="%.4f", delimiter=",", header=head, comments="")
    return str(path)


def test_as_reads_the_numbers_as_they_are_named(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    samples, _ = count("tumble", 2, 0.016)
    log = write("log.csv", "x,y,z", samples.field % 65536)
    assert run(["calibrate", log]) == 1
    assert "--as int16" in capsys.readouterr().out
    assert run(["calibrate", log, "--as", "int16"]) == 0
    assert run(["calibrate", log, "--as", "bcd"]) == 2


def test_an_accelerometer_alone_is_asked_about(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    felt = simulate("tumble", n=1000, seed=1).samples.acceleration / 9.80665
    felt = felt + np.random.default_rng(0).normal(size=felt.shape) * 0.005
    log = write("log.csv", "Time,X,Y,Z", np.column_stack([np.arange(1000) / 50, felt]))
    assert run(["calibrate", log]) == 1
    assert "as an accelerometer reads gravity" in " ".join(capsys.readouterr().out.split())
    assert run(["calibrate", log, "--columns", "time_s=Time,x=X,y=Y,z=Z"]) == 0


@pytest.mark.parametrize("still", [0.0, 31.5])
def test_a_magnetometer_that_never_changes_is_told_so(still: float, tmp_path, capsys) -> None:
    made = simulate("tumble", n=600, seed=1).samples
    table = np.column_stack(
        [made.time, np.full((600, 3), still), made.acceleration, made.rotation_rate]
    )
    axes = [f"{name}_{axis}_{unit}" for name, unit in SENSORS for axis in "xyz"]
    log = write(tmp_path / "log.csv", ",".join(["time_s", *axes]), table)
    assert run(["calibrate", log, "-o", str(tmp_path / "out")]) == 1
    assert "the readings never change" in " ".join(capsys.readouterr().out.lower().split())


SENSORS = (("mag", "uT"), ("acc", "m_s2"), ("gyro", "rad_s"))


def test_a_place_far_from_the_logs_own_is_refused(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["simulate", "rover", "-o", "rover.csv"]) == 0
    capsys.readouterr()
    assert run(["calibrate", "rover.csv", "--at", "48,11"]) == 2
    assert "the log's own positions are 616 km from --at" in capsys.readouterr().err
    assert run(["calibrate", "rover.csv", "--at", "52.1,5.3"]) == 0


def test_an_axis_of_two_values_is_no_fault_of_a_steady_one() -> None:
    for seed in range(8):
        field = np.zeros((363, 3))
        field[:, 0] = 81_117.28866447 * np.repeat(
            np.random.default_rng(seed).integers(0, 2, 33), 11
        )
        measured = undo_decoding(ag.Samples(time=np.arange(363) / 10.0, field=field))
        assert np.ptp(measured.samples.field[:, 0]) == np.ptp(field)


@pytest.mark.parametrize("start", [0, 1, 5])
def test_a_sensor_that_freezes_after_its_start_never_changes(start) -> None:
    field = np.zeros((600, 3))
    field[:start] = np.random.default_rng(1).normal(size=(start, 3)) * 30_000.0
    with pytest.raises(CoverageError, match="never change"):
        undo_decoding(ag.Samples(field=field, unit="nT"))


def test_numbers_of_24_bits_and_a_high_byte_that_lags_are_put_back() -> None:
    made = ag.simulate("tumble", n=1500, noise=100.0, seed=4, pace_s=3.0).samples
    counts = np.round(made.field * 0.075)
    wide = undo_decoding(ag.Samples(field=counts % 2.0**24, unit="raw")).samples.field
    assert np.array_equal(wide, counts)
    low = counts % 256
    high = counts - low
    late = np.vstack([high[:1], high[:-1]]) + low
    found = undo_decoding(ag.Samples(field=late, unit="raw"))
    assert "high byte is that of the reading before" in found.findings[0].what
    assert np.array_equal(found.samples.field, counts[:-1])


def test_a_log_mostly_at_rest_with_one_odd_reading_is_not_refused_for_its_rest() -> None:
    """Most of the readings are one place, and no ellipsoid of their own."""
    turned, rng = simulate("hand", seed=3).samples.field[:1500], np.random.default_rng(3)
    pause = turned[700] + 100.0 * rng.normal(size=(6000, 3))
    whole = np.round(np.concatenate([turned[:700], pause, turned[700:]]) / 75.94) * 75.94
    whole[2000, 2] = -54.8
    found = undo_decoding(ag.Samples(field=whole, time=np.arange(len(whole)) / 50.0))
    assert len(found.samples) >= len(whole) - 2
    assert ag.calibrate(found.samples, ag.Reference.constant(50_000)).verdict == "good"
