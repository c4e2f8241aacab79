"""MR: the twelve numbers of affine, chain and thermal, with the errors of all steps."""

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.errors import AgonicError
from agonic.exports.table import MR_NAMES, write_mr, write_table
from agonic.simulation import random_calibration

OWN = ag.Affine(
    bias=[400.0, -300.0, 100.0],
    matrix=[[1.1, 0.02, -0.01], [0.02, 0.9, 0.03], [-0.01, 0.03, 1.05]],
    covariance=np.diag([9.0, 16.0, 25.0, *([1e-6] * 6)]),
)
TURN = ag.alignment.Alignment(
    rotation=Rotation.from_rotvec([0.3, -0.4, 1.1]), covariance=np.diag([1e-6, 4e-6, 9e-6])
)


def read(path: Path) -> tuple[np.ndarray, list[float | None]]:
    lines = path.read_text().splitlines()
    rows = list(csv.reader(line for line in lines if not line.startswith("#")))[1:]
    assert tuple(row[0] for row in rows) == MR_NAMES
    values = np.array([float(row[1]) for row in rows]).reshape(3, 4)
    return values, [float(row[2]) if row[2] else None for row in rows]


@pytest.mark.parametrize("calibration", [OWN, ag.Chain(steps=(OWN, TURN))], ids=["affine", "chain"])
def test_the_numbers_correct_a_reading(calibration, tmp_path) -> None:
    raw = np.random.default_rng(1).normal(0, 3e4, (20, 3))
    values, _ = read(write_mr(calibration, tmp_path / "mr.csv").path)
    assert values[:, 0] + raw @ values[:, 1:].T == pytest.approx(calibration.correct(raw))


def test_standard_errors_are_the_scatter_of_many_draws(tmp_path) -> None:
    """Bias, matrix and mounting drawn from their covariances, multiplied out each time."""
    rng = np.random.default_rng(2)
    drawn = []
    for _ in range(4000):
        off = rng.standard_normal(9) * np.sqrt(np.diag(OWN.covariance))
        xx, yy, zz, xy, xz, yz = off[3:]
        matrix = OWN.matrix + np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        wobble = Rotation.from_rotvec(rng.standard_normal(3) * np.sqrt(np.diag(TURN.covariance)))
        matrix = (wobble * TURN.rotation).as_matrix() @ matrix
        offset = -matrix @ (OWN.bias + off[:3])
        drawn.append(np.concatenate([offset[:, None], matrix], axis=1).ravel())
    chain = ag.Chain(steps=(OWN, TURN))
    _, errors = read(write_mr(chain, tmp_path / "mr.csv").path)
    assert errors == pytest.approx(np.std(drawn, axis=0), rel=0.06)
    table = write_table(chain, tmp_path / "table.csv").path.read_text()
    rows = [row for row in csv.reader(table.splitlines()) if row[0] in ("bias_x", "matrix_xy")]
    assert all(float(row[2]) > 0 for row in rows)


def test_a_chain_with_an_unsure_step_states_no_error(tmp_path) -> None:
    unsure = ag.Chain(steps=(random_calibration(np.random.default_rng(0)), TURN))
    _, errors = read(write_mr(unsure, tmp_path / "mr.csv").path)
    assert errors == [None] * 12


def test_one_that_changes_with_temperature_is_held(tmp_path) -> None:
    warm = ag.thermal.Thermal(
        bias=[[0, 0, 0], [50, 0, 0]],
        matrix=[np.eye(3), np.zeros((3, 3))],
        centre_C=20.0,
        half_range_C=30.0,
    )
    with pytest.raises(AgonicError, match="say which"):
        write_mr(warm, tmp_path / "mr.csv")
    values, _ = read(write_mr(warm, tmp_path / "mr.csv", temperature_C=50.0).path)
    assert values[0].tolist() == [-50.0, 1.0, 0.0, 0.0]
