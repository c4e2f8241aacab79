"""Messages as a user meets them: each says what was, and nothing that was not."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from agonic.cli import run
from agonic.reference import Reference
from agonic.report.verdict import moves
from agonic.samples import Samples

RNG = np.random.default_rng(4)
AROUND = RNG.normal(size=(600, 3))
AROUND /= np.linalg.norm(AROUND, axis=1, keepdims=True)


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def write_log(name: str, sensors: dict[str, np.ndarray], unit: str = "nT", **more: float) -> str:
    """A table with a magnetometer under each prefix."""
    heads = [f"{prefix}{axis}_{unit}" for prefix in sensors for axis in "xyz"] + list(more)
    rows = np.hstack([*sensors.values(), np.tile([*more.values()], (len(AROUND), 1))])
    rows = rows[: min(map(len, sensors.values()))]
    np.savetxt(name, rows, "%.6f", ",", header=",".join(heads), comments="")
    return name


def find_bias(header: str, name: str) -> float:
    """The bias along x of a C header whose names start so."""
    return float(header.split(f"{name}_b[3] = {{")[1].split("f")[0])


def tumbled(bias: float = 3000.0) -> np.ndarray:
    return 50_000 * AROUND + [bias, 0, 0] + RNG.normal(size=AROUND.shape) * 20


@pytest.mark.parametrize("given", [["--field", "50000"], []])
def test_a_report_knows_of_the_reference_that_the_calibration_had(given, capsys) -> None:
    log = write_log("log.csv", {"mag_": tumbled()})
    assert run(["calibrate", log, *given, "-o", "out"]) == 0
    assert run(["report", "out/mag.json", log, "-o", "page.html"]) == 0
    assert ("No reference magnitude" in Path("page.html").read_text()) is not bool(given)


def test_accuracy_is_in_the_unit_of_the_bias(capsys) -> None:
    """What a log in microtesla is told is in nanotesla, number and unit alike."""
    log = write_log("log.csv", {"mag_": tumbled() / 1000}, "uT")
    assert run(["fit", "ellipsoid", log, "--field", "50000", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["unit"] == "nT"
    stated = float(said["status"].split(" nT")[0].split()[-1])
    assert stated == pytest.approx(max(said["bias_sd_nT"]), rel=0.06)
    assert 0.5 < stated < 30


def test_a_place_without_a_date_is_told_that_the_date_is_missing(capsys) -> None:
    place = {"latitude_deg": 52.0, "longitude_deg": 5.0}
    log = write_log("log.csv", {"mag_": tumbled()}, **place)
    run(["calibrate", log, "--verbose"])
    said = capsys.readouterr().out
    assert "the log has no date" in said
    assert "latitude" not in said
    run(["calibrate", "-v", write_log("bare.csv", {"mag_": tumbled()})])
    assert "the log has no latitude, longitude or date" in " ".join(capsys.readouterr().out.split())


def test_a_page_says_why_no_sensor_could_be_calibrated(capsys) -> None:
    still = np.ones((600, 3))
    log = write_log("log.csv", {"mag_": still, "mag2_": still * 2})
    assert run(["calibrate", log, "-o", "out"]) == 1
    page = Path("out/report.html").read_text()
    assert page.count("The readings never change") >= 2
    assert "No magnetometer was found" not in page


def test_the_headers_of_two_sensors_go_in_one_program(capsys) -> None:
    log = write_log("log.csv", {"mag_": tumbled(), "mag2_": tumbled(-9000.0)})
    assert run(["calibrate", log, "--field", "50000", "-o", "out"]) == 0
    first, second = (Path("out", f"{name}.h").read_text() for name in ("mag", "mag2"))
    assert "AGONIC_MAG_H" in first
    assert "AGONIC_MAG2_H" in second
    assert find_bias(first, "mag") == pytest.approx(3000, abs=20)
    assert find_bias(second, "mag2") == pytest.approx(-9000, abs=20)
    assert run(["export", "out/mag2.json", "--to", "c", "--name", "tail", "-o", "tail.h"]) == 0
    assert find_bias(Path("tail.h").read_text(), "tail") == pytest.approx(-9000, abs=20)


@pytest.mark.parametrize("normal", [0, 1, 2])
@pytest.mark.parametrize("span_deg", [60, 360])
def test_an_arc_is_called_one_and_its_axis_is_right(normal, span_deg) -> None:
    from agonic.ellipsoid import fit_ellipsoid

    angle = np.radians(np.linspace(20, 20 + span_deg, 400))
    field = np.zeros((400, 3))
    field[:, normal - 2], field[:, normal - 1] = 40_000 * np.cos(angle), 40_000 * np.sin(angle)
    field[:, normal] = 25_000
    made = Samples(field=field + RNG.normal(size=(400, 3)) * 20, unit="nT")
    (found,) = fit_ellipsoid(made, Reference.constant(47_000)).findings
    assert (found.name, found.severity) == ("plane", "refuse")
    assert f"along {'xyz'[normal]} are not determined" in found.what
    assert ("arc of some 60°" in found.what) is (span_deg == 60)


def test_recording_longer_is_asked_for_last() -> None:
    from agonic.health import RECORD_LONGER, Finding

    found = [
        Finding("coverage", "check", "", f"{RECORD_LONGER}, turning slowly"),
        Finding("non-linearity", "check", "", "take iron away"),
    ]
    assert moves(found)[0] == "take iron away"
    assert moves(found[:1]) == [f"{RECORD_LONGER}, turning slowly"]


def test_what_a_log_holds_is_told_without_scipy() -> None:
    log = write_log("log.csv", {"mag_": tumbled()})
    code = (
        "import sys\nfrom agonic.cli import run\n"
        f"run(['info', {log!r}])\nsys.exit('scipy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == 0


def test_a_plain_calibration_loads_nothing_that_it_does_not_use() -> None:
    log = write_log("log.csv", {"mag_": tumbled()})
    spared = ("rich", "scipy.interpolate", "scipy.spatial")
    spared += ("scipy.stats", "scipy.ndimage", "scipy.signal", "pandas", "pyarrow", "numba")
    spared += ("agonic.ellipse", "agonic.live", "agonic.fleet", "agonic.thermal")
    code = (
        f"import sys\nfrom agonic.cli import run\nrun(['calibrate', {log!r}, '--json'])\n"
        f"print([m for m in {spared} if m in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stderr.splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["verify", "wrong.csv", "wrong.csv"], "this is a text, as tables .* calibration file is"),
        (["apply", "empty.csv", "wrong.csv", "-o", "x.csv"], "this is empty, and a calibration"),
        (["heading", "wrong.csv", "wrong.csv", "-o", "x.csv"], "a setup \\(TOML\\) or a calib"),
        (["fit", "north", "wrong.csv"], "north.toml, which describes the recordings"),
        (["fit", "alignment", "folder"], "folder does not hold session.toml"),
        (["fit", "alignment", "north"], "it holds north.toml, for agonic fit north"),
        (["fit", "north", "north"], "has no key `settle`"),
        (["fit", "deviation", "gone.csv"], "there is no such file"),
        (["fit", "deviation", "swing.csv"], "a swing needs compass_deg"),
        (["fit", "remanence", "wrong.csv"], "the angle of the platform as heading_deg"),
        (["calibrate", "missing.csv"], "there is no such file"),
        (["calibrate", "log.csv", "--method", "best"], "--method"),
        (["calibrate"], "Missing LOG"),
        (["fit", "thermal", "wrong.csv"], "^wrong.csv: wrong.csv: no column"),
    ],
)
def test_a_wrong_input_is_one_object_for_programs_and_one_line_for_people(
    tmp_path, monkeypatch, capsys, words, said
):
    monkeypatch.chdir(tmp_path)
    Path("wrong.csv").write_text("name,age\nbob,3\n")
    Path("empty.csv").write_text("")
    Path("folder").mkdir()
    Path("north").mkdir()
    Path("north/north.toml").write_text("settle = 1")
    Path("swing.csv").write_text("heading,deviation_deg\nN,1E\n")
    assert run([*words, "--json"]) == 2
    told = capsys.readouterr()
    made = json.loads(told.out)
    assert (made["schema"], made["status"]) == ("agonic/error@1", 2)
    assert re.search(said, made["error"]), made["error"]
    assert told.err == f"agonic: {made['error']}\n"
