"""Calibrations of other programs: the log tells what any form and convention means."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

import agonic as ag
from agonic.calibration.affine import Affine
from agonic.cli import run
from agonic.errors import LogError
from agonic.exports.ardupilot import write_ardupilot
from agonic.exports.csv import write_csv
from agonic.exports.motioncal import write_motioncal
from agonic.exports.px4 import write_px4
from agonic.files.foreign import CONVENTIONS, understand
from agonic.files.foreign_forms import is_foreign, read_foreign
from agonic.simulation import simulate
from tests.command_line import answer

MADE = simulate("tumble", n=1200, noise=100.0, seed=3)
TRUTH = MADE.truth
LEAN = np.array([[0.995, -0.0998, 0.0], [0.0998, 0.995, 0.0], [0.0, 0.0, 1.0]])
BIAS_UT, MATRIX = TRUTH.bias / 1000.0, LEAN @ TRUTH.matrix
"""In µT; not symmetric, so that a transposed matrix is another one."""


def say_as(convention: str) -> tuple[np.ndarray, np.ndarray]:
    """The numbers b and A by which another program would say the truth."""
    shape = convention.replace("(raw − b)", "raw").replace("(raw + b)", "raw")
    shape = shape.replace(" − b", "").replace(" + b", "")
    inverse = np.linalg.inv(MATRIX)
    matrix = {"A raw": MATRIX, "raw A": MATRIX.T, "A⁻¹ raw": inverse, "raw A⁻¹": inverse.T}[shape]
    vector = BIAS_UT if "(" in convention else MATRIX @ BIAS_UT
    return (-vector if "+" in convention else vector), matrix


def write_magneto(path: Path, b: np.ndarray, a: np.ndarray) -> None:
    rows = "\n".join("  ".join(f"{value: .7f}" for value in row) for row in a)
    vector = "  ".join(f"{value:.5f}" for value in b)
    path.write_text(f"Combined bias (b):\n{vector}\n\nsoft iron (A-1):\n{rows}\n")


def write_code(path: Path, b: np.ndarray, a: np.ndarray) -> None:
    rows = ", ".join("{" + ", ".join(f"{v:.7f}f" for v in row) + "}" for row in a)
    vector = ", ".join(f"{v:.5f}" for v in b)
    path.write_text(f"float b[3] = {{{vector}}};\nfloat A[3][3] = {{{rows.replace('f', '')}}};\n")


def write_json(path: Path, b: np.ndarray, a: np.ndarray) -> None:
    hard = dict(zip("xyz", b.tolist(), strict=True))
    path.write_text(json.dumps({"mag": {"hard_iron": hard, "soft_iron": a.tolist()}}))


def name_entries(path: Path, b: np.ndarray, a: np.ndarray) -> None:
    rows = [f"#define MAG_OFFSET_{axis} {v:.5f}f" for axis, v in zip("XYZ", b, strict=True)]
    rows += [f"#define MAG_A{i}{j} {a[i, j]:.7f}F" for i in range(3) for j in range(3)]
    path.write_text("\n".join(rows))


def write_brackets(path: Path, b: np.ndarray, a: np.ndarray) -> None:
    rows = "; ".join(" ".join(f"{v:.7f}" for v in row) for row in a)
    path.write_text(f"V = [{' '.join(f'{v:.5f}' for v in b)}]\ninvW = [{rows}]\nB = 48.0\n")


def write_yaml(path: Path, b: np.ndarray, a: np.ndarray) -> None:
    rows = "\n".join(f"    - {row}" for row in a.tolist())
    path.write_text(f"mag:\n  offset: {b.tolist()}\n  soft_iron:\n{rows}\n  field: 48.0\n")


def write_column(path: Path, b: np.ndarray, a: np.ndarray) -> None:
    rows = "\n".join("\t".join(f"{v:.7f}" for v in row) for row in a)
    path.write_text("Combined bias (b):\n" + "\n".join(map(str, b)) + f"\n\nA-1:\n{rows}\n")


def write_numbers(path: Path, b: np.ndarray, a: np.ndarray) -> None:
    path.write_text("\n".join(",".join(f"{v:.7f}" for v in row) for row in [b, *a]))


def write_matlab(path: Path, b: np.ndarray, a: np.ndarray) -> None:
    savemat(path, {"A": a, "b": b, "expMFS": 50.0})


FORMS = (write_magneto, write_code, write_json, write_matlab, name_entries, write_brackets,
         write_yaml, write_column, write_numbers)  # fmt: skip


@pytest.mark.parametrize("write", FORMS)
@pytest.mark.parametrize("convention", list(CONVENTIONS))
def test_any_form_in_any_convention_is_read_as_it_is_meant(tmp_path, write, convention) -> None:
    path = tmp_path / ("cal.mat" if write is write_matlab else "cal.txt")
    write(path, *say_as(convention))
    found = understand(path, MADE.samples).calibration
    assert found.bias == pytest.approx(TRUTH.bias, abs=5.0)
    lengths = np.linalg.norm(found.correct(MADE.samples.field), axis=1)
    wanted = np.linalg.norm((MADE.samples.field - TRUTH.bias) @ MATRIX.T, axis=1)
    assert lengths == pytest.approx(wanted, rel=1e-3)
    assert "b in uT" in found.provenance.settings["read_as"]


@pytest.mark.parametrize(
    ("write", "name", "options"),
    [
        (write_ardupilot, "mag.param", {"compass": 2}),
        (write_px4, "mag.params", {"device_id": 5, "slot": 1}),
        (write_motioncal, "mag.bin", {}),
    ],
)
def test_what_says_its_convention_itself_is_read_back(tmp_path, write, name, options) -> None:
    own = Affine(bias=TRUTH.bias, matrix=TRUTH.matrix, magnitude=50_000.0)
    path = write(own, tmp_path / name, **options).path
    assert is_foreign(path)
    found = understand(path, MADE.samples)
    assert found.calibration.bias == pytest.approx(TRUTH.bias, abs=1.0)
    assert found.calibration.matrix == pytest.approx(TRUTH.matrix, abs=1e-5)
    assert found.next_spread == np.inf


def test_what_fits_in_no_way_is_an_error(tmp_path) -> None:
    path = tmp_path / "other.txt"
    write_magneto(path, np.array([90.0, -80.0, 200.0]), np.diag([1.0, 2.0, 0.3]))
    with pytest.raises(LogError, match="in any of the ways that were tried"):
        understand(path, MADE.samples)
    path.write_text("nothing of the kind: 1 2\n")
    with pytest.raises(LogError, match="a vector of 3 and a matrix of 3 × 3"):
        read_foreign(path)


def test_verify_says_how_it_is_read_and_keeps_it(tmp_path, capsys) -> None:
    log = str(write_csv(MADE.samples, tmp_path / "log.csv"))
    write_matlab(tmp_path / "cal.mat", *say_as("(raw − b) A"))
    kept = str(tmp_path / "mag.json")
    status, said = answer(capsys, "verify", str(tmp_path / "cal.mat"), log, "-o", kept)
    assert (status, said["verdict"], said["files"]) == (0, "good", [kept])
    assert "field = (raw − b) A, b in uT" in said["read_as"]
    assert ag.load(kept).bias == pytest.approx(TRUTH.bias, abs=5.0)
    out = str(tmp_path / "out.csv")
    assert run(["apply", str(tmp_path / "cal.mat"), log, "-o", out]) == 0
    assert ag.read(out).field.std(axis=0).max() < 40_000.0


def write_parameters(path: Path, old: Affine) -> str:
    return str(write_ardupilot(old, path).path)


def test_a_calibration_is_compared_with_one_of_another_program(tmp_path, capsys) -> None:
    log = str(write_csv(MADE.samples, tmp_path / "log.csv"))
    write_json(tmp_path / "new.json", *say_as("A (raw − b)"))
    worse = Affine(bias=np.add(TRUTH.bias, [2500.0, 0.0, 0.0]), matrix=TRUTH.matrix)
    old = write_parameters(tmp_path / "old.param", worse)
    status, said = answer(capsys, "verify", str(tmp_path / "new.json"), log, "--against", old)
    checks = {check["name"]: check for check in said["checks"]}
    assert status == 0
    assert checks["spread after over the logged calibration's"]["passed"]
    assert checks["turn against the logged calibration"]["value"] > 2.0
    assert answer(capsys, "verify", old, log, "--against", str(tmp_path / "new.json"))[0] == 1


def test_a_calibration_of_corrected_readings_joins_what_had_corrected_them(
    tmp_path, capsys
) -> None:
    """RAW_IMU as text is corrected by the autopilot; both together are the sensor's own."""
    old = Affine(bias=np.add(TRUTH.bias, [3e3, -5e3, 2e3]), matrix=np.diag([1.05, 0.98, 1.0]))
    seen = old.correct(MADE.samples.field) / 100.0
    rows = [
        f"2025-06-01 10:00:{time:05.2f}: RAW_IMU {{time_usec : {1e8 + 1e6 * time:.0f}, xacc : "
        f"{a[0] * 102:.0f}, yacc : {a[1] * 102:.0f}, zacc : {a[2] * 102:.0f}, xgyro : 0, ygyro : 0,"
        f" zgyro : 0, xmag : {m[0]:.0f}, ymag : {m[1]:.0f}, zmag : {m[2]:.0f}, id : 0}}"
        for time, a, m in zip(MADE.samples.time, MADE.samples.acceleration, seen, strict=True)
    ]
    (tmp_path / "log.txt").write_text("\n".join(rows))
    log, out = str(tmp_path / "log.txt"), str(tmp_path / "out")
    (sensor,) = answer(capsys, "calibrate", log, "--field", "50000", "-o", out)[1]["sensors"]
    made = next(name for name in sensor["files"] if name.endswith("IMU.json"))
    new = str(tmp_path / "new.param")
    assert run(["export", made, "--to", "ardupilot", "-o", new]) == 2
    assert "--on OLD.param" in capsys.readouterr().err
    kept = write_parameters(tmp_path / "old.param", old)
    assert run(["export", made, "--to", "ardupilot", "-o", new, "--on", kept]) == 0
    found = understand(Path(new), MADE.samples).calibration
    assert found.bias == pytest.approx(TRUTH.bias, abs=60.0)
    turned = found.correct(MADE.samples.field)
    assert np.linalg.norm(turned, axis=1).std() < 250.0
