"""The benchmarks: every script starts, every table says what made it, no cost grows too fast."""

from __future__ import annotations

import ast
import importlib
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from benchmarks import facts, ratios, run
from benchmarks.growth import Spent as Grown
from benchmarks.growth import exponent
from benchmarks.timing import Pair, Spent, measure

ROOT = Path(__file__).parents[1]
RESULTS = sorted((ROOT / "benchmarks" / "results").glob("*.md"))
SCRIPTS = sorted(path.stem for path in (ROOT / "benchmarks").glob("*.py"))
MADE = re.compile(
    r"Made by (`python -m benchmarks\.\w+[^`]*`( and )?)+ (?P<seconds>in \d+ s )?"
    r"on \d{4}-\d\d-\d\d\.\n"
    r"agonic (?P<version>\S+)( \([\w.-]+\))?, Python [\d.]+, numpy [\d.]+, scipy [\d.]+.*\n"
    r"\d+ cores.*Linux.*\n\Z"
)


@pytest.mark.parametrize("script", [name for name in SCRIPTS if name != "__init__"])
def test_every_script_starts(script: str) -> None:
    importlib.import_module(f"benchmarks.{script}")


@pytest.mark.parametrize("script", SCRIPTS)
def test_what_scripts_take_from_one_another_is_there(script: str) -> None:
    """Also what is imported when its turn comes, an hour after the start."""
    tree = ast.parse((ROOT / "benchmarks" / f"{script}.py").read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("benchmarks."):
            module = importlib.import_module(str(node.module))
            assert not [name.name for name in node.names if not hasattr(module, name.name)]


@pytest.mark.parametrize("page", RESULTS, ids=lambda page: page.stem)
def test_every_table_says_what_made_it(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    found = MADE.search(text)
    assert found, text[-400:]
    (part,) = [part for part in run.PARTS if part.name == page.stem]
    if found["seconds"]:  # made by benchmarks.run, which writes the seconds and the rivals
        for rival in part.rivals:
            assert rival in found[0], f"{page.name} does not say which {rival} it was"


def test_tables_are_of_one_version() -> None:
    versions = {MADE.search(page.read_text(encoding="utf-8"))["version"] for page in RESULTS}  # type: ignore[index]
    assert len(versions) == 1


def test_every_part_has_its_table_and_its_line_in_the_readme() -> None:
    written = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    for part in run.PARTS:
        assert f"(results/{part.name}.md)" in written, part.name
    linked = set(re.findall(r"\(results/(\w+)\.md\)", written))
    assert linked == {page.stem for page in RESULTS}


def test_facts_name_what_is_not_there() -> None:
    made_with = facts.software(("numpy", "no-such-package"))
    said = facts.describe(["benchmarks.speed"], 3.0, 0.5, made_with)
    assert "Made by `python -m benchmarks.speed` in 3 s" in said
    assert "no-such-package not installed" in said
    assert MADE.search(said + "\n") or "Linux" not in said


@pytest.mark.parametrize("cost_s", [0.001, 0.5, 30.0])
def test_what_costs_thrice_has_the_ratio_three(
    monkeypatch: pytest.MonkeyPatch, cost_s: float
) -> None:
    """By a clock that works alone move: what else a machine does would count otherwise."""
    clock = [0.0]

    def work(cost: float) -> Callable[[], None]:
        return lambda: clock.append(clock[-1] + cost)

    monkeypatch.setattr("benchmarks.timing.time.process_time", lambda: clock[-1])
    monkeypatch.setattr("benchmarks.timing.gc.collect", lambda: 0)  # of all tests before: half a s
    spent = measure(Pair("a", work(3 * cost_s), "b", work(cost_s)), 2)
    assert spent == pytest.approx((3 * cost_s, cost_s))
    assert spent.ratio == pytest.approx(3.0)


def test_kept_ratios_are_read_and_what_is_slower_is_named(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    pairs = [Pair("quick job", int, "numpy", int), Pair("slow job", int, "numpy", int)]
    spent = {"quick job": Spent(1.0, 2.0), "slow job": Spent(3.0, 2.0)}
    head = (
        "| job | agonic, ms | beside | its time, ms | over |\n| --- | ---: | ---: | ---: | ---: |"
    )
    lines = [f"| {pair.name} | 1 | numpy | 2 | 0.5 |" for pair in pairs]
    (tmp_path / "ratios.md").write_text("\n".join(["# Ratios", head, *lines]))
    monkeypatch.setattr(ratios.tables, "RESULTS", tmp_path)
    monkeypatch.setattr(ratios, "jobs", lambda folder: iter(pairs))
    monkeypatch.setattr(ratios, "measure", lambda pair, rounds: spent[pair.name])
    ratios.compare(1)
    said = capsys.readouterr().out
    assert "slow job (beside numpy): 3.00 times the kept ratio" in said
    assert "quick job (beside" not in said


def test_exponent_of_a_quadratic_cost_is_two() -> None:
    spent = [(10**k, Grown(1e-5 * 10 ** (2 * k), 0.0)) for k in (1, 2, 3)]
    assert exponent(spent) == pytest.approx(2.0)


def test_no_cost_grows_faster_than_the_rows() -> None:
    """Slopes of a table that was made beside other work err by a tenth."""
    page = (ROOT / "benchmarks" / "results" / "growth.md").read_text(encoding="utf-8")
    of_rows = page.split("## With ")[1]
    lines = [line.strip("| ").split(" | ") for line in of_rows.splitlines() if " rows |" in line]
    assert len(lines) > 15
    assert {line[0]: line[5] for line in lines if float(line[5]) > 1.25} == {}
