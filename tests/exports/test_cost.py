"""The bounds of stack and time that the header states, on each processor."""

import re
import shutil
import subprocess

import pytest

from agonic.exports.firmware import write_firmware
from tests.exports.processors import PROCESSORS
from tests.exports.test_firmware import SETUPS

GRAPH = "arm-none-eabi-gcc"
TARGET = {"RISC-V 32": "RISC-V", "ATmega328P": "AVR"}
MAIN = """
#include "board.h"
#include "compass.h"
#include <math.h>

int main(void)
{
    static const float values[] = {0.0f, 1.0f, -44.7f, 3e4f, -2e4f, 79.0f, 179.9f, 1e-30f, 9e9f,
        -3e38f, INFINITY, NAN};
    static compass_input in;
    static compass_output out;
    unsigned long seed = 1;
    unsigned long longest = 0;
    int n;
    unsigned k;
    for (n = 0; n < TRIES; n++) {
        float *number = (float *)&in;
        unsigned long from;
        for (k = 0; k < sizeof in / sizeof(float); k++) {
            seed = (seed * 1664525ul + 1013904223ul) & 0xfffffffful;
            number[k] = values[(seed >> 16) % (n % 4 ? 7u : 12u)];
        }
        from = board_ticks();
        compass_heading(&in, &out);
        from = board_ticks() - from;
        longest = from > longest ? from : longest;
    }
    board_tell("longest", (long)(longest * board_tick_size));
    return 0;
}
"""


def read_bounds(folder):
    """Bytes of stack and instructions (cycles on AVR), by target, of a header."""
    text = (folder / "compass.h").read_text()
    rows = re.findall(r"^ \* (Cortex-M0\+|Cortex-M4F|RISC-V|AVR) +(\d+) +(\d+)$", text, re.M)
    return {name: (int(stack), int(time)) for name, stack, time in rows}


def follow_calls(calls, stack, name):
    """The deepest stack below a function, by the sizes of its own frames."""
    below = [follow_calls(calls, stack, other) for other in calls.get(name, ()) if other != name]
    return stack.get(name, 0) + max(below, default=0)


def measure_stack(processor, folder, level):
    """Of compass_heading and what it calls in the same file, frame by frame."""
    source = folder / "compass.c"
    graph = [GRAPH, level, "-std=c99", "-fno-inline", "-fcallgraph-info=su", "-c", source]
    subprocess.run([*graph, "-o", folder / "graph.o"], check=True, cwd=folder)
    (file,) = folder.glob("*.ci")
    calls = {}
    edge = r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"'
    for caller, called in re.findall(edge, file.read_text()):
        calls.setdefault(caller.split(":")[-1], set()).add(called.split(":")[-1])
    file.unlink()
    command = [processor.compiler, level, "-std=c99", *processor.flags, "-fstack-usage"]
    subprocess.run([*command, "-c", source, "-o", folder / "stack.o"], check=True, cwd=folder)
    (file,) = folder.glob("*.su")
    frames = re.findall(r":(\w+)(?:\.\S*)?\t(\d+)\tstatic", file.read_text())
    file.unlink()
    return follow_calls(calls, {name: int(size) for name, size in frames}, "compass_heading")


@pytest.mark.parametrize("setup", SETUPS)
@pytest.mark.parametrize("name", PROCESSORS)
def test_no_build_takes_more_stack_than_the_header_says(name, setup, tmp_path):
    processor = PROCESSORS[name]
    if not (shutil.which(processor.compiler) and shutil.which(GRAPH)):
        pytest.skip(f"{processor.compiler} and {GRAPH} are needed")
    given, declination = SETUPS[setup]
    write_firmware(given, tmp_path, declination=declination)
    stated, _ = read_bounds(tmp_path)[TARGET.get(name, name)]
    measured = max(measure_stack(processor, tmp_path, level) for level in ("-Os", "-O2"))
    assert 50 < measured <= stated <= 3 * measured


@pytest.mark.parametrize("setup", ["one", "aboard", "motors", "three"])
@pytest.mark.parametrize("name", PROCESSORS)
def test_no_input_takes_longer_than_the_header_says(name, setup, tmp_path):
    processor = PROCESSORS[name]
    if processor.missing:
        pytest.skip(processor.missing)
    given, declination = SETUPS[setup]
    write_firmware(given, tmp_path, declination=declination)
    tries = 150 if name == "ATmega328P" else 2000
    (tmp_path / "main.c").write_text(MAIN.replace("TRIES", str(tries)))
    told = processor.run(processor.build(tmp_path, "compass.c", "main.c"))
    _, stated = read_bounds(tmp_path)[TARGET.get(name, name)]
    assert told["longest"] <= stated <= 5 * told["longest"]
