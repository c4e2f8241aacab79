"""Rows of several kinds in one text file: the name of its sensor is in each."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from agonic.errors import LogError
from agonic.logs.read import open_log

N = 120
RNG = np.random.default_rng(4)
TIME = np.arange(N) * 0.02 + 3.0
FIELD = RNG.normal(0.0, 30.0, (N, 3)).round(3)
ACC = RNG.normal((0.0, 0.0, 9.81), 0.2, (N, 3)).round(4)
STATED = """% LogFile Data format:
% Accelerometer data: \t'ACCE;AppTimestamp(s);SensorTimestamp(s);Acc_X(m/s^2);Acc_Y(m/s^2);Acc_Z(m/s^2);Accuracy(integer)'
% Magnetometer data:  \t'MAGN;AppTimestamp(s);SensorTimestamp(s);Mag_X(uT);;Mag_Y(uT);Mag_Z(uT);Accuracy(integer)'
% Light data:         \t'LIGH;AppTimestamp(s);SensorTimestamp(s);Light(lux);Accuracy(integer)'
"""  # noqa: E501


def write(path: Path, form: str, head: str = "", kinds: tuple[str, str] = ("MAGN", "ACCE")) -> Path:
    """A file of readings in turn, in a `form` that takes kind, time and three numbers."""
    lines = []
    for k in range(N):
        for kind, vector, later in ((kinds[0], FIELD[k], 0.0), (kinds[1], ACC[k], 0.004)):
            x, y, z = vector
            lines.append(form.format(kind=kind, t=f"{TIME[k] + later:.3f}", x=x, y=y, z=z))
    path.write_text(head + "\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize(
    ("form", "kinds"),
    [
        ("{kind};{t};7{t};{x};{y};{z};3", ("MAGN", "ACCE")),  # GetSensorData without its comments
        ("{t} {kind} {x} {y} {z}", ("MAG", "ACC")),
        ("{t}, {kind}, {x}, {y}, {z}", ("magnetometer", "accelerometer")),
        ("{kind}\t{t}\t{x}\t{y}\t{z}", ("TYPE_MAGNETIC_FIELD", "TYPE_ACCELEROMETER")),
    ],
)
def test_names_of_sensors_tell_kinds(tmp_path: Path, form: str, kinds: tuple[str, str]) -> None:
    log = open_log(write(tmp_path / "log.txt", form, kinds=kinds))
    (samples,) = log.sensors
    assert samples.time is not None
    assert samples.acceleration is not None
    assert samples.unit == "raw"
    np.testing.assert_allclose(samples.field, FIELD, atol=1e-9)
    np.testing.assert_allclose(np.diff(samples.time), 0.02, atol=1e-6)
    between = ACC[:-1] + 0.8 * (ACC[1:] - ACC[:-1])  # 16 of the 20 ms from row to row
    np.testing.assert_allclose(samples.acceleration[1:], between, atol=1e-6)
    assert any("there is no header" in note for note in (*log.notes, *samples.notes))


def test_getsensordata_states_its_columns(tmp_path: Path) -> None:
    """With a separator too many in the line of the magnetometer, as the program writes it."""
    path = write(tmp_path / "log.txt", "{kind};{t};7{t};{x};{y};{z};3", head=STATED)
    (samples,) = open_log(path).sensors
    np.testing.assert_allclose(samples.field, FIELD * 1e3, atol=1e-6)
    assert samples.acceleration is not None


def test_cells_that_may_be_anything_are_not_guessed(tmp_path: Path) -> None:
    """Four numbers of which the first is no clock and the last changes."""
    rows = [f"MAG {x} {y} {z} {x + 1}" for x, y, z in FIELD]
    path = tmp_path / "log.txt"
    path.write_text("\n".join(rows))
    with pytest.raises(LogError, match="no header"):
        open_log(path)
