"""The documentation builds without warnings or network; the notebooks it shows are true."""

import json
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agonic.citations import CITATIONS
from agonic.cli import COMMANDS

pytest.importorskip("matplotlib")
pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"


@pytest.fixture(scope="module", autouse=True)
def extensions() -> Iterator[None]:
    """The directives of the documentation, where Sphinx and these tests find the same ones."""
    with pytest.MonkeyPatch.context() as patched:
        patched.syspath_prepend(DOCS / "_ext")
        patched.setenv("COLUMNS", "88")  # conf.py sets it for good
        yield


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pages as Sphinx builds them, warnings being errors.

    It is built in this process, so that a notebook runs once for its page and for its test.
    """
    from sphinx.cmd.build import build_main

    folder = tmp_path_factory.mktemp("site")
    options = ["-W", "--keep-going", "-q", "-b", "html", "-d", str(folder / "doctrees")]
    with warnings.catch_warnings():
        warnings.simplefilter("default")  # those of other packages; Sphinx counts its own
        assert build_main([*options, str(DOCS), str(folder / "html")]) == 0
    return folder / "html"


def test_pages_hold_what_is_generated(site: Path) -> None:
    commands = (site / "commands.html").read_text(encoding="utf-8")
    assert all(f"Usage: agonic {command}" in commands for command in COMMANDS)
    assert "Usage: agonic fit ellipsoid" in commands
    columns = (site / "jobs" / "read-a-log.html").read_text(encoding="utf-8")
    assert all(name in columns for name in ("mag_x_nT", "acc_z_m_s2", "magneticfluxdensity"))
    bibliography = (site / "bibliography.html").read_text(encoding="utf-8")
    assert all(key in bibliography for key in CITATIONS)


def test_pages_fetch_nothing(site: Path) -> None:
    fetched = re.compile(r"<(?:script|link|img|iframe)[^>]*?(?:src|href)=\"(?:https?:)?//[^\"]+")
    for page in site.rglob("*.html"):
        assert not fetched.findall(page.read_text(encoding="utf-8")), page.name


def run(name: str) -> list[Any]:
    """The code cells of a notebook with what they gave."""
    from notebooks import draw_value, run_notebook

    cells = [c for c in run_notebook(ROOT / "examples" / f"{name}.ipynb") if c.kind == "code"]
    for cell in cells:
        assert cell.printed or draw_value(cell.value) or cell.value is not None, cell.text
    return cells


def test_a_drone_log() -> None:
    result, ladder, figure, error, export = run("drone_log")
    assert result.value.verdict == "good"
    assert "current_A" in ladder.printed.splitlines()[-1]
    assert np.abs(error.value).max() < 4
    assert hasattr(figure.value, "savefig")
    assert "COMPASS_MOT_X" in export.printed


def test_a_chamber_campaign() -> None:
    result, *_ = run("chamber_campaign")
    assert result.value.verdict == "good"
    assert len(result.value.sensors) == 2


def test_a_satellite() -> None:
    fit, bias, figure = run("satellite")
    assert fit.value.verdict == "good"
    assert np.abs(bias.value[0]).max() > 1000
    assert hasattr(figure.value, "savefig")


def test_a_sketch_that_prints_counts() -> None:
    result, figure, corrected, header = run("maker")
    assert result.value.verdict == "good"
    assert hasattr(figure.value, "savefig")
    assert corrected.value.shape == (3, 3)
    assert "[counts]" in header.printed


def test_files_and_fits_from_python() -> None:
    fit, _, shares, verification, corrected, difference = run("from_python")
    assert fit.value.verdict == "good"
    assert "noise and coverage" in shares.value
    assert verification.value.passed
    assert len(corrected.value) == 1500
    assert "chance" in difference.value


def test_a_notebook_of_a_person_has_ten_lines() -> None:
    for name in ("drone_log", "maker", "rover", "satellite", "from_python"):
        cells = json.loads((ROOT / "examples" / f"{name}.ipynb").read_text(encoding="utf-8"))
        code = "".join("".join(c["source"]) + "\n" for c in cells["cells"] if "outputs" in c)
        assert len([line for line in code.splitlines() if line.strip()]) <= 10, name


def test_a_rover() -> None:
    alone, result, figure = run("rover")
    assert alone.value.verdict == "refused"
    assert result.value.verdict == "good"
    assert hasattr(figure.value, "savefig")
