"""What a person sees who types commands from an empty folder, and the logs that people bring."""

import re
import shlex
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import agonic as ag
from agonic.cli import run
from agonic.simulation import simulate, simulate_vehicle
from tests.logs.dataflash_writer import dataflash, parameters

FIRST_SCREEN = 25
"""Lines of a usual terminal, above its prompt."""
PLACEHOLDER = re.compile(r"\b[A-Z]{3,}\b(?![./_-])")
"""A word that one has to replace before a command can run, as LAT,LON."""


class Screen(NamedTuple):
    """What a command left: its exit status, what it said, and the files it wrote."""

    status: int
    lines: list[str]
    complaint: str
    files: set[str]

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.lines).split())

    @property
    def following(self) -> str:
        """The command that is offered next, "" where none is."""
        said = "\n".join(self.lines).replace("\\\n", "").partition("\nNext ")[2]
        return " ".join(said.split())


class Person:
    """Types commands in an empty folder; a printed screen never is longer than the first of a
    terminal, and what is offered next is a command as it stands."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self.capsys = capsys

    def types(self, command: str) -> Screen:
        before = _list_files()
        self.capsys.readouterr()
        status = run(shlex.split(command.removeprefix("agonic ")))
        said = self.capsys.readouterr()
        screen = Screen(status, said.out.splitlines(), said.err, _list_files() - before)
        assert len(screen.lines) <= FIRST_SCREEN, said.out
        assert max(map(len, screen.lines), default=0) <= 100
        assert screen.following == "" or screen.following.startswith("agonic ")
        assert not PLACEHOLDER.search(screen.following), screen.following
        return screen

    def goes_on(self, screen: Screen) -> Screen:
        """Types what was offered, which runs."""
        assert screen.following
        after = self.types(screen.following)
        assert after.status in (0, 1), after.complaint
        assert after.files
        return after


def _list_files() -> set[str]:
    return {str(path) for path in Path().rglob("*") if path.is_file()}


def write_flight(path: str) -> None:
    """A log of an ArduPilot vehicle with three compasses, an attitude and a position."""
    made = simulate_vehicle(n=3000, seed=4, noise=60.0, heading_sd_deg=None)
    first, second = made.samples
    third = simulate("tumble", n=10, seed=8).truth
    seen = made.truths[0].correct(first.field, current_A=first.current_A)
    fields = [first.field, second.field, seen @ np.linalg.inv(third.matrix).T + third.bias]
    us = {"TimeUS": (5.0 + np.asarray(first.time)) * 1e6}
    compasses = [
        ("MAG", us | {"I": k, "Health": 1, **_split("Mag", field / 100.0)})
        for k, field in enumerate(fields)
    ]
    attitude = {"Roll": first.roll_deg, "Pitch": first.pitch_deg, "Yaw": made.heading_deg}
    gps = {"Lat": first.latitude_deg, "Lng": first.longitude_deg, "Alt": first.altitude_m}
    clock = {"Status": 3, "GWk": 2416, "GMS": np.round(5e8 + us["TimeUS"] / 1e3)}
    current = {"Instance": 0, "Curr": first.current_A}
    tables = [("ATT", us | attitude), ("GPS", us | gps | clock), ("BAT", us | current)]
    Path(path).write_bytes(dataflash(parameters({"COMPASS_ORIENT": 0.0}), *compasses, *tables))


def _split(stem: str, vectors: np.ndarray) -> dict[str, np.ndarray]:
    return {f"{stem}{axis}": vectors[:, k] for k, axis in enumerate("XYZ")}


def write_counts(path: str) -> None:
    """What a maker's sketch prints: three columns of counts, of 0.917 mG each, and no header."""
    made = simulate("hand", n=800, noise=200.0, seed=5).samples.field / 91.7
    np.savetxt(path, np.rint(made), fmt="%d", delimiter=",")


def write_level_rover(path: str) -> None:
    """A cart that cannot be tilted and has a compass alone."""
    made = simulate("circle", tilt_deg=1.0, n=1500, seed=2).samples
    ag.write_csv(ag.Samples(field=made.field, time=made.time), path)
