"""Text tables of the VirES service, which write a vector as {x;y;z}."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from agonic.errors import LogError
from agonic.logs.read import open_log, read
from tests.logs.damage import damaged, read_or_refused
from tests.logs.orbit_writer import swarm

COLUMNS = ("Latitude", "Longitude", "Radius", "F", "B_VFM", "B_NEC", "q_NEC_CRF", "Flags_B")


def text(n: int = 100) -> str:
    """The pass of `swarm` as such a table."""
    variables = swarm(n)
    lines = [",".join(("Spacecraft", "Timestamp", *COLUMNS))]
    for k in range(n):
        cells = ["A", f"2016-01-01T00:{k // 60:02d}:{k % 60:02d}.250Z"]
        for name in COLUMNS:
            value = variables[name][k]
            cells.append(
                "{" + ";".join(map(repr, value.tolist())) + "}"
                if value.ndim
                else repr(value.item())
            )
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def test_the_table_is_the_same_log_as_the_cdf(tmp_path: Path) -> None:
    path = tmp_path / "pass.csv"
    path.write_text(text())
    sensor, vector = open_log(path).sensors
    variables = swarm(100)
    np.testing.assert_array_equal(sensor.field, variables["B_VFM"])
    np.testing.assert_array_equal(sensor.scalar, variables["F"])
    assert (sensor.frame, vector.frame, vector.name) == ("m", "n", "B_NEC")
    np.testing.assert_allclose(sensor.time, 0.25 + np.arange(100.0), atol=1e-6)
    assert sensor.heading_deg is not None


def test_rows_that_are_not_whole_are_left_out_and_counted(tmp_path: Path) -> None:
    path = tmp_path / "pass.csv"
    path.write_text(text()[:-30])
    log = open_log(path)
    assert len(log.sensors[0]) == 99
    assert log.notes == ("1 rows are not whole: left out",)


def test_models_alone_are_no_magnetometer(tmp_path: Path) -> None:
    path = tmp_path / "model.csv"
    path.write_text("Timestamp,B_NEC_IGRF\n2016-01-01T00:00:00Z,{1;2;3}\n")
    with pytest.raises(LogError, match="no magnetometer"):
        open_log(path)


@pytest.mark.slow
def test_damage_of_any_kind_gives_a_log_or_one_clear_sentence(tmp_path: Path) -> None:
    data, rng, read_well = np.frombuffer(text().encode(), np.uint8), np.random.default_rng(5), 0
    path = tmp_path / "fuzz.csv"
    for _ in range(100):
        path.write_bytes(damaged(data, rng).tobytes())
        try:
            log = read_or_refused(open_log, path)
        except AssertionError:  # the header is gone: another reader's refusal
            assert not path.read_bytes().startswith(b"Spacecraft,Timestamp")
            continue
        if log is not None:
            read_well += 1
            assert all(np.isfinite(s.field).all() for s in log.sensors)
    assert read_well > 60


@pytest.mark.recordings
def test_text_and_cdf_of_one_pass_agree(recordings: Path) -> None:
    table, cdf = (
        read(recordings / f"orbit/swarmA_MAGA_LR_1B_20160101_10s.{kind}") for kind in ("csv", "cdf")
    )
    assert table.epoch == cdf.epoch
    for name, values in cdf.columns().items():
        np.testing.assert_allclose(getattr(table, name), values, atol=2e-3, err_msg=name)
