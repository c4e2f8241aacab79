"""The recipes of the architecture page, followed: a reader and an export that were not there."""

import json
from pathlib import Path

import pytest

import agonic as ag
import agonic.exports
import agonic.logs
from agonic.cli import run
from agonic.exports import targets
from agonic.logs import formats

READER = '''
"""Readings of a logger whose files begin with PIGEON."""

from pathlib import Path

import numpy as np

from agonic.logs.log import Log
from agonic.logs.table import build_log
from agonic.provenance import Input


def read(path: Path, source: Input, unit: str | None) -> Log:
    """Read a PIGEON file: four numbers a line, seconds and the field."""
    rows = np.loadtxt(path, skiprows=1)
    names = ("time_s", "mag_x_uT", "mag_y_uT", "mag_z_uT")
    table = dict(zip(names, rows.T, strict=True))
    return build_log(table, path=path, source=source, format="PIGEON", unit=unit)
'''

WRITER = '''
"""PIGEON: a line of twelve numbers."""

from pathlib import Path

from agonic.atomic import write_atomically
from agonic.calibration.base import Calibration
from agonic.exports.convert import Export, require_physical
from agonic.exports.temperature import hold_temperature


def write_pigeon(
    calibration: Calibration, path: Path | str, *, temperature_C: float | None = None
) -> Export:
    """Write bias and matrix in a line."""
    one, warnings = hold_temperature(calibration, temperature_C)
    bias, matrix = require_physical(one, "nT")
    line = " ".join(map(repr, [*bias.tolist(), *matrix.ravel().tolist()]))
    return Export(path=write_atomically(path, line), target="pigeon", warnings=warnings)
'''


def test_a_reader_is_a_module_and_a_line(tmp_path, monkeypatch, capsys) -> None:
    """`logs/pigeon.py` with `read`, and a line in `FORMATS`: nothing else."""
    (tmp_path / "pigeon.py").write_text(READER)
    monkeypatch.setattr(agonic.logs, "__path__", [*agonic.logs.__path__, str(tmp_path)])
    line = formats.Format("Pigeon (.pgn)", "pigeon", lambda head: head.startswith(b"PIGEON"))
    monkeypatch.setattr(formats, "FORMATS", (line, *formats.FORMATS))
    log = tmp_path / "flight.pgn"
    log.write_text("PIGEON\n0 20 1 43\n1 19 2 43\n2 18 3 42\n")
    samples = ag.read(log)
    assert samples.field[1].tolist() == [19_000.0, 2_000.0, 43_000.0]
    assert run(["info", str(log), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["format"] == "PIGEON"


def test_an_export_is_a_module_and_a_line(tmp_path, monkeypatch, capsys) -> None:
    """`exports/pigeon.py` with `write_pigeon`, and a line in `TARGETS`: nothing else."""
    (tmp_path / "pigeon.py").write_text(WRITER)
    monkeypatch.setattr(agonic.exports, "__path__", [*agonic.exports.__path__, str(tmp_path)])
    monkeypatch.setitem(targets.TARGETS, "pigeon", targets.Target("pigeon:write_pigeon", ".pgn"))
    mag = ag.Affine(bias=[3000.0, 0.0, 0.0], matrix=[[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    ag.save(mag, tmp_path / "mag.json")
    out = tmp_path / "mag.pgn"
    asked = ["export", str(tmp_path / "mag.json"), "--to", "pigeon", "-o", str(out), "--json"]
    assert run(asked) == 0
    assert capsys.readouterr().err == ""
    assert out.read_text().split()[0] == "3000.0"
    with pytest.raises(ag.AgonicError, match="pigeon"):
        targets.write("carrier", mag, out)


def test_the_page_tells_of_both() -> None:
    page = (Path(__file__).parents[1] / "docs/architecture.md").read_text()
    assert "`logs/formats.py`" in page
    assert "`exports/targets.py`" in page
