"""`agonic export SETUP --to c`: the whole chain as C, from a terminal."""

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.calibration.deviation import Deviation
from agonic.calibration.setup import Compass, Setup
from agonic.calibration.thermal import Thermal
from agonic.cli import run
from agonic.exports.firmware import declination_grid
from agonic.files.setup import save_setup
from tests.command_line import answer
from tests.exports.read_back import parse_px4

FILES = [
    *("compass.c", "compass.h", "compass_ellipsoid.c", "compass_ellipsoid.h"),
    *("compass_fit.c", "compass_fit.h", "compass_selftest.c"),
]
LEVEL_NORTH = "{.raw = {{19100.0f, 0.0f, 45600.0f}}}"


@pytest.fixture(autouse=True)
def setup_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    mag = ag.Affine(bias=np.zeros(3), matrix=np.eye(3), frame_in="b", frame_out="b", sensor="MAG1")
    card = Deviation(coefficients=[2.0, 0, 1.0, 0, 0.5])  # 3.5 degrees at a compass heading of 0
    save_setup(Setup(compasses=(Compass(calibration=mag, deviation=card),)), "boat.toml")
    return "boat.toml"


def declination_of(folder: str, place: str = "") -> float:
    """What the C adds to a magnetic heading of 3.5°, compiled and run."""
    main = (
        '#include <stdio.h>\n#include "compass.h"\nint main(void) { compass_output out;\n'
        f"compass_input in = {LEVEL_NORTH};\n{place}\n"
        'compass_heading(&in, &out); printf("%.6f %d", (double)out.true_deg, out.status);\n'
        "return compass_self_test(); }\n"
    )
    Path(folder, "main.c").write_text(main)
    sources = [str(Path(folder, name)) for name in ("main.c", "compass.c", "compass_selftest.c")]
    subprocess.run(["cc", "-std=c99", *sources, "-o", "program", "-lm"], check=True)
    done = subprocess.run(["./program"], check=True, capture_output=True, text=True)
    true_deg, status = done.stdout.split()
    assert status == "0"
    return (float(true_deg) - 3.5 + 180) % 360 - 180


def test_a_declination_is_written_into_the_firmware(setup_file, capsys) -> None:
    status, said = answer(capsys, "export", setup_file, "--to", "c", "--declination", "-7.25")
    assert (status, said["schema"], said["target"]) == (0, "agonic/export@1", "c")
    assert sorted(Path(file).name for file in said["files"]) == FILES
    assert {Path(file).parent.name for file in said["files"]} == {"boat"}
    assert said["sizes"]["compass.c"]["code"] > 300
    assert any("disturbances will not be noticed" in w for w in said["warnings"])
    assert declination_of("boat") == pytest.approx(-7.25, abs=1e-4)


def test_a_place_gives_declination_and_field(setup_file, capsys) -> None:
    arguments = (
        "export",
        setup_file,
        "--to",
        "c",
        "-o",
        "fw",
        "--at",
        "52,5",
        "--date",
        "2026-05-01",
    )
    status, said = answer(capsys, *arguments)
    there = ag.wmm().at(52.0, 5.0, 0.0, "2026-05-01")
    assert (status, said["warnings"]) == (0, [])
    assert declination_of("fw") == pytest.approx(float(there.declination_deg), abs=1e-3)


def test_a_box_gives_a_table(setup_file, capsys) -> None:
    arguments = (
        "export",
        setup_file,
        "--to",
        "c",
        "-o",
        "fw",
        "--box",
        "45,56,-3,17",
        "--date",
        "2026-05-01",
        "--tolerance",
        "0.05",
    )
    status, said = answer(capsys, *arguments)
    there = ag.wmm().at(51.0, 4.0, 0.0, "2026-05-01")
    assert status == 0
    # the table's two 16-bit numbers a node; where single numbers go is the compiler's choice
    grid = declination_grid((45.0, 56.0), (-3.0, 17.0), "2026-05-01", tolerance_deg=0.05)
    assert said["sizes"]["compass.c"]["constants"] >= 4 * grid.north.size > 0
    found = declination_of("fw", "in.latitude_deg = 51.0f; in.longitude_deg = 4.0f;")
    assert found == pytest.approx(float(there.declination_deg), abs=0.05)


def test_sizes_are_said(setup_file, capsys) -> None:
    assert run(["export", setup_file, "--to", "c", "--declination", "0", "--name", "nav"]) == 0
    said = capsys.readouterr().out
    assert "Written   boat/nav_selftest.c" in said
    assert "Size      nav.c: " in said
    assert re.search(r", 0 of variables \((cc|\S+-gcc .*) -Os\)", " ".join(said.split()))


def test_a_calibration_alone_is_a_header_or_the_whole_chain(capsys) -> None:
    status, said = answer(capsys, "export", "boat-MAG1.json", "--to", "c")
    assert (status, said["files"], "sizes" in said) == (0, ["boat-MAG1.h"], False)
    whole = ("export", "boat-MAG1.json", "--to", "c", "--whole", "--declination", "1", "-o", "fw")
    status, said = answer(capsys, *whole)
    assert (status, sorted(path.name for path in Path("fw").iterdir())) == (0, FILES)


WARM = Thermal(
    bias=[[3000.0, -2000, 900], [800, -500, 300], [-120, 60, 40]],
    matrix=[np.eye(3), 0.01 * np.eye(3), np.zeros((3, 3))],
    centre_C=20.0,
    half_range_C=30.0,
    magnitude=49_000.0,
    sensor="MAG2",
    device_id=396809,
)


def test_a_calibration_over_temperature_goes_where_it_can(capsys) -> None:
    ag.save(WARM, "warm.json")
    for target, name in (("px4", "warm.params"), ("c", "warm.h"), ("matlab", "warm.mat")):
        status, said = answer(capsys, "export", "warm.json", "--to", target)
        assert (status, said["files"]) == (0, [name])
    parameters = parse_px4("warm.params")
    assert (parameters["TC_M_ENABLE"], parameters["TC_M1_ID"]) == (1, 396809)
    status, said = answer(capsys, "export", "warm.json", "--to", "ardupilot", "--temperature", "25")
    assert (status, said["files"]) == (0, ["warm.param"])
    assert re.match(r"held at 25 C: .* off by up to \d+ nT", said["warnings"][0])


def test_the_whole_chain_follows_the_temperature() -> None:
    compass = Compass(calibration=WARM)
    save_setup(Setup(compasses=(compass,)), "warm.toml")
    assert run(["export", "warm.toml", "--to", "c", "--declination", "0"]) == 0
    assert "float temperature_C[COMPASS_COMPASSES]" in Path("warm/compass.h").read_text()
    sources = ["warm/compass.c", "warm/compass_selftest.c"]
    subprocess.run(
        ["cc", "-std=c99", "-DCOMPASS_MAIN", *sources, "-o", "program", "-lm"], check=True
    )
    done = subprocess.run(["./program"], check=True, capture_output=True, text=True)
    assert done.stdout == "compass: 40 known readings, 0 wrong\n"


@pytest.mark.parametrize(
    ("reason", "arguments"),
    [
        ("--temperature", ["warm.json", "--to", "ros"]),
        ("outside -10 to 50", ["warm.json", "--to", "c", "--temperature", "90"]),
        ("does not change", ["boat-MAG1.json", "--to", "c", "--temperature", "20"]),
        ("at each reading", ["boat.toml", "--to", "c", "--temperature", "20"]),
    ],
)
def test_a_temperature_too_many_or_too_few_is_one_line(reason, arguments, capsys) -> None:
    ag.save(WARM, "warm.json")
    assert run(["export", *arguments]) == 2
    error = capsys.readouterr().err
    assert reason in error
    assert error.count("\n") == 1


WRONG = {
    "needs a declination": ["boat.toml", "--to", "c"],
    "takes one calibration": ["boat.toml", "--to", "ros"],
    "exclude each other": ["boat.toml", "--to", "c", "--at", "52,5", "--declination", "3"],
    "is not S,N,W,E": ["boat.toml", "--to", "c", "--box", "1,2,3"],
    "not a box": ["boat.toml", "--to", "c", "--box", "56,45,0,9"],
    "not a place on Earth": ["boat.toml", "--to", "c", "--at", "99,5"],
    "identifier": ["boat.toml", "--to", "c", "--declination", "0", "--name", "2nd"],
    "1800": ["boat.toml", "--to", "c", "--at", "52,5", "--date", "1800-01-01"],
    "corrects headings": ["boat-MAG1-deviation.json", "--to", "c"],
    "there is no such file": ["gone.toml", "--to", "c"],
}


@pytest.mark.parametrize(("reason", "arguments"), WRONG.items(), ids=WRONG)
def test_bad_input_is_exit_status_2_and_one_line(reason, arguments, capsys) -> None:
    for more in ([], ["--json"]):
        assert run(["export", *arguments, *more]) == 2
        said = capsys.readouterr()
        assert said.out.startswith('{"schema": "agonic/error@1"') if more else not said.out
        assert reason in said.err
        assert said.err.count("\n") == 1
    assert not Path("boat").exists()
