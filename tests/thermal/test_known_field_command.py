"""`agonic fit thermal LOG --reference`: a sensor in a coil, from a table to a calibration."""

from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from tests.command_line import answer, complaint
from tests.thermal.coil import simulate_thermal_coil


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A table with the coil's field in columns of its own, and that field as a log."""
    folder = tmp_path_factory.mktemp("coil")
    made = simulate_thermal_coil(1200, noise=30.0, seed=2)
    samples, coil = made.samples, made.reference.values
    columns = [samples.time, *samples.field.T, samples.temperature, *(coil.T / 1000.0)]
    header = "time_s,mag_x_nT,mag_y_nT,mag_z_nT,temperature_C,coil x (uT),coil y (uT),coil z (uT)"
    np.savetxt(
        folder / "log.csv", np.column_stack(columns), header=header, delimiter=",", comments=""
    )
    header = "time_s,mag_x_nT,mag_y_nT,mag_z_nT"
    table = np.column_stack([samples.time, coil])
    np.savetxt(folder / "field.csv", table, header=header, delimiter=",", comments="")
    ag.save(made.truth, folder / "truth.json")
    return folder


@pytest.mark.parametrize("given", ["coil x (uT),coil y (uT),coil z (uT)", "field.csv", "coil"])
def test_the_field_may_be_columns_another_log_or_another_sensor(
    capsys, logs: Path, given: str, tmp_path: Path
) -> None:
    known = str(logs / given) if given.endswith(".csv") else given
    asked = ["fit", "thermal", str(logs / "log.csv"), "--reference", known, "--degree", "2"]
    asked += ["--sensor", "mag"] if given.endswith(".csv") else []
    status, said = answer(capsys, *asked, "-o", str(tmp_path / "out"))
    assert status == 0
    assert said["verdict"] == "good"
    assert said["reference_kind"] == "vector"
    found, truth = ag.load(tmp_path / "out" / "mag.json"), ag.load(logs / "truth.json")
    z = (found.bias_at([30.0, 60.0]) - truth.bias_at([30.0, 60.0])) / found.sd_at([30.0, 60.0])[
        :, :3
    ]
    assert np.abs(z).max() < 4.0
    assert (tmp_path / "out" / "report.html").exists()


def test_what_is_no_field_is_told(capsys, logs: Path) -> None:
    said = complaint(capsys, "fit", "thermal", str(logs / "log.csv"), "--reference", "abc")
    assert "neither a file, nor three columns" in said
