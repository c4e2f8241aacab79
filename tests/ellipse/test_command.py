"""A log of x and y alone, from `agonic calibrate` to headings and firmware."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from agonic.calibration.base import apply
from agonic.calibration.setup import Compass, Setup
from agonic.cli import run
from agonic.ellipse.fit import fit_ellipse
from agonic.errors import AgonicError, FrameError, LogError, TwoAxisError
from agonic.exports.targets import write
from agonic.files.calibration import load, save
from agonic.headings.compute import heading
from agonic.logs.log import allow_two_axes
from agonic.logs.read import open_log
from agonic.samples import Samples
from tests.command_line import answer, complaint
from tests.ellipse.test_fit import BIAS, MATRIX, H, Z, record

PLACE = ("--at", "48,11", "--date", "2026-05-01")


def write_log(path: Path, samples: Samples, header: str = "time_s,mag_x_nT,mag_y_nT") -> Path:
    rows = np.column_stack([samples.time, samples.field[:, :2]])
    np.savetxt(path, rows, delimiter=",", header=header, comments="", fmt="%.3f")
    return path


@pytest.mark.parametrize("header", ["time_s,mag_x_nT,mag_y_nT", "t,x,y"])
def test_from_log_to_heading(tmp_path, capsys, header) -> None:
    log, out = str(write_log(tmp_path / "boat.csv", record(0), header)), tmp_path / "out"
    more = (*PLACE, "--unit", "nT") if header == "t,x,y" else PLACE
    status, said = answer(capsys, "calibrate", log, "-o", str(out), *more)
    (sensor,) = said["sensors"]
    assert status == 0
    assert sensor["verdict"] == "good"
    assert np.abs((np.array(sensor["bias"]) - BIAS) / sensor["bias_sd"]).max() < 4
    assert sorted(sensor["files"]) == [
        str(out / f) for f in ("mag.json", "report.html", "setup.toml")
    ]
    assert (out / "report.html").read_text("utf-8").count("<svg") >= 3
    headings = str(tmp_path / "h.csv")
    assert run(["heading", str(out / "setup.toml"), log, *more, "-o", headings]) == 0
    table = np.genfromtxt(tmp_path / "h.csv", delimiter=",", names=True, dtype=None)
    truth = 360 * np.interp(table["time_s"], [0, 29.95, 59.9], [0, 1, 0])
    off = (table["magnetic_deg"] - truth + 180) % 360 - 180
    assert np.sqrt(np.mean(off**2)) < 1.0  # noise of a reading: 0.5°


def test_a_long_table_of_two_axes_is_read_whole(tmp_path, capsys, monkeypatch) -> None:
    monkeypatch.setattr("agonic.logs.large.mission.IN_MEMORY", 100)
    parquet = pytest.importorskip("pyarrow.parquet")
    csv = pytest.importorskip("pyarrow.csv")
    log = tmp_path / "boat.parquet"
    parquet.write_table(csv.read_csv(write_log(tmp_path / "boat.csv", record(0))), log)
    _, told = answer(capsys, "calibrate", str(log), *PLACE, "-o", str(tmp_path / "out"))
    assert told["sensors"][0]["verdict"] == "good"


def test_a_calibration_alone_is_level_and_a_place_not_needed_to_calibrate(tmp_path, capsys) -> None:
    log, out = str(write_log(tmp_path / "boat.csv", record(0))), tmp_path / "out"
    assert run(["calibrate", log, "-o", str(out)]) == 0
    assert "Next" not in capsys.readouterr().out
    headings = str(tmp_path / "h.csv")
    assert run(["heading", str(out / "mag.json"), log, *PLACE, "-o", headings]) == 0


def test_a_refused_log_writes_no_calibration(tmp_path, capsys) -> None:
    log, out = str(write_log(tmp_path / "arc.csv", record(0, turns=0.4))), tmp_path / "out"
    assert run(["calibrate", log, "-o", str(out)]) == 1
    assert "of the circle was seen" in " ".join(capsys.readouterr().out.split())
    assert [file.name for file in out.iterdir()] == ["report.html"]


def test_a_refused_log_names_what_an_earlier_run_left(tmp_path, capsys) -> None:
    out = str(tmp_path / "out")
    good = str(write_log(tmp_path / "whole.csv", record(0)))
    arc = str(write_log(tmp_path / "arc.csv", record(0, turns=0.4)))
    assert run(["calibrate", good, "-o", out]) == 0
    assert run(["calibrate", arc, "-o", out, "-v"]) == 1
    assert "mag.json, setup.toml: of an earlier run" in capsys.readouterr().out


def test_what_needs_three_axes_says_so(tmp_path) -> None:
    log = write_log(tmp_path / "boat.csv", record(0))
    with pytest.raises(TwoAxisError, match="two-axis compass") as caught:
        open_log(log)
    assert caught.value.path == log
    with allow_two_axes():
        (two,) = open_log(log).sensors
    assert two.axes == "xy"
    assert not two.field[:, 2].any()
    made = fit_ellipse(record(0)).calibration
    three = Samples(field=np.eye(3) * 20_000)
    with pytest.raises(FrameError, match="xyz does not meet xy"):
        apply(made, three)
    with pytest.raises(AgonicError, match="export the setup"):
        write("px4", made, tmp_path / "mag.params")
    tilted = Setup(compasses=(Compass(calibration=made),), tilt="log", declination_deg=0.0)
    with pytest.raises(LogError, match="two-axis compass, whose field"):
        heading(record(0), tilted)


@pytest.mark.parametrize("option", [("--course",), ("--method", "levelled"), ("--store", "s")])
def test_options_of_three_axes_are_errors(tmp_path, capsys, option) -> None:
    log = str(write_log(tmp_path / "boat.csv", record(0)))
    assert option[0] in complaint(capsys, "calibrate", log, *option)


def test_the_standard_error_of_a_heading_holds_the_leak_of_a_tilt() -> None:
    """Errors of vehicles that are level to 1.5° only, over the stated σ."""
    calibration = fit_ellipse(record(0)).calibration
    setup = Setup(
        compasses=(Compass(calibration=calibration),),
        tilt="level",
        tilt_sd_deg=1.5,
        declination_deg=0.0,
        horizontal=H,
        vertical=Z,
    )
    rng, n = np.random.default_rng(1), 4000
    truth = rng.uniform(0, 2 * np.pi, n)
    pitch, roll = np.radians(1.5) * rng.normal(size=(2, n))
    field = np.stack([H * np.cos(truth) - Z * pitch, -H * np.sin(truth) + Z * roll], axis=1)
    raw = field @ np.linalg.inv(MATRIX) + BIAS + rng.normal(size=(n, 2)) * 150
    found = heading(Samples(field=np.column_stack([raw, np.zeros(n)]), axes="xy"), setup)
    off = np.degrees(np.angle(np.exp(1j * (np.radians(found.true_deg) - truth))))
    assert np.sqrt(np.mean((off / found.sd_deg) ** 2)) == pytest.approx(1.0, abs=0.05)
    nowhere = heading(
        Samples(field=np.column_stack([raw, np.zeros(n)]), axes="xy"),
        Setup(compasses=(Compass(calibration=calibration),), declination_deg=0.0, tilt_sd_deg=1.5),
    )
    assert "dip of the place is not known" in " ".join(nowhere.notes)
    assert np.median(nowhere.sd_deg) == pytest.approx(1.5 * np.tan(np.radians(65)), rel=0.05)


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_firmware_of_two_axes_passes_its_own_test(tmp_path) -> None:
    log, out = str(write_log(tmp_path / "boat.csv", record(0))), tmp_path / "out"
    assert run(["calibrate", log, "-o", str(out), *PLACE]) == 0
    told = ("--to", "c", "--declination", "4", "-o", str(tmp_path / "c"))
    assert run(["export", str(out / "setup.toml"), *told]) == 0
    sources = [tmp_path / "c" / f"compass{part}.c" for part in ("", "_selftest")]
    program = tmp_path / "test"
    subprocess.run(
        ["cc", "-DCOMPASS_MAIN", "-o", program, *sources, "-lm"], check=True, capture_output=True
    )
    subprocess.run([program], check=True, capture_output=True)


def test_the_file_keeps_what_it_is(tmp_path) -> None:
    made = fit_ellipse(record(0)).calibration
    again = load(save(made, tmp_path / "mag.json"))
    assert again == made
    assert again.model == "ellipse"
