"""The table: every number with its standard error, where it has one."""

import csv

import numpy as np
import pytest

from agonic.calibration.affine import Affine
from agonic.errors import LogError
from agonic.exports.table import write_table
from tests.exports.read_back import parse_table

VARIANCE = np.arange(1.0, 10.0) ** 2
COVARIANCE = np.diag(VARIANCE)


def table(tmp_path, gauge, matrix, covariance=COVARIANCE):
    mag = Affine(bias=[1, 2, 3], matrix=matrix, covariance=covariance, gauge=gauge, unit_in="raw")
    return parse_table(write_table(mag, tmp_path / "mag.csv").path)


def test_symmetric_entries_share_their_error(tmp_path):
    rows = table(tmp_path, "symmetric", np.eye(3))
    assert rows["bias_y"] == (2.0, 2.0, "raw")
    assert rows["matrix_zz"] == (1.0, 6.0, "nT/raw")
    assert rows["matrix_xy"][1] == rows["matrix_yx"][1] == 7.0


def test_entries_that_the_gauge_fixes_have_no_error(tmp_path):
    rows = table(tmp_path, "triangular", np.triu(np.ones((3, 3))))
    assert rows["matrix_yz"][1] == 9.0
    assert rows["matrix_zy"] == (0.0, None, "nT/raw")


def test_without_a_covariance_there_are_no_errors(tmp_path):
    rows = table(tmp_path, "symmetric", np.eye(3), covariance=None)
    assert [sd for _, sd, _ in rows.values()] == [None] * 12


def test_spreadsheets_see_four_columns(tmp_path):
    mag = Affine(bias=[0.1, 2, 3], matrix=np.eye(3))
    lines = write_table(mag, tmp_path / "mag.csv").path.read_text().splitlines()
    rows = list(csv.reader(line for line in lines if not line.startswith("#")))
    assert rows[:2] == [
        ["parameter", "value", "standard_error", "unit"],
        ["bias_x", "0.1", "", "nT"],
    ]
    assert len(rows) == 13


def test_another_table_is_refused(tmp_path):
    path = tmp_path / "mag.csv"
    path.write_text("time_s,mag_x_nT\n0,1\n")
    with pytest.raises(LogError, match="parameter, value"):
        parse_table(path)
