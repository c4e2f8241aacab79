"""A kind of file is a line in `formats`, a reader and a word in the docs; a table costs little."""

import json
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from agonic.logs.formats import FORMATS, TEXT, Format

ROOT = Path(__file__).parents[2]
DOC = "docs/jobs/read-a-log.md"
TABLE = "time_s,mag_x_nT,mag_y_nT,mag_z_nT\n0,1,2,3\n1,4,5,6\n"
LOADED = """
import json, sys
{do}
print(json.dumps(sorted(sys.modules)))
"""


def loaded(do: str) -> list[str]:
    """The modules that a new process has loaded after some statements."""
    code = LOADED.format(do=do)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True)
    modules: list[str] = json.loads(done.stdout.splitlines()[-1])
    return modules


def test_reading_a_table_imports_neither_scipy_nor_a_writer_nor_another_reader(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text(TABLE)
    modules = loaded(f"import agonic as ag; ag.read({str(path)!r})")
    readers = {f"agonic.logs.{kind.module}" for kind in FORMATS}
    assert not [m for m in modules if m.startswith(("scipy", "agonic.exports", "agonic.fit"))]
    assert not readers.intersection(modules)
    ours = [m for m in modules if m.startswith("agonic")]
    assert len([m for m in ours if not m.startswith("agonic.logs")]) < 16
    assert len(ours) <= 46


@pytest.mark.parametrize("kind", [*FORMATS, TEXT], ids=lambda kind: kind.module)
def test_a_kind_of_file_has_a_reader_and_is_in_the_docs(kind: Format):
    assert find_spec(f"agonic.logs.{kind.module}") is not None, "the module is missing"
    reads = hasattr(kind.reader, "read_tables") or hasattr(kind.reader, "read")
    assert reads, "the module needs read_tables(path) -> Found, or read(path, source, unit) -> Log"
    name = kind.name.split(" (")[0]
    assert name in (ROOT / DOC).read_text(), f"{DOC} does not mention {name}"


def test_no_reader_is_without_its_line():
    folder = ROOT / "src/agonic/logs"
    named = {kind.module for kind in (*FORMATS, TEXT)}
    modules = {
        ".".join(path.relative_to(folder).with_suffix("").parts)
        for path in folder.rglob("*.py")
        if re.search(
            r"^def read(_tables\(path: Path\) -> Found|\(path: Path, source)",
            path.read_text(),
            re.M,
        )
    }
    assert modules == named, "a reader without a line in logs/formats.py, or the reverse"
