"""A new export is a module, a line in `TARGETS` and a row in the docs: what is missing is named."""

import inspect
import re
from importlib import import_module
from pathlib import Path

import pytest

import agonic as ag
from agonic.calibration.affine import Affine
from agonic.cli import run
from agonic.exports.targets import TARGETS

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", TARGETS)
def test_a_target_is_where_it_must_be(name, capsys):
    target = TARGETS[name]
    module, function = target.writer.split(":")
    writer = getattr(import_module(f"agonic.exports.{module}"), function, None)
    assert writer, f"exports/{module}.py has no {function}"
    page = (ROOT / "docs/jobs/export.md").read_text()
    row = f"| `{name}` `{target.suffix}` |"
    assert row in page, f"docs/jobs/export.md has no row {row}"
    readme = " ".join(re.findall(r"agonic export .*", (ROOT / "README.md").read_text()))
    assert re.search(rf"\b{name}\b", readme), f"README.md does not name {name}"
    assert run(["export", "--help"]) == 0
    assert re.search(rf"\b{name}\b", capsys.readouterr().out), "the help does not list it"
    assert inspect.unwrap(getattr(ag, function)) is writer, (
        f"__init__.pyi has no line for {function}"
    )


@pytest.mark.parametrize("name", TARGETS)
def test_it_is_written_as_it_is_listed(name, tmp_path):
    target = TARGETS[name]
    mag = Affine(bias=[3000, 0, 0], matrix=[[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    export = target.write(mag, tmp_path / f"mag{target.suffix}", **target.options(1, 396809))
    assert export.target == name
    assert export.path.stat().st_size > 0


def test_no_writer_is_without_its_line():
    modules = {
        path.stem: re.findall(
            r"^def (write_\w+)\(\s*calibration: Calibration,\s*path", path.read_text(), re.MULTILINE
        )
        for path in (ROOT / "src/agonic/exports").glob("*.py")
    }
    written = {f"{module}:{name}" for module, names in modules.items() for name in names}
    assert written == {target.writer for target in TARGETS.values()}
