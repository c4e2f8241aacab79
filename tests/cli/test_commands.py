"""Every command as a person or a script would run it, from an empty folder."""

import json
import shutil
from contextlib import chdir
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.cli import COMMANDS, run
from tests.command_line import answer

pytestmark = pytest.mark.usefixtures("empty_folder")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a log and its calibration, made once by the commands themselves."""
    folder = tmp_path_factory.mktemp("made")
    with chdir(folder):
        assert run(["simulate", "tumble", "-o", "log.csv", "-n", "1500"]) == 0
        assert run(["fit", "ellipsoid", "log.csv", "--field", "50000", "-o", "cal.json"]) == 0
    return folder


@pytest.fixture
def log(made: Path) -> str:
    for name in ("log.csv", "log.truth.json"):
        shutil.copy2(made / name, name)
    return "log.csv"


@pytest.fixture
def cal(made: Path, log: str) -> str:
    return str(shutil.copy2(made / "cal.json", "cal.json"))


def test_calibrate_finds_the_truth_and_writes_what_it_says(log, capsys) -> None:
    status, said = answer(capsys, "calibrate", log, "--field", "50000")
    assert status == 0
    assert said["schema"] == "agonic/calibrate@1"
    (sensor,) = said["sensors"]
    truth = json.loads(Path("log.truth.json").read_text())["calibration"]
    error = np.subtract(sensor["bias_nT"], truth["bias"])
    assert np.all(np.abs(error) < 4 * np.array(sensor["bias_sd_nT"]))
    assert sensor["verdict"] == "good"
    assert sensor["spread_after"] < 0.01 < 0.1 < sensor["spread_before"]
    assert {Path(f).suffix for f in sensor["files"]} == {".json", ".h", ".toml", ".html"}
    assert all(Path(f).stat().st_size > 150 for f in sensor["files"])


def test_the_surface_of_a_sensor_record_is_stable(log, capsys) -> None:
    promised = {
        "sensor",
        "method",
        "verdict",
        "status",
        "n",
        "bias_nT",
        "bias_sd_nT",
        "matrix",
        "noise_nT",
        "spread_before",
        "spread_after",
        "residual_rms_nT",
        "heading_sd_deg",
        "files",
    }
    _, calibrated = answer(capsys, "calibrate", log)
    _, fitted = answer(capsys, "fit", "ellipsoid", log)
    from agonic.recording.values import FIELDS

    assert tuple(calibrated["sensors"][0]) == FIELDS
    assert promised <= calibrated["sensors"][0].keys()
    assert promised <= fitted.keys()


def test_a_refused_sensor_is_exit_status_1_and_leaves_no_calibration(capsys) -> None:
    run(["simulate", "static", "-o", "still.csv"])
    status, said = answer(capsys, "calibrate", "still.csv", "-o", "out")
    assert status == 1
    assert said["sensors"][0]["verdict"] == "refused"
    assert "did not turn" in said["sensors"][0]["status"]
    assert [path.name for path in Path("out").iterdir()] == ["report.html"]


@pytest.mark.slow
def test_a_refusal_names_files_that_an_earlier_run_left(log, capsys) -> None:
    assert run(["calibrate", log, "-o", "out"]) == 0
    run(["simulate", "static", "-o", "still.csv"])
    _, said = answer(capsys, "calibrate", "still.csv", "-o", "out")
    stale = said["sensors"][0]["warnings"][0]
    assert stale.startswith("mag.h, mag.json, setup.toml: of an earlier run")


def test_a_run_over_one_sensor_names_what_a_run_over_all_left(capsys) -> None:
    ag = pytest.importorskip("agonic")
    first, other = (ag.simulate("sphere", n=300, seed=seed).samples for seed in (1, 2))
    columns = {f"{name}_{axis}_nT": one.field[:, k]
               for name, one in (("mag", first), ("mag2", other))
               for k, axis in enumerate("xyz")}  # fmt: skip
    head, rows = ",".join(columns), zip(*columns.values(), strict=True)
    Path("two.csv").write_text("\n".join([head, *(",".join(map(str, row)) for row in rows)]))
    _, both = answer(capsys, "calibrate", "two.csv", "-o", "out")
    assert not any("earlier run" in w for one in both["sensors"] for w in one["warnings"])
    names = [one["sensor"] for one in both["sensors"]]
    Path("out/notes.json").write_text("{}")  # not agonic's
    _, one = answer(capsys, "calibrate", "two.csv", "-s", names[0], "-o", "out")
    assert len(names) == 2
    stale = [w for w in one["sensors"][0]["warnings"] if "earlier run" in w]
    assert stale == [
        f"{names[1]}.h, {names[1]}.json: of an earlier run, not of this report; delete them"
    ]


def test_a_sensor_that_cannot_be_fitted_is_a_whole_record_too(capsys) -> None:
    from agonic.recording.values import FIELDS

    Path("stuck.csv").write_text("mag_x_nT,mag_y_nT,mag_z_nT\n" + "1,2,3\n" * 50)
    status, said = answer(capsys, "calibrate", "stuck.csv")
    (sensor,) = said["sensors"]
    assert status == 1
    assert tuple(sensor) == FIELDS
    assert sensor["verdict"] == "refused"
    assert "never change" in sensor["status"]


@pytest.mark.filterwarnings("default")
def test_warnings_are_one_line_too(log, capsys) -> None:
    status = run(["field", "--at", "50,5", "--date", "2031-06-01", "--model", "igrf"])
    said = capsys.readouterr()
    assert status == 0
    assert said.err.startswith("agonic: warning: ")
    assert said.err.count("\n") == 1


def test_version_is_the_package_s(capsys) -> None:
    import agonic

    assert run(["--version"]) == 0
    assert capsys.readouterr().out == f"agonic {agonic.__version__}\n"


def test_raw_units_stay_raw_and_say_so(capsys) -> None:
    u = np.random.default_rng(0).normal(size=(400, 3))
    np.savetxt("cloud.txt", 300 * u / np.linalg.norm(u, axis=1, keepdims=True) + [10, -20, 5])
    status, said = answer(capsys, "calibrate", "cloud.txt")
    (sensor,) = said["sensors"]
    assert status == 0
    assert sensor["unit"] == "raw"
    assert sensor["bias_nT"] is None
    assert sensor["bias"] == pytest.approx([10, -20, 5], abs=1e-6)
    assert sensor["magnitude"] == pytest.approx(300)


def test_info_names_what_is_odd(capsys) -> None:
    run(["simulate", "tumble", "-o", "odd.csv", "--clip", "60000", "--step", "100"])
    status, said = answer(capsys, "info", "odd.csv")
    assert status == 0
    (sensor,) = said["sensors"]
    assert sensor["rows"] == 3000
    assert sensor["rate_Hz"] == pytest.approx(50)
    assert sensor["step"] == pytest.approx(100)
    assert "clipping" in {finding["name"] for finding in sensor["findings"]}


def test_verify_tells_own_data_from_other_data(cal, log, capsys) -> None:
    status, own = answer(capsys, "verify", cal, log, "--field", "50000")
    assert (status, own["verdict"], own["own_data"]) == (0, "good", True)
    run(["simulate", "tumble", "-o", "stranger.csv", "--seed", "7"])
    status, other = answer(capsys, "verify", cal, "stranger.csv", "--field", "50000")
    assert (status, other["verdict"], other["own_data"]) == (1, "check", False)
    assert [c["name"] for c in other["checks"] if c["passed"] is False]


def test_apply_writes_the_corrected_field(cal, log, capsys) -> None:
    from agonic import read

    status, said = answer(capsys, "apply", cal, log, "-o", "field.csv")
    assert (status, said["n"]) == (0, 1500)
    size = np.linalg.norm(read("field.csv").field, axis=1)
    assert size.mean() == pytest.approx(50_000, rel=1e-3)
    assert size.std() < 300


def test_apply_writes_parquet_where_the_name_says_so(cal, log, capsys) -> None:
    pytest.importorskip("pyarrow")
    from agonic import read

    for name in ("field.csv", "field.parquet"):
        assert answer(capsys, "apply", cal, log, "-o", name)[0] == 0
    assert Path("field.parquet").read_bytes()[:4] == b"PAR1"
    assert np.array_equal(read("field.parquet").field, read("field.csv").field)
    assert run(["apply", cal, log, "-o", "field.xlsx"]) == 2
    assert "would be a text table; name it .csv" in capsys.readouterr().err


@pytest.mark.parametrize("target", ["ardupilot", "px4", "c", "motioncal", "matlab", "ros", "table"])
def test_export_writes_every_target(cal, target, capsys) -> None:
    status, said = answer(capsys, "export", cal, "--to", target)
    assert status == 0
    assert Path(said["files"][0]).stat().st_size > 60


def test_report_finds_its_own_log(cal, capsys) -> None:
    status, said = answer(capsys, "report", cal, "--field", "50000")
    assert (status, said["verdict"]) == (0, "good")
    assert "<html" in Path("cal.html").read_text()


def test_cite_names_sources_and_inputs(cal, capsys) -> None:
    _, said = answer(capsys, "cite", cal)
    assert any("Huber" in text for text in said["sources"].values())
    assert said["inputs"][0]["name"] == "log.csv"


def test_a_chain_is_reported_and_cites_what_its_steps_are_made_by(cal, capsys) -> None:
    made = ag.load(cal)
    turn = Rotation.from_euler("z", 90, degrees=True)
    star = ag.alignment.Alignment(
        rotation=turn,
        covariance=1e-10 * np.eye(3),
        frame_in=made.frame_out,
        frame_out="s",
        provenance=ag.Provenance(
            settings={"reference": "IGRF-14 at 52°, 5°"}, method=("iers-2010",)
        ),
    )
    ag.save(ag.Chain(steps=(made, star)), Path("chain.json"))
    status, said = answer(capsys, "report", "chain.json", "--field", "50000")
    assert (status, said["verdict"]) == (0, "good")
    _, own = answer(capsys, "report", cal, "--field", "50000")
    assert said["bias_sd"] == pytest.approx(own["bias_sd"], rel=0.01)
    _, cited = answer(capsys, "cite", "chain.json")
    assert {"huber-1981", "iers-2010", "iaga-2024"} <= cited["sources"].keys()
    assert cited["inputs"][0]["name"] == "log.csv"


def test_demo_puts_truth_beside_estimate(capsys) -> None:
    status, said = answer(capsys, "demo")
    assert status == 0
    sensor = said["sensors"][0]
    error = sensor["bias_nT"][0] - said["truth"]["bias_x"]
    assert abs(error) < 4 * sensor["bias_sd_nT"][0]


def test_field_agrees_with_the_official_test_value(capsys) -> None:
    status, said = answer(
        capsys, "field", "--at", "80,-96,48000", "--date", "2025-01-01", "--model", "wmm"
    )
    assert status == 0  # second row of NOAA's WMM2025 test values
    assert said["elements"]["declination_deg"] == pytest.approx(-29.91, abs=0.005)
    assert said["elements"]["inclination_deg"] == pytest.approx(87.77, abs=0.005)
    assert said["elements"]["magnitude"] == pytest.approx(55665.134163, abs=1e-3)


def test_simulate_flies_the_sensors_that_are_given(log, capsys) -> None:
    said = answer(capsys, "simulate", "vehicle", "--truth", "log.truth.json", "-o", "v.csv")[1]
    assert len(said["bias_nT"]) == 1
    one = ["--truth", "v.mag1.truth.json"]
    both = answer(capsys, "simulate", "vehicle", *one, *one, "--seed", "5", "-o", "w.csv")[1]
    assert both["bias_nT"] == said["bias_nT"] * 2


def test_a_kind_that_there_is_not_names_those_that_there_are(capsys) -> None:
    assert run(["simulate", "ship", "-o", "x.csv"]) == 2
    said = capsys.readouterr().err
    for kind in ("boat", "car", "vehicle", "orbit", "campaign"):
        assert kind in said


def test_simulate_moves_the_same_sensor_again(log, capsys) -> None:
    answer(capsys, "simulate", "circle", "--tilt", "30", "--truth", "log.truth.json", "-o", "b.csv")
    first, again = (json.loads(Path(f).read_text()) for f in ("log.truth.json", "b.truth.json"))
    assert again["calibration"]["bias"] == first["calibration"]["bias"]


WRONG = [
    ["calibrate"],
    ["frob"],
    ["calibrate", "missing.csv"],
    ["calibrate", "log.csv", "--sensor", "MAG9"],
    ["calibrate", "log.csv", "--unit", "furlong"],
    ["calibrate", "log.csv", "--at", "here"],
    ["calibrate", "log.csv", "--at", "91,0"],
    ["calibrate", "log.csv", "--at", "50,5", "--date", "soon"],
    ["calibrate", "log.csv", "--field", "-3"],
    ["calibrate", "log.csv", "-o", "log.csv"],
    ["info", "."],
    ["info", "noise.bin"],
    ["fit", "ellipsoid", "log.csv", "--model", "cube"],
    ["fit", "ellipsoid", "log.csv", "--method", "guess"],
    ["apply", "cal.json", "cloud.txt", "-o", "x.csv"],
    ["apply", "log.csv", "log.csv", "-o", "x.csv"],
    ["verify", "noise.bin", "log.csv"],
    ["export", "cal.json", "--to", "toaster"],
    ["export", "cal.json", "--to", "c", "-o", "no/such/folder/c.h"],
    ["report", "cal.json", "gone.csv"],
    ["cite", "log.csv"],
    ["field", "--at", "1,2", "--date", "1800-01-01"],
    ["simulate", "somersault", "-o", "x.csv"],
    ["simulate", "tumble", "--tilt", "10", "-o", "x.csv"],
    ["simulate", "tumble", "--truth", "cal.json", "--truth", "cal.json", "-o", "x.csv"],
    ["field", "--points", "gone.csv"],
    ["simulate", "tumble", "--truth", "log.csv", "-o", "x.csv"],
]


@pytest.mark.parametrize("arguments", WRONG, ids=" ".join)
def test_bad_input_is_exit_status_2_and_one_line(arguments, cal, capsys) -> None:
    Path("noise.bin").write_bytes(np.random.default_rng(0).bytes(5000))
    Path("cloud.txt").write_text("1 2 3\n4 5 6\n7 8 10\n")
    capsys.readouterr()
    before = {path: path.read_bytes() for path in Path().glob("*") if path.is_file()}
    for more in ([], ["--json"]):
        assert run([*arguments, *more]) == 2
        said = capsys.readouterr()
        assert said.err.startswith("agonic: ")
        assert said.err.count("\n") == 1
        if not more:
            assert said.out == ""
        else:
            told = json.loads(said.out)
            assert told["schema"] == "agonic/error@1"
            assert said.err == f"agonic: {told['error']}\n"
    assert {path: path.read_bytes() for path in before} == before


def test_every_command_explains_itself(capsys) -> None:
    for command in COMMANDS:
        assert run([command, "--help"]) == 0
        said = capsys.readouterr().out
        assert "Usage" in said
        assert len(said.splitlines()) > 4
