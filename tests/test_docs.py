"""The documentation is complete, and its code runs."""

import ast
import doctest
import inspect
import re
import runpy
import shutil
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest
from _pytest.mark import ParameterSet

import agonic as ag
from agonic.cli import COMMANDS
from agonic.inflight.fit.allowances import COURSES
from agonic.model.terms import HIDDEN
from agonic.model.terms.time import STEP
from agonic.reproduce.run import load_documents
from agonic.samples import Logged
from agonic.thermal.fit.evidence import OTHER_TURNS, TRENDS
from agonic.thermal.fit.station_faults import TOLD

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(p for p in (ROOT / "README.md", *DOCS.rglob("*.md")) if "_build" not in p.parts)
JOB = DOCS / "jobs" / "calibrate-a-log.md"
FENCE = re.compile(r"^```(python|pycon)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
DOCTEST = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files that pages speak of: logs, and a calibration made from another.

    Content decides how a file is read, so a text table does for a dataflash log.
    """
    folder = tmp_path_factory.mktemp("recorded")
    made = ag.simulate("hand", seed=1)
    other = ag.simulate("hand", calibration=made.truth, seed=2)
    ag.write_csv(made.samples, folder / "flight.csv")
    ag.write_csv(made.samples.with_columns(name="MAG[0]"), folder / "flight.bin")
    hour = ag.simulate_vehicle(n=1000, rate_Hz=0.2, sensors=1, noise=50.0)
    ag.write_csv(hour.samples[0], folder / "orbit.csv")
    fit = ag.fit_ellipsoid(other.samples, ag.Reference.constant(50_000))
    ag.save(fit.calibration, folder / "mag.json")
    return folder


# What fits whole campaigns, orbits, networks or millions of rows.
SLOW = (
    "calibrate-in-a-chamber",
    "calibrate-in-flight",
    "calibrate-with-a-network",
    "large-data",
    "thermal_campaign",
)


def mark_slow(path: Path) -> ParameterSet:
    """A page or script to run, left out of the quick tests where it takes seconds."""
    return pytest.param(path, marks=[pytest.mark.slow] if path.stem in SLOW else [])


def test_every_public_name_is_on_the_page_of_names() -> None:
    blocks = re.findall(r"```\{public\}\n(.*?)```", text_of(DOCS / "api.md"), re.DOTALL)
    named = [name for block in blocks for name in block.split()]
    assert sorted([*named, *ag.GROUPS, "__version__"]) == sorted(ag.__all__)
    for group in ag.GROUPS:
        (block,) = re.findall(
            rf"```\{{public\}} {group}\n(.*?)```", text_of(DOCS / f"api/{group}.md"), re.DOTALL
        )
        assert sorted(block.split()) == sorted(getattr(ag, group).__all__)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_is_explained(command: str) -> None:
    assert any(f"agonic {command}" in text_of(page) for page in PAGES)


TOLD_BESIDE = {"prior"}
"""Doubts of the heading that become notes beside a graver one."""
TABLES = {
    "told.name": (*TOLD.values(), *OTHER_TURNS),
    "steady.name": (*TRENDS.values(),),
    "course.name": tuple(course for course in COURSES if course.move),
}
"""The rows of tables of findings, by how their names stand where they are said."""
JUDGED = {term.name for term in HIDDEN} | {STEP.name, "ripple", "coverage", "correlated noise"}


def findings_in_the_source() -> dict[str, set[str]]:
    """The names of findings, and how severe each can be, from the calls that make them."""
    found: dict[str, set[str]] = {}
    for text in map(text_of, (ROOT / "src" / "agonic").rglob("*.py")):
        told = "Finding(" in text or "Fact(" in text
        for node in ast.walk(ast.parse(text)) if told else ():
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Fact":
                limit = node.args[2]
                if isinstance(limit, ast.Call):  # Limit(check, refuse, note=)
                    given = ["check", "refuse"][: len(limit.args)]
                    severities = {*given, *(one.arg or "" for one in limit.keywords)}
                else:
                    severities = {ast.literal_eval(limit)}
                found.setdefault(ast.literal_eval(node.args[0]), set()).update(severities)
                continue
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Finding":
                if ast.unparse(node.args[0]) in {"check.name", "fact.name"}:  # verify.md, as above
                    continue
                if ast.unparse(node.args[0]) in {"one.term.name", "name"}:  # terms and doubts
                    found |= {name: {"note", "check", "refuse"} for name in JUDGED}
                    continue
                if rows := TABLES.get(ast.unparse(node.args[0])):
                    for row in rows:
                        found.setdefault(row.name, set()).update(choices(node.args[1]))
                    continue
                names, severities = map(set, map(choices, node.args[:2]))
                severities |= {"note"} if names & TOLD_BESIDE else set()
                for name in names:
                    found.setdefault(name, set()).update(severities)
    return found


def choices(node: ast.expr) -> Iterator[str]:
    """The texts that an expression can be: one, or those of both ways of an `if`."""
    if isinstance(node, ast.IfExp):
        yield from choices(node.body)
        yield from choices(node.orelse)
    elif isinstance(node, ast.Name) and node.id == "severity":  # of a limit that has both
        yield from ("check", "refuse")
    else:
        yield ast.literal_eval(node)


def test_every_finding_is_explained_with_its_severities() -> None:
    written = "".join(text_of(page) for page in sorted((DOCS / "jobs").glob("*.md")))
    sections = re.findall(r"^### `(.+?)`\n\n([^.]+)\.", written, re.MULTILINE)
    explained = {name: set(re.split(r", | or ", words.lower())) for name, words in sections}
    assert len(sections) == len(explained)
    assert explained == findings_in_the_source()


def test_every_check_is_explained() -> None:
    logged = Logged(bias=np.zeros(3), matrix=np.eye(3), source="the log")
    samples = ag.simulate("hand").samples.with_columns(logged=logged)
    result = ag.calibrate(samples, ag.Reference.constant(50_000))
    page = text_of(DOCS / "jobs" / "verify.md")
    assert len(result.verification.checks) == 7
    for check in result.verification.checks:
        assert f"| {check.name} |" in page


def test_every_decision_says_why_and_on_what_evidence() -> None:
    decisions = sorted((DOCS / "decisions").glob("0*.md"))
    assert [int(page.name[:4]) for page in decisions] == list(range(1, len(decisions) + 1))
    for page in decisions:
        headings = re.findall(r"^## (.+)$", text_of(page), re.MULTILINE)
        assert headings == ["Context", "Decision", "Consequence", "Evidence"], page.name


def test_every_experiment_is_named_beside_its_figures() -> None:
    written = "".join(map(text_of, PAGES))
    for script in (DOCS / "decisions" / "experiments").glob("*.py"):
        assert f"python {script.relative_to(ROOT).as_posix()}" in written


IN_README = {
    "hand-held": "02_undisturbed_slow_rotation_B",
    "the same with breaks": "05_undisturbed_slow_rotation_with_",
    "fast; the field is 14 ms late": "07_undisturbed_fast_rotation_B",
    "hardly turned": "12_undisturbed_slow_translation_C",
    "a magnet is passed": "28_disturbed_stationary_magnet_A",
    "a magnet for half of the time": "32_disturbed_attached_magnet_1cm",
}
"""The recordings of the README's table, and what the benchmark calls them."""


def read_table(page: Path) -> dict[str, dict[str, str]]:
    """The rows of the first table of a page, by their first cell."""
    rows = [line.strip("| ").split(" | ") for line in text_of(page).splitlines() if "|" in line]
    head = next(k for k, row in enumerate(rows) if row[0] == "recording")
    cells = [[cell.strip() for cell in row] for row in rows[head:]]
    return {row[0]: dict(zip(cells[0], row, strict=False)) for row in cells[2:]}


def test_figures_of_the_readme_are_those_of_the_benchmark() -> None:
    """All recordings whose heading is known, every cell as it is there."""
    real = read_table(ROOT / "benchmarks/results/real.md")
    shown = read_table(ROOT / "README.md")
    assert [name for name in shown if name in IN_README] == [*IN_README]
    known = {one for one, row in real.items() if row["agonic"].strip("()").endswith("°")}
    assert {one for one in known if not one.endswith(", dip")} == {*IN_README.values()}
    columns = {"as recorded": "as flown"}
    columns |= {name: name for name in ("agonic says", "SciPy least squares", "magyc", "agonic")}
    for name, recording in IN_README.items():
        for ours, theirs in {**columns, "stated": "stated"}.items():
            given = shown[name][ours].replace("|", "").strip()
            assert given == real[recording][theirs], (name, ours)
    others = {one.removesuffix(", dip") for one in real} - {*IN_README.values()}
    readme = " ".join(text_of(ROOT / "README.md").split())
    assert f"the error of the dip of {len({one.split()[0] for one in others})} more" in readme
    magnitude, dip = real["log171 MAG"], real["log171 MAG, dip"]
    assert (
        f"SciPy leaves {magnitude['SciPy least squares']} of the magnitude and agonic "
        f"{magnitude['agonic']}, with a dip that is {dip['SciPy least squares']} and "
        f"{dip['agonic']} wrong" in readme
    )


def test_what_the_readme_says_of_simulations_is_in_their_tables() -> None:
    """What the sentences below its table claim."""
    readme = " ".join(text_of(ROOT / "README.md").split())
    results = ROOT / "benchmarks/results"
    torture = " ".join(text_of(results / "torture.md").split())
    (wrong, runs, alarmed, clean, useful) = re.findall(
        r"wrong: (\d+) of (\d+) runs;.*?not called good: (\d+) of (\d+)\. Right within 0\.5° and "
        r"called good: (\d+ of \d+ \(\d+ %\))",
        torture,
    )[0]
    (kinds,) = re.findall(r"(\d+) kinds of recordings", torture)
    counts = re.findall(r"Confidently wrong: (\d+) of (\d+) runs", torture)
    assert counts[0] == (wrong, runs)
    assert f"{kinds} kinds of faults and motions | {runs} | {wrong} | {useful} |" in readme
    assert f"chamber | {counts[1][1]} | {counts[1][0]} |" in readme
    assert f"faults laid on | {counts[2][1]} | {counts[2][0]} |" in readme
    none = "None" if alarmed == "0" else alarmed
    assert f"{none} of the {clean} simulated recordings without a fault was called" in readme
    columns = "in 95 %", "in 95 %, with prior"
    rows = [line.strip("| ").split(" | ") for line in text_of(results / "honesty.md").splitlines()]
    head = next(row for row in rows if row[0] == "model")
    held = [
        float(row[head.index(column)].split()[0])
        for row in rows
        if len(row) == len(head) and row[0] in ("sphere", "diagonal", "full")
        for column in columns
    ]
    assert f"truth in {min(held):.0f} to {max(held):.0f} % of draws" in readme
    clean = (
        text_of(results / "estimators.md").split("## Calibrated vector, clean")[1].split("##")[0]
    )
    ours = [float(x) for x in re.findall(r"\| \d+ \| \d+ \| ([\d.]+) ±", clean)]
    assert np.median(ours) == pytest.approx(1.0, abs=0.02)


def test_every_quoted_table_is_there() -> None:
    """Tables of results are read when a page is built, so no page has an old one."""
    results = runpy.run_path(str(DOCS / "_ext" / "results.py"))
    quoted = [
        (name, int(number or 1))
        for page in PAGES
        for name, number in re.findall(r"^```\{result\} (\w+) ?(\d*)$", text_of(page), re.MULTILINE)
    ]
    assert len(quoted) >= 6
    for name, number in quoted:
        assert results["find_table"](name, number).startswith("| ")
        assert results["find_maker"](name).startswith("Made by `python -m benchmarks.")
    with pytest.raises(LookupError, match="and not 9"):
        results["find_table"]("heading", 9)


def test_every_item_of_the_four_documents_has_a_page_that_is_there() -> None:
    for source in load_documents().values():
        for item in source.items:
            assert (DOCS / item.page).is_file(), item.what


@pytest.mark.parametrize(
    "page",
    [mark_slow(page) for page in PAGES if FENCE.search(text_of(page))],
    ids=lambda page: page.relative_to(ROOT).as_posix(),
)
def test_code_of_pages_runs(
    page: Path, recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The blocks of a page are one program, in a folder with a log and a calibration."""
    shutil.copytree(recorded, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    names: dict[str, object] = {}
    for kind, code in FENCE.findall(text_of(page)):
        if kind == "python":
            exec(compile(code, str(page), "exec"), names)
            continue
        parsed = doctest.DocTestParser().get_doctest(code, names, page.name, str(page), 0)
        runner = doctest.DocTestRunner(optionflags=DOCTEST)
        runner.run(parsed, clear_globs=False)
        names.update(parsed.globs)
        assert runner.summarize(verbose=False).failed == 0


@pytest.mark.parametrize(
    "script",
    [mark_slow(path) for path in sorted((ROOT / "examples").glob("*.py"))],
    ids=lambda path: path.name,
)
def test_examples_run(script: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names = runpy.run_path(str(script), run_name="__main__")
    if "again" in names:  # the network of the paper, trained again after the change
        assert max(names["before"].max(), names["after"].max()) < 10.0 < names["changed"].min()
    elif "fit" in names:
        truth = names["truth"] if "truth" in names else names["made"].truth
        error = names["fit"].calibration.bias - truth.bias
        assert np.all(np.abs(error) < 4 * names["fit"].sd[:3])
    elif "result" in names:
        assert all(sensor.verdict == "good" for sensor in names["result"].sensors)
    else:
        assert names["verification"].passed
        assert "COMPASS_OFS_X" in names["export"].path.read_text()


def test_docstrings_become_markup(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(DOCS / "_ext")
    for name in ("docstrings", "formulas"):
        tested = doctest.testmod(import_module(name))
        assert tested.attempted > 0
        assert tested.failed == 0


def test_every_formula_of_the_api_is_markup_that_closes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(DOCS / "_ext")
    restructured = import_module("docstrings").restructured
    shown = 0
    for name in ag.__all__:
        lines = (inspect.getdoc(getattr(ag, name)) or "").splitlines()
        for line in restructured(lines):
            if "<math" in line:
                fromstring(line.strip())  # XML that is whole
                shown += 1
    assert shown > 12


@pytest.mark.parametrize("page", sorted((DOCS / "jobs").glob("*.md")), ids=lambda p: p.stem)
def test_every_job_has_commands_or_code_that_runs(page: Path) -> None:
    """What stands in `{terminal}` is run from an empty folder when the pages are built."""
    assert "```{terminal}" in text_of(page) or FENCE.search(text_of(page))


def test_the_architecture_names_the_rooms_and_files_that_there_are() -> None:
    page, house = text_of(DOCS / "architecture.md"), ROOT / "src" / "agonic"
    rooms = page[page.index("| room |") : page.index("## The stages")]
    named = set(re.findall(r"`(\w+)`", rooms))
    assert {one.parent.name for one in house.glob("*/__init__.py")} <= named
    walk = page[page.index("## One walk") : page.index("## Recipes")]
    paths = re.findall(r"`([\w/]+(?:/|\.py))`", walk)
    assert len(paths) > 10
    assert [path for path in paths if not (house / path).exists()] == []


def test_what_calibrate_decides_is_said_beside_the_function_that_does_it() -> None:
    page = text_of(DOCS / "architecture.md")
    table = page[page.index("## What `calibrate` decides") : page.index("## Recipes")]
    made_in = re.findall(r"^\| [A-Z].+\. \| `([\w.]+)` \|$", table, re.MULTILINE)
    assert len(made_in) == 10
    for path in made_in:
        module, name = path.rsplit(".", 1)
        assert inspect.getdoc(getattr(import_module(f"agonic.{module}"), name))
