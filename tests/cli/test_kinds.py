"""`agonic simulate|fit|plan KIND`: kinds with options of their own."""

import json
import subprocess
import sys

import pytest

from agonic.cli import run
from agonic.cli.simulate import HELP as MOTIONS
from agonic.simulation import kinds

pytestmark = pytest.mark.usefixtures("empty_folder")


def test_every_motion_is_a_kind() -> None:
    assert tuple(MOTIONS) == kinds()


@pytest.mark.parametrize("kind", MOTIONS)
def test_a_motion_is_that_of_python(kind: str, capsys) -> None:
    import agonic as ag

    assert run(["simulate", kind, "-o", "x.csv", "-n", "200", "--seed", "3", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["kind"] == kind
    made = ag.simulate(kind, n=200, seed=3)
    assert said["bias_nT"] == made.truth.bias.tolist()
    assert ag.read("x.csv").field == pytest.approx(made.samples.field, abs=6e-4)


@pytest.mark.parametrize("before", [[], ["-n", "200"], ["-o", "hand", "--seed", "1"]])
def test_options_may_stand_before_the_kind(before: list[str], capsys) -> None:
    after = [] if "-o" in before else ["-o", "x.csv"]
    assert run(["simulate", *before, "circle", *after, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["kind"] == "circle"


@pytest.mark.parametrize("arguments", [["-o", "x.csv"], ["--json"], ["-o", "hand"], ["ship"]])
@pytest.mark.parametrize("command", ["simulate", "fit", "plan"])
def test_without_a_kind_all_are_named(command: str, arguments: list[str], capsys) -> None:
    known = {"simulate": ("hand", "orbit"), "fit": ("vector", "coil"), "plan": ("swing", "thermal")}
    assert run([command, *arguments]) == 2
    said = capsys.readouterr().err
    assert all(kind in said for kind in known[command])
    assert f"see agonic {command} --help" in said
    assert said.count("\n") == 1


def test_help_needs_no_numpy() -> None:
    """What is heavy is loaded when a command runs, so that help is there at once."""
    code = (
        "import sys\nfrom agonic.cli import run\nrun(['--help'])\n"
        "sys.exit(any(heavy in sys.modules for heavy in ('numpy', 'scipy', 'msgspec')))"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == 0
