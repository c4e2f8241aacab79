"""The notebooks of examples/ run, and find what is true."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
pytest.importorskip("matplotlib")


def run(name: str) -> list[Any]:
    """The code cells of a notebook with what they gave."""
    sys.path.insert(0, str(ROOT / "docs" / "_ext"))
    try:
        from notebooks import draw_value, run_notebook
    finally:
        sys.path.pop(0)
    cells = [c for c in run_notebook(ROOT / "examples" / f"{name}.ipynb") if c.kind == "code"]
    for cell in cells:
        assert cell.printed or draw_value(cell.value) or cell.value is not None, cell.text
    return cells


def test_a_drone_log() -> None:
    samples, result, ladder, figure, error, export = run("drone_log")
    assert len(samples.value) == 3000
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
    fit, _, _, retrained, retrainer = run("satellite")
    assert fit.value.verdict == "good"
    assert "change: the candidate is better" in retrained.printed
    assert retrainer.value.verdict == "good"


def test_a_rover() -> None:
    _, alone, result, _, error, _ = run("rover")
    assert alone.value.verdict == "refused"
    assert result.value.verdict == "good"
    assert np.abs(error.value).max() < 4
