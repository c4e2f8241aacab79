"""The MAT-file: what MATLAB's magcal would have returned."""

import numpy as np
import pytest
from scipy.io import loadmat
from scipy.io.matlab import matfile_version
from scipy.spatial.transform import Rotation

from agonic.calibration.affine import Affine
from agonic.errors import LogError
from agonic.exports.matlab import write_matlab
from tests.exports.read_back import parse_matlab

TURNED = Rotation.from_euler("z", 20, degrees=True).as_matrix() @ np.diag([1.2, 1.1, 1.0])
MAG = Affine(bias=[3000.0, -2000.0, 100.0], matrix=TURNED, magnitude=48000.0)


def test_rows_times_a_give_the_field(tmp_path):
    path = write_matlab(MAG, tmp_path / "mag.mat").path
    held = loadmat(path)
    rows = np.array([[13000.0, -2000.0, 100.0], [3000.0, 8000.0, 100.0]])
    assert np.allclose((rows - held["b"]) @ held["A"], MAG.correct(rows))
    assert not np.allclose((rows - held["b"]) @ held["A"].T, MAG.correct(rows))
    assert held["b"].shape == (1, 3)
    assert held["expmfs"].item() == 48000.0
    assert held["unit_in"].item() == "nT"
    assert "C = (D - b) * A" in held["about"].item()


def test_it_is_a_version_5_file_without_a_clock(tmp_path):
    path = write_matlab(MAG, tmp_path / "mag.mat").path
    assert matfile_version(str(path))[0] == 1
    assert path.read_bytes().startswith(b"MATLAB 5.0 MAT-file, magnetometer calibration")
    assert b"Created on" not in path.read_bytes()


def test_an_unknown_magnitude_is_nan_and_said(tmp_path):
    export = write_matlab(Affine(bias=np.zeros(3), matrix=np.eye(3)), tmp_path / "mag.mat")
    assert np.isnan(parse_matlab(export.path)["expmfs"])
    assert any("expmfs" in w for w in export.warnings)


@pytest.mark.parametrize("content", [b"", b"text", b"\0" * 200, b"x" * 500])
def test_other_files_are_refused(content, tmp_path):
    path = tmp_path / "mag.mat"
    path.write_bytes(content)
    with pytest.raises(LogError, match="MAT-file"):
        parse_matlab(path)
