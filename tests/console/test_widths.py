"""What commands print fits terminals of 40 to 200 columns, and is never cut."""

from collections.abc import Iterator
from pathlib import Path

import pytest

import agonic as ag
from agonic.cli import run

COMMANDS = (
    "info log.csv",
    "verify mag.json log.csv --field 50000",
    "cite mag.json",
    "field --at 47,8 --date 2026-05-01",
    "export mag.json --to ardupilot -o mag.param",
    "plan swing --headings 16",
    "heading mag.json log.csv --at 47,8 --date 2026-05-01 -o headings.csv",
    "apply mag.json log.csv -o corrected.csv",
    "simulate tumble -o other.csv -n 500",
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log and its calibration."""
    made = tmp_path_factory.mktemp("widths")
    samples = ag.simulate("tumble", n=600, seed=1).samples
    ag.write_csv(samples, made / "log.csv")
    ag.save(ag.fit_ellipsoid(samples, 50_000).calibration, made / "mag.json")
    return made


def lines(capsys: pytest.CaptureFixture[str]) -> Iterator[str]:
    said = capsys.readouterr()
    assert "Traceback" not in said.err
    assert "…" not in said.out.replace(" … ", "")  # a range is "low … high"
    yield from said.out.splitlines()


@pytest.mark.parametrize("width", [40, 80, 120, 200])
def test_every_line_fits(
    width: int, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", str(width))
    for command in COMMANDS:
        run(command.split())
        for line in lines(capsys):
            longest = max(map(len, line.split()), default=0)  # a checksum is one word
            assert len(line) <= width or longest > width / 2, (command, line)
