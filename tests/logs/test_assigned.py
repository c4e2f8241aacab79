"""Readings that were pasted into a program: arrays that MATLAB, Python, C and others give names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from agonic.logs.read import open_log

FIELD = np.random.default_rng(3).normal(0.0, 300.0, (40, 3)).round(1)
TIME = np.arange(40) * 0.1


def join(rows: np.ndarray, between: str, form: str = "{}", cells: str = " ") -> str:
    return between.join(form.format(cells.join(map(str, row))) for row in rows)


@pytest.mark.parametrize(
    "text",
    [
        f"% turned by hand\nmag = [\n{join(FIELD, ';' + chr(10))};\n];\nplot3(mag)",
        f"mag = [{join(FIELD, '; ', cells=', ')}];",
        f"mag = [{join(FIELD, chr(10))}];",
        f"mag = [ ...\n{join(FIELD.T, '; ...' + chr(10))}];",
        "\n".join(
            f"m{axis} = [{' '.join(map(str, FIELD[:, k]))}];" for k, axis in enumerate("xyz")
        ),
        "import numpy as np\nmag = np.array([\n"
        + join(FIELD, ",\n", "    [{}]", ", ")
        + ",  # last\n])\nprint(mag)",
        f"data = [[{join(FIELD, '], [', cells=', ')}]]",
        "#define N 40\nstatic const float mag[N][3] = {\n"
        + join(FIELD, ",\n", "  {{{}f}}", "f, ")
        + "\n};",
    ],
    ids=["rows", "a line", "ends of lines", "axes", "a name an axis", "NumPy", "lists", "C"],
)
def test_arrays_with_names_are_read(tmp_path: Path, text: str) -> None:
    path = tmp_path / "readings.m"
    path.write_text(text)
    (samples,) = open_log(path).sensors
    np.testing.assert_allclose(samples.field, FIELD)


def test_times_and_other_sensors_beside_it(tmp_path: Path) -> None:
    """Of the same length; what is of another one is something else."""
    path = tmp_path / "readings.m"
    path.write_text(
        f"time_s = [{' '.join(map(str, TIME))}];\nmag_uT = [{join(FIELD / 10, '; ')}];\n"
        f"acc = [{join(FIELD * 0 + (0.0, 0.0, 9.81), '; ')}];\nA = [1 0 0; 0 1 0; 0 0 1];"
    )
    (samples,) = open_log(path).sensors
    np.testing.assert_allclose(samples.field, FIELD * 100.0)
    assert samples.time is not None
    assert samples.acceleration is not None
    np.testing.assert_allclose(samples.time, TIME)


def test_settings_above_a_table_are_no_readings(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("q = [1, 0, 0, 0]\nmag_x,mag_y,mag_z\n" + join(FIELD, "\n", cells=","))
    (samples,) = open_log(path).sensors
    np.testing.assert_allclose(samples.field, FIELD)
