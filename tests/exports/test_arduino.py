"""A library for Arduino and PlatformIO: its layout, and that its sketch compiles for AVR."""

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.calibration.setup import Setup
from agonic.calibration.tracking import TrackerParams
from agonic.cli import run
from agonic.files.setup import save_setup
from agonic.inflight.tracking import Tracker
from agonic.network.simulate import simulate_paper
from tests.exports.test_c_tracker import MODELS
from tests.exports.test_firmware import HARD, WARM
from tests.inflight.test_tracking import orbiting
from tests.inflight.turning import turn_about

CORE = """
#pragma once
#include <stdint.h>
unsigned long millis();
void delay(unsigned long ms);
struct Port {
    void begin(long) {}
    void print(const char *) {}
    void println(const char *) {}
    void print(char) {}
    void print(int) {}
    void println(int) {}
    void print(double) {}
    void println(double) {}
};
static Port Serial;
void setup();
void loop();
"""
RUN = """
void setup();
void loop();
unsigned long millis() { return 0; }
void delay(unsigned long) {}
int main() { setup(); for (;;) { loop(); } }
"""
FLAGS = ("-Os", "-Wall", "-Wextra", "-Werror", "-ffunction-sections", "-fdata-sections")


def network() -> ag.network.Network:
    made = simulate_paper(directions="space", seed=1).select(slice(1500))
    fit = ag.fit_network(
        made.samples, made.reference, base=None, hidden=3, compared=False, restarts=1
    )
    return fit.calibration


def tracker(path: Path) -> None:
    made = orbiting(0, n=1200)
    follows = Tracker(params=MODELS["bias"])
    follows.update(made[0], made[1])
    follows.save(path)


def tracker_with_gyro(path: Path) -> None:
    follows = Tracker(params=TrackerParams(noise=100.0, solve="bias", gyro=True))
    follows.update(turn_about(0).samples)
    follows.save(path)


# kind: what writes the file, options, sketch, controller
KINDS = {
    "bias and matrix": (lambda p: ag.save(HARD.calibration, p), (), "Field", "atmega328p"),
    "temperature": (lambda p: ag.save(WARM, p), (), "Field", "atmega328p"),
    "network": (lambda p: ag.save(network(), p), (), "Field", "atmega328p"),
    "setup": (
        lambda p: save_setup(Setup(compasses=(replace(HARD),)), p),
        ("--declination", "2"),
        "Heading",
        "atmega328p",
    ),
    "tracker": (tracker, (), "Follow", "atmega328p"),
    "tracker beside a gyro": (tracker_with_gyro, (), "Follow", "atmega328p"),
    "training": (lambda p: ag.save(network(), p), ("--window", "100"), "Train", "atmega1284p"),
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_library_has_its_parts_and_its_sketch_compiles(kind, tmp_path, capsys):
    write, options, sketch, controller = KINDS[kind]
    source = tmp_path / ("boat.toml" if kind == "setup" else "nose.json")
    write(source)
    library = tmp_path / "Nose"
    arguments = ["--to", "c", "--as", "arduino", "--name", "nose", "-o", str(library), *options]
    assert run(["export", str(source), *arguments, "--json"]) == 0
    files = {Path(file) for file in json.loads(capsys.readouterr().out)["files"]}
    assert files == {path for path in library.rglob("*") if path.is_file()}
    properties = dict(
        line.split("=", 1) for line in (library / "library.properties").read_text().splitlines()
    )
    manifest = json.loads((library / "library.json").read_text())
    assert properties["name"] == manifest["name"] == "nose"
    assert properties["version"].count(".") == 2
    for header in properties["includes"].split(","):
        assert (library / "src" / header).exists()
    example = library / "examples" / sketch / f"{sketch}.ino"
    assert example in files
    if not shutil.which("avr-g++"):
        pytest.skip("avr-g++ not installed")
    build(library, example, controller)


def build(library: Path, sketch: Path, controller: str) -> None:
    """As the Arduino tools do it: the sketch as C++, the library as C, linked for a controller."""
    core = library.parent / "core"
    core.mkdir()
    (core / "Arduino.h").write_text(CORE)
    (core / "main.cpp").write_text(RUN)
    where = ("-I", core, "-I", library / "src", f"-mmcu={controller}")
    objects = []
    for file in [sketch, core / "main.cpp", *(library / "src").glob("*.c")]:
        objects.append(core / f"{file.stem}.o")
        tool = ("avr-gcc", "-std=gnu11") if file.suffix == ".c" else ("avr-g++", "-std=gnu++11")
        kind = ("-x", "c++", "-include", "Arduino.h") if file == sketch else ()
        command = [*tool, *FLAGS, *where, *kind, "-c", file, "-o", objects[-1]]
        subprocess.run(command, check=True)
    program = core / "program.elf"
    link = ["avr-gcc", f"-mmcu={controller}", "-Wl,--gc-sections", *objects, "-lm", "-o", program]
    subprocess.run(link, check=True)
    shown = subprocess.run(["avr-size", program], capture_output=True, text=True, check=True).stdout
    _, data, bss = map(int, shown.splitlines()[1].split()[:3])
    assert data + bss < {"atmega328p": 1200, "atmega1284p": 11_000}[controller]


def test_other_layouts_and_targets_are_refused(tmp_path, capsys):
    file = str(ag.save(ag.Affine(bias=np.zeros(3), matrix=np.eye(3)), tmp_path / "mag.json"))
    assert run(["export", file, "--to", "c", "--as", "cmake"]) == 2
    assert run(["export", file, "--to", "px4", "--as", "arduino"]) == 2
    assert capsys.readouterr().err.count("the only layout is --as arduino") == 2
