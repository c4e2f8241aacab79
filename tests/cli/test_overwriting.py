"""No command writes over what it reads, nor over what agonic did not write without --force."""

from __future__ import annotations

import json
import shutil
from contextlib import chdir
from pathlib import Path

import pytest

from agonic.cli import run

N = "1200"


@pytest.fixture(scope="module")
def made_once(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made")
    with chdir(folder):
        assert run(["simulate", "tumble", "-n", N, "-o", "LOG.csv"]) == 0
        assert run(["fit", "ellipsoid", "LOG.csv", "--field", "50000", "-o", "CAL.json"]) == 0
    return folder


@pytest.fixture
def made(made_once, tmp_path, monkeypatch, capsys):
    """A log and its calibration, in the folder one works in; copies that keep who wrote them."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(made_once, tmp_path, dirs_exist_ok=True)
    capsys.readouterr()


OVER_INPUT = (
    ["apply", "CAL.json", "LOG.csv", "-o", "LOG.csv"],
    ["fit", "ellipsoid", "LOG.csv", "-o", "LOG.csv"],
    ["report", "CAL.json", "LOG.csv", "-o", "LOG.csv"],
    ["export", "CAL.json", "--to", "ros", "-o", "CAL.json"],
    ["apply", "CAL.json", "LOG.csv", "-o", "hard.csv"],
    ["apply", "CAL.json", "LOG.csv", "-o", "soft.csv"],
    ["apply", "CAL.json", "LOG.csv", "-o", "CAL.json"],
)


@pytest.mark.parametrize("force", [[], ["--force"]])
@pytest.mark.parametrize("command", OVER_INPUT, ids=" ".join)
def test_refuses_what_it_reads_by_identity(made, capsys, command, force):
    Path("hard.csv").hardlink_to("LOG.csv")
    Path("soft.csv").symlink_to("LOG.csv")
    before = {name: Path(name).read_bytes() for name in ("LOG.csv", "CAL.json")}
    assert run([*command, *force]) == 2
    assert "which this command reads" in capsys.readouterr().err
    assert before == {name: Path(name).read_bytes() for name in before}


OVER_FOREIGN = (
    ["simulate", "tumble", "-n", N, "-o", "mine.csv"],
    ["plan", "swing", "-o", "mine.csv"],
    ["apply", "CAL.json", "LOG.csv", "-o", "mine.csv"],
    ["fit", "ellipsoid", "LOG.csv", "-o", "mine.csv"],
    ["export", "CAL.json", "--to", "table", "-o", "mine.csv"],
    ["report", "CAL.json", "LOG.csv", "-o", "mine.csv"],
)


@pytest.mark.parametrize("command", OVER_FOREIGN, ids=" ".join)
def test_replaces_a_foreign_file_only_with_force(made, capsys, command):
    text = "time_s,mag_x_nT,mag_y_nT,mag_z_nT\n0.0,1.5,2.0,3.0\n"
    Path("mine.csv").write_text(text)
    assert run(command) == 2
    assert "--force" in capsys.readouterr().err
    assert Path("mine.csv").read_text() == text
    assert run([*command, "--force"]) in (0, 1)
    assert Path("mine.csv").read_text() != text


@pytest.mark.slow
def test_replaces_its_own_files_by_what_is_in_them(made, capsys):
    assert run(["simulate", "tumble", "-n", N, "--seed", "2", "-o", "LOG.csv"]) == 0
    for _ in range(2):
        assert run(["calibrate", "LOG.csv", "--field", "50000", "-o", "out"]) in (0, 1)
    copy = Path("out/setup.toml").read_text()
    Path("out/setup.toml").unlink()  # a copy knows nothing of who wrote it
    Path("out/setup.toml").write_text(copy)
    assert run(["calibrate", "LOG.csv", "--field", "50000", "-o", "out"]) in (0, 1)
    Path("out/report.html").write_text("<html>of another program</html>")
    assert run(["calibrate", "LOG.csv", "--field", "50001", "-o", "out"]) == 2
    assert "report.html" in capsys.readouterr().err


def test_a_fleet_leaves_the_folder_of_another_program_alone(made, capsys):
    Path("theirs").mkdir()
    for name in ("report.html", "fleet.parquet"):
        Path("theirs", name).write_text("theirs")
        assert run(["fleet", "LOG.csv", "-o", "theirs", "--workers", "0"]) == 2
        assert Path("theirs", name).read_text() == "theirs"
        Path("theirs", name).unlink()


def test_sensors_with_names_alike_keep_their_own_calibrations(tmp_path, monkeypatch, capsys):
    import numpy as np

    import agonic as ag

    monkeypatch.chdir(tmp_path)
    lines = ["sensor,mag_x_nT,mag_y_nT,mag_z_nT"]
    names = ("left.mag", "left/mag", "left mag")
    raw = ag.simulate("tumble", n=900, seed=1).samples.field
    for shift, name in enumerate(names):
        lines += [f"{name},{x},{y},{z}" for x, y, z in raw + 1000.0 * shift]
    Path("log.csv").write_text("\n".join(lines))
    assert run(["calibrate", "log.csv", "--field", "50000", "-o", "out", "--json"]) in (0, 1)
    sensors = json.loads(capsys.readouterr().out)["sensors"]
    biases = {}
    for sensor in sensors:
        calibration = ag.load(next(f for f in sensor["files"] if f.endswith(".json")))
        assert calibration.sensor == sensor["sensor"]
        biases[calibration.sensor] = calibration.bias
    assert set(biases) == set(names)
    assert np.allclose(biases["left mag"] - biases["left.mag"], 2000.0, atol=50.0)
    setup = Path("out/setup.toml").read_text()
    assert len({line for line in setup.splitlines() if line.startswith("calibration")}) == 3
