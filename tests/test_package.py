"""agonic as a package that others build on: its types, its extras, what installed packages add."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.logs.any_form import as_samples

ROOT = Path(__file__).parents[1]
PIGEON = ROOT / "examples" / "agonic-pigeon"


@pytest.fixture
def installed(tmp_path: Path) -> dict[str, str]:
    """The environment of a process in which the example package is installed."""
    site = tmp_path / "site"
    about = site / "agonic_pigeon-1.0.dist-info"
    about.mkdir(parents=True)
    shutil.copy(PIGEON / "agonic_pigeon.py", site)
    told = tomllib.loads((PIGEON / "pyproject.toml").read_text())["project"]
    (about / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {told['name']}\nVersion: {told['version']}\n"
    )
    points = (
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in points.items())
        for group, points in told["entry-points"].items()
    )
    (about / "entry_points.txt").write_text("\n".join(points))
    return {**os.environ, "PYTHONPATH": os.pathsep.join((str(site), *sys.path))}


def test_an_installed_reader_and_export_are_those_of_agonic(installed, tmp_path) -> None:
    log = tmp_path / "flight.pgn"
    log.write_text("PIGEON\n0 20 1 43\n1 19 2 43\n2 18 3 42\n")
    ag.save(ag.Affine(bias=[3000.0, 0.0, 0.0], matrix=np.eye(3)), tmp_path / "mag.json")

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "agonic", *arguments]
        return subprocess.run(
            command, cwd=tmp_path, env=installed, capture_output=True, text=True, timeout=120
        )

    assert '"format":"PIGEON"' in run("info", "flight.pgn", "--json").stdout.replace(": ", ":")
    done = run("export", "mag.json", "--to", "pigeon")
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "mag.pgn").read_text().split()[0] == "3000.0"
    (tmp_path / "site" / "agonic_pigeon.py").write_text("import nowhere")
    assert "agonic_pigeon:READER, installed for agonic.readers" in run("info", "flight.pgn").stderr


def test_types_are_told_to_those_who_import_it() -> None:
    assert (files("agonic") / "py.typed").is_file()


def test_every_extra_has_a_reason_and_every_sentence_an_extra() -> None:
    """None is empty, each is told of in the page, and each one that is named is there."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"][
        "optional-dependencies"
    ]
    assert all(extras.values())
    page = (ROOT / "docs" / "install.md").read_text()
    assert set(re.findall(r"`agonic\[(\w+)\]`", page)) == set(extras) - {"dev", "bench", "peers"}
    source = "".join(path.read_text() for path in (ROOT / "src").rglob("*.py"))
    named = set(re.findall(r"MissingExtraError\([^)]*\"(\w+)\"\)", source))
    assert named <= set(extras)
    assert {"pandas", "cluster", "remote", "tables"} <= named


FIELD = np.array([[20.0, 0.0, 43.0], [0.0, 20.0, 43.0], [-20.0, 0.0, 43.0], [0.0, -20.0, 43.0]])
COLUMNS = {"time_s": np.arange(4.0), **{f"mag_{a}_uT": FIELD[:, k] for k, a in enumerate("xyz")}}


def make_record() -> object:
    kinds = [(name, column.dtype) for name, column in COLUMNS.items()]
    record = np.empty(4, dtype=kinds)
    for name, column in COLUMNS.items():
        record[name] = column
    return record


TABLES = {
    "pandas": lambda: pytest.importorskip("pandas").DataFrame(COLUMNS),
    "polars": lambda: pytest.importorskip("polars").DataFrame(COLUMNS),
    "pyarrow": lambda: pytest.importorskip("pyarrow").table(COLUMNS),
    "batch": lambda: pytest.importorskip("pyarrow").RecordBatch.from_pydict(COLUMNS),
    "record": make_record,
    "recarray": lambda: make_record().view(np.recarray),  # type: ignore[attr-defined]
    "mapping": lambda: COLUMNS,
}


@pytest.mark.parametrize("kind", TABLES)
def test_tables_of_every_library_are_taken_alike(kind: str) -> None:
    samples = as_samples(TABLES[kind]())
    np.testing.assert_allclose(samples.field, FIELD * 1e3)
    np.testing.assert_allclose(samples.time, COLUMNS["time_s"])
