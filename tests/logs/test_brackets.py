"""Text tables whose numbers stand in brackets below a header."""

from pathlib import Path
from pprint import pformat

import numpy as np
import pytest

import agonic as ag
from agonic.errors import LogError

ROWS = [[0.1 * k, k + 1.5, -2.0 * k, 30.25] for k in range(20)]
LAYOUTS = {
    "one cell": ("time_s;mag_uT", "{};({}, {}, {})"),
    "commas within and between": ("time_s,mag_uT,temperature_C", "{},({}, {}, {}),21.5"),
    "square": ("time_s\tmag_uT", "{}\t[{} {} {}]"),
    "a name for each": ("time_s,mag_x_uT,mag_y_uT,mag_z_uT", "{},({}, {}, {})"),
    "each alone": ("time_s,mag_x_uT,mag_y_uT,mag_z_uT", "{},({}),({}),({})"),
    "whole rows": ("time_s,mag_x_uT,mag_y_uT,mag_z_uT", "({}, {}, {}, {})"),
    "blanks": ("time_s mag_x_uT mag_y_uT mag_z_uT", "{} ({} {} {})"),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_numbers_in_brackets_are_read(tmp_path: Path, layout: str) -> None:
    header, row = LAYOUTS[layout]
    path = tmp_path / "log.csv"
    path.write_text("\n".join([header, *(row.format(*cells) for cells in ROWS)]))
    samples = ag.read(path)
    np.testing.assert_allclose(samples.time, [row[0] for row in ROWS], atol=1e-9)
    np.testing.assert_allclose(samples.field, np.array(ROWS)[:, 1:] * 1000)


def test_a_number_in_brackets_behind_a_name_stays_a_part_of_it(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows = [f"{row[0]},{row[1]},{row[2]},{row[3]},MAG[0]" for row in ROWS]
    path.write_text("\n".join(["time_s,mag_x_uT,mag_y_uT,mag_z_uT,sensor", *rows]))
    assert ag.sensors(path) == ("MAG[0]",)


def test_arrays_as_numpy_prints_them_are_points(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    points = np.array(ROWS)[:, 1:] * 1e-3
    path.write_text("\n".join(f"[{x: .8e} {y: .8e} {z: .8e}]" for x, y, z in points))
    np.testing.assert_allclose(ag.read(path, unit="mT").field, points * 1e6, atol=1e-2)


PRINTED = {
    "NumPy": lambda rows: str(np.array(rows)),
    "NumPy, a number a line": lambda rows: np.array2string(np.array(rows), max_line_width=20),
    "NumPy's repr": lambda rows: repr(np.array(rows)),
    "tuples": lambda rows: str([tuple(row) for row in rows]),
    "tuples over several lines": lambda rows: pformat([tuple(row) for row in rows], width=10),
    "lists over several lines": lambda rows: pformat(rows, width=10),
}


@pytest.mark.parametrize("form", PRINTED)
@pytest.mark.parametrize("header", ["", "mag_x_uT,mag_y_uT,mag_z_uT\n", "mag_x mag_y mag_z [uT]\n"])
def test_rows_in_brackets_within_brackets_are_read(tmp_path: Path, form: str, header: str) -> None:
    path = tmp_path / "log.txt"
    points = [row[1:] for row in ROWS]
    path.write_text(header + PRINTED[form](points) + "\n")
    np.testing.assert_allclose(ag.read(path, unit="uT").field, np.array(points) * 1000)


def test_rows_that_numpy_left_out_are_told(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    path.write_text(str(np.arange(6000.0).reshape(-1, 3)))
    with pytest.raises(LogError, match="left out"):
        ag.read(path)
