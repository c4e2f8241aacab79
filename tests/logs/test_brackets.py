"""Text tables whose numbers stand in brackets below a header."""

from pathlib import Path

import numpy as np
import pytest

import agonic as ag

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
