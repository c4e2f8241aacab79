"""A calibration over temperature wherever a calibration goes, as a person would run it."""

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.chain import Chain
from agonic.calibration.setup import Compass, Setup
from agonic.calibration.thermal import Thermal
from agonic.cli import run
from agonic.exports.csv import write_csv
from agonic.field import wmm
from agonic.files.calibration import save
from agonic.files.setup import save_setup
from agonic.headings.compute import heading
from agonic.provenance import Provenance
from agonic.samples import Samples
from agonic.simulation import simulate
from agonic.simulation.thermal import make_readings, random_drifting

NOISE = 100.0
WHERE = {"latitude_deg": 52.0, "longitude_deg": 5.0, "altitude_m": 100.0}
WHEN = ("--date", "2026-03-01")
HERE = wmm().at(*WHERE.values(), WHEN[1])
SEEN = simulate(
    "flight",
    n=1200,
    seed=2,
    noise=0.0,
    calibration=Affine(bias=[0, 0, 0], matrix=np.eye(3)),
    stray_nT_A=(0.0, 0.0, 0.0),
    magnitude=float(HERE.magnitude),
    inclination_deg=float(HERE.inclination_deg),
    declination_deg=float(HERE.declination_deg),
    **WHERE,
).samples


def thermal() -> Thermal:
    """A sensor of which bias and matrix are known to 20 nT and 0.0005."""
    made = random_drifting(np.random.default_rng(5), per_rate=2_000.0, sensor="MAG1")
    sd = np.array(
        [
            1e3 if name.startswith("rate") else 20.0 if name.startswith("bias") else 5e-4
            for name in made.parameters
        ]
    )
    return replace(
        made,
        covariance=np.diag(sd**2),
        noise=NOISE,
        magnitude=float(HERE.magnitude),
        provenance=Provenance(method=("nikolaev-2023",)),
    )


def flown(truth: Thermal, low_C: float, high_C: float) -> Samples:
    """What the sensor read while it grew warmer."""
    level = np.linspace(low_C, high_C, len(SEEN))
    raw = make_readings(truth, SEEN.field, level, np.gradient(level, SEEN.time))
    raw += NOISE * np.random.default_rng(1).normal(size=raw.shape)
    return SEEN.with_columns(field=raw, temperature=level, name=truth.sensor)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A calibration, alone, in a chain and in a setup; flights inside and outside its range."""
    there = tmp_path_factory.mktemp("recorded")
    truth = thermal()
    turn = Alignment(rotation=Rotation.identity(), frame_in="m", frame_out="b", sensor="MAG1")
    save(truth, there / "mag.json")
    save(Chain(steps=(truth, turn)), there / "chain.json")
    save_setup(
        Setup(compasses=(Compass(calibration=truth),), declination_deg=2.7), there / "setup.toml"
    )
    write_csv(flown(truth, -5.0, 45.0), there / "warm.csv")
    write_csv(flown(truth, 20.0, 70.0), there / "hot.csv")
    write_csv(flown(truth, 0.0, 1.0).with_columns(temperature=None), there / "bare.csv")
    write_csv(flown(truth, 0.0, 1.0).with_columns(time=None), there / "timeless.csv")
    return there


@pytest.fixture(autouse=True)
def folder(recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that a test works in, with copies of these."""
    monkeypatch.chdir(tmp_path)
    return Path(shutil.copytree(recorded, tmp_path, dirs_exist_ok=True))


def answer(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, dict, str]:
    capsys.readouterr()
    status = run([*arguments, "--json"])
    said = capsys.readouterr()
    return status, json.loads(said.out), said.err


def column(file: str, *names: str) -> np.ndarray:
    with Path(file).open() as stream:
        rows = list(csv.DictReader(stream))
    return np.array([[float(row[name]) for name in names] for row in rows])


@pytest.mark.parametrize("cal", ["mag.json", "chain.json"])
def test_apply_corrects_with_the_temperature_of_each_reading(cal, capsys) -> None:
    status, said, err = answer(capsys, "apply", cal, "warm.csv", "-o", "out.csv")
    assert (status, said["unit"], err) == (0, "nT", "")
    field = column("out.csv", "mag_x_nT", "mag_y_nT", "mag_z_nT")
    error = field - SEEN.field
    assert np.sqrt(np.mean(error**2)) == pytest.approx(NOISE, rel=0.05)
    assert np.abs(error.mean(axis=0)).max() < 4 * NOISE / np.sqrt(len(error))


@pytest.mark.parametrize("cal", ["mag.json", "chain.json"])
def test_verify_passes_inside_the_range(cal, capsys) -> None:
    status, said, err = answer(capsys, "verify", cal, "warm.csv", *WHEN)
    assert (status, said["verdict"], err) == (0, "good", "")
    assert said["spread_after"] < 0.1 * said["spread_before"]


@pytest.mark.filterwarnings("always::agonic.errors.AgonicWarning")
@pytest.mark.parametrize(
    "words",
    [
        ("apply", "mag.json", "hot.csv", "-o", "out.csv"),
        ("verify", "mag.json", "hot.csv"),
        ("heading", "setup.toml", "hot.csv", "-o", "h.csv", *WHEN),
        ("report", "mag.json", "hot.csv", "-o", "r.html", *WHEN),
    ],
)
def test_temperatures_outside_the_range_are_warned_of(words, capsys) -> None:
    _, _, err = answer(capsys, *words)
    assert err.count("\n") == 1
    assert "from 50.5 to 70.0 °C lie outside -10.0 to 50.0 °C" in err


@pytest.mark.parametrize("log", ["bare.csv", "timeless.csv"])
@pytest.mark.parametrize(
    "words",
    [
        ("apply", "mag.json", "{}", "-o", "out.csv"),
        ("verify", "chain.json", "{}"),
        ("heading", "setup.toml", "{}", "-o", "h.csv", *WHEN),
        ("report", "mag.json", "{}"),
    ],
)
def test_a_log_without_temperature_or_time_says_what_is_needed(words, log, capsys) -> None:
    capsys.readouterr()
    assert run([word.format(log) for word in words]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    wanted = {"bare.csv": "temperature", "timeless.csv": "time"}[log]
    assert f"the calibration of MAG1 needs {wanted}" in said.err


@pytest.mark.parametrize("setup", ["setup.toml", "mag.json", "chain.json"])
def test_headings_come_near_the_truth_by_their_standard_error(setup, capsys) -> None:
    asked = ("heading", setup, "warm.csv", "-o", "h.csv", "--each-row", *WHEN)
    status, said, _ = answer(capsys, *asked)
    assert status == 0
    assert said["trusted"] == said["n"] == len(SEEN)
    true = column("h.csv", "true_deg")[:, 0]
    error = (true - SEEN.heading_deg + 180.0) % 360.0 - 180.0
    assert said["random_sd_deg"] == pytest.approx(np.std(error), rel=0.3)


def test_the_standard_error_is_that_of_the_affine_which_it_is_at_a_temperature() -> None:
    truth = replace(thermal(), rate=None, covariance=None)
    a = len(truth.parameters)
    covariance = np.asarray(thermal().covariance)[:a, :a].copy()
    covariance[0, 1] = covariance[1, 0] = -200.0  # powers of one coefficient depend on each other
    truth = replace(truth, covariance=covariance)
    level = 38.0
    samples = flown(truth, level, level)
    warm, held = (
        heading(
            samples, Setup(compasses=(Compass(calibration=c),), declination_deg=2.7), smooth=False
        )
        for c in (truth, truth.at(level))
    )
    assert warm.true_deg == pytest.approx(held.true_deg, abs=1e-9)
    assert warm.sd_deg == pytest.approx(held.sd_deg, rel=1e-9)
    assert warm.random_sd_deg == pytest.approx(held.random_sd_deg, rel=1e-9)


def test_the_rate_is_part_of_the_standard_error() -> None:
    truth = thermal()
    sure = np.asarray(truth.covariance).copy()
    sure[-3:, -3:] = 0.0
    samples = flown(truth, -5.0, 45.0)
    sds = [
        heading(
            samples,
            Setup(
                compasses=(Compass(calibration=replace(truth, covariance=c)),),
                declination_deg=2.7,
                tilt_sd_deg=0.0,
            ),
            smooth=False,
        ).sd_deg
        for c in (np.asarray(truth.covariance), sure)
    ]
    rate = np.mean(np.gradient(samples.temperature, samples.time))
    assert np.all(sds[0] > sds[1])
    more = np.sqrt(sds[0] ** 2 - sds[1] ** 2)
    horizontal = float(HERE.magnitude) * np.cos(np.radians(float(HERE.inclination_deg)))
    assert np.median(more) == pytest.approx(np.degrees(1e3 * rate / horizontal), rel=0.15)


@pytest.mark.parametrize("cal", ["mag.json", "chain.json"])
def test_a_calibration_is_reported_without_a_log(cal, capsys) -> None:
    status, said, _ = answer(capsys, "report", cal)
    assert (status, said["method"], said["degree"]) == (0, "thermal", 3)
    assert said["range_C"] == [-10.0, 50.0]
    page = Path(said["files"][0]).read_text()
    assert (
        page.count('class="plot small"') == 15
    )  # nine coefficients, three scale factors, three angles
    assert "−10.0 to 50.0 °C" in page


def test_a_calibration_is_reported_on_a_log(capsys) -> None:
    status, said, _ = answer(capsys, "report", "mag.json", "warm.csv", "-o", "r.html", *WHEN)
    assert (status, said["verdict"]) == (0, "good")
    assert {check["passed"] for check in said["checks"]} <= {True, None}
    page = Path("r.html").read_text()
    assert "Magnitude over temperature" in page
    assert "extrapolated (marked" not in page


@pytest.mark.filterwarnings("always::agonic.errors.AgonicWarning")
def test_a_report_marks_what_was_extrapolated(capsys) -> None:
    run(["report", "mag.json", "hot.csv", "-o", "hot.html", *WHEN])
    page = Path("hot.html").read_text()
    assert "468 of them lie outside −10.0 to 50.0 °C" in page
    assert page.count('class="key extrapolated"') == 2


def test_the_method_is_cited(capsys) -> None:
    assert run(["cite", "mag.json"]) == 0
    assert "SamSat-ION" in capsys.readouterr().out
