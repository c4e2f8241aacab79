"""`agonic simulate|fit north`, `coil` and `gravity` as a person would run them."""

import json
from pathlib import Path

import numpy as np
import pytest

from agonic.alignment.simulation.laboratory import simulate_gravity
from agonic.cli import run
from agonic.exports.csv import write_csv
from agonic.files.calibration import load
from agonic.maths.rotations.frames import ARCSEC_RAD
from tests.command_line import answer, complaint

pytestmark = pytest.mark.usefixtures("empty_folder")


def test_from_a_simulated_gyro_to_a_calibration(capsys) -> None:
    status, truth = answer(capsys, "simulate", "north", "-o", "pier", "--seed", "4")
    assert (status, truth["schema"]) == (0, "agonic/simulate-north@1")
    assert json.loads(Path("pier/truth/truth.json").read_text())["north_deg"] == truth["north_deg"]
    status, fit = answer(capsys, "fit", "north", "pier", "-o", "cal.json", "--report", "pier.html")
    assert (status, fit["schema"], fit["verdict"]) == (0, "agonic/fit-north@1", "good")
    assert fit["method"] == "swing"
    assert abs(fit["north_deg"] - truth["north_deg"]) * 3600 < 4 * fit["north_sd_arcsec"]
    assert set(fit["by"]) == {"swing", "reversal", "transit"}
    assert fit["files"] == ["cal.json", "pier.html"]
    np.testing.assert_allclose(
        load("cal.json").rotation.as_matrix(), np.array(fit["matrix_mb"]).T, atol=1e-12
    )
    page = Path("pier.html").read_text()
    assert "The swing" in page
    assert page.count('<figure class="strip"') == 3


def test_north_for_people(capsys, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "100")  # as wide as a file
    assert run(["simulate", "north", "-o", "pier"]) == 0
    capsys.readouterr()
    assert run(["fit", "north", "pier/north.toml", "--report", "pier.txt"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("✓ simulated: good (north by a gyrotheodolite, damped sinusoid)")
    assert "mark" in said
    assert max(map(len, said.splitlines())) <= 100
    assert Path("pier.txt").read_text() in said.replace("\nWritten", "Written")


def test_uncertain_axes_of_the_reference_widen_the_alignment(capsys) -> None:
    assert run(["simulate", "north", "-o", "pier"]) == 0
    capsys.readouterr()
    _, exact = answer(capsys, "fit", "north", "pier")
    file = Path("pier/north.toml")
    file.write_text(file.read_text().replace('axes = "NED"', 'axes = "NED"\naxes_sd_arcsec = 30'))
    _, uncertain = answer(capsys, "fit", "north", "pier")
    np.testing.assert_allclose(uncertain["matrix_mb"], exact["matrix_mb"], atol=30 * ARCSEC_RAD)
    assert exact["worst_sd_arcsec"] < 5
    assert 10 < uncertain["worst_sd_arcsec"] < 40


@pytest.mark.recordings
def test_a_sheet_of_an_observatory(capsys, recordings: Path) -> None:
    sheet = str(recordings / "observatory" / "di_flux" / "2022-08-10_07-38-00_A2_WIC.txt")
    status, said = answer(capsys, "fit", "north", sheet, "--report", "sheet.html")
    assert (status, said["schema"]) == (0, "agonic/fit-di-flux@1")
    assert said["declination_deg"] == pytest.approx(4.8976, abs=2e-3)
    assert said["inclination_deg"] == pytest.approx(64.4642, abs=2e-3)
    assert {"delta_sd_arcsec", "epsilon_sd_arcsec", "offset_sd", "meridian_sd_arcsec"} <= set(said)
    assert "Absolute measurement" in Path("sheet.html").read_text()
    assert run(["fit", "north", sheet]) == 0
    assert "Declination" in capsys.readouterr().out
    assert "gives no calibration" in complaint(capsys, "fit", "north", sheet, "-o", "a.json")


def test_from_a_simulated_coil_to_its_axis(capsys) -> None:
    status, truth = answer(capsys, "simulate", "coil", "-o", "coil", "--seed", "3")
    status, fit = answer(capsys, "fit", "coil", "coil", "--report", "coil.html")
    assert (status, fit["schema"], fit["verdict"]) == (0, "agonic/fit-coil@1", "good")
    assert set(fit["axes"]) == {"m", "b", "n", "e", "i"}
    off = np.array(fit["axes"]["n"]["axis"]) - truth["axis_n"]
    assert np.linalg.norm(off) * 206_265 < 4 * fit["axes"]["n"]["sd_arcsec"]
    assert fit["axes"]["m"]["sd_arcsec"] < 1.0
    assert abs(fit["constant_nT_A"] - 40_000) < 4 * fit["constant_sd_nT_A"]
    assert "100 current reversals" in Path("coil.html").read_text()
    assert run(["fit", "coil", "coil/coil.toml"]) == 0
    assert "nT/A" in capsys.readouterr().out


def test_gravity_from_a_log(capsys) -> None:
    made = simulate_gravity(seed=5)
    write_csv(made.samples, "log.csv")
    status, fit = answer(capsys, "fit", "gravity", "log.csv", "-o", "cal.json")
    assert (status, fit["schema"], fit["n"]) == (0, "agonic/fit-gravity@1", 24)
    np.testing.assert_allclose(fit["matrix_bm"], made.rot_bm, atol=2e-3)
    assert load("cal.json").frame_out == "b"
    write_csv(simulate_gravity(tilt_deg=0.05).samples, "level.csv")
    status, fit = answer(capsys, "fit", "gravity", "level.csv", "-o", "no.json")
    assert (status, fit["verdict"], fit["files"]) == (1, "refused", [])
    assert not Path("no.json").exists()


def test_bad_input_is_one_line(capsys) -> None:
    assert "there is no such file" in complaint(capsys, "fit", "north", "nowhere")
    assert "there is no such file" in complaint(capsys, "fit", "coil", "nowhere")
    assert run(["simulate", "north", "-o", "pier"]) == 0
    assert "--field belongs to DI-flux" in complaint(
        capsys, "fit", "north", "pier", "--field", "5e4"
    )
    assert "name it .html or .txt" in complaint(
        capsys, "fit", "north", "pier", "--report", "pier.pdf"
    )
    write_csv(simulate_gravity(orientations=2).samples, "log.csv")
    assert "6 are needed" in complaint(capsys, "fit", "gravity", "log.csv")
