"""The monitor of two compasses on the controller, beside that of Python."""

import ctypes
import shutil
from ctypes import POINTER, c_float, c_int

import numpy as np
import pytest

from agonic.exports.firmware import write_firmware
from agonic.headings.monitor.baseline import Block, start
from agonic.headings.monitor.detect import advance
from agonic.headings.monitor.watch import watch_compasses
from tests.exports.controller import SANITIZED, compiled, library
from tests.exports.processors import PROCESSORS
from tests.headings.test_monitor import PARAMS, make_rows, make_setup
from tests.headings.two_compasses import Fault, average, make_drive

KEPT = 20


class Input(ctypes.Structure):
    _fields_ = [("raw", c_float * 3 * 2), ("roll_deg", c_float), ("pitch_deg", c_float)]


class Known(ctypes.Structure):
    _fields_ = [
        ("blocks", c_int),
        ("compass", c_int),
        ("change", c_float * 3),
        ("sd", c_float),
        ("odds", c_float),
        ("share", c_float),
    ]


class Watched(ctypes.Structure):
    _fields_ = [("y", c_float * 7), ("x", c_float * 4 * 3)]


class State(ctypes.Structure):
    _fields_ = [
        ("kept", Watched * KEPT),
        ("information", c_float * 64),
        ("seen", c_float * 28),
        ("square", c_float * 8),
        ("power", c_float * 8),
        ("count", c_float * 4),
        ("level", c_float * 3),
        ("last", c_float * 3),
        ("sum", c_float * 15),
        ("since_s", c_float),
        ("rows", c_int),
        ("filled", c_int),
        ("skipped", c_int),
        ("fault", Known * 2),
    ]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("watch")
    write_firmware(make_setup(), folder)
    return folder


def follow(folder, drive, vehicle=0):
    """The faults after each row, (n, 2, 8)."""
    run = library(folder, "compass.c", "compass_watch.c")
    run.compass_watch_add.argtypes = [POINTER(State), c_float, POINTER(Input), POINTER(Input)]
    state = State()
    run.compass_watch_begin(ctypes.byref(state))
    step = float(drive.time[1] - drive.time[0])
    x, y, z = np.moveaxis(drive.down[:, vehicle], -1, 0)
    roll = np.degrees(np.arctan2(y, z))
    pitch = np.degrees(np.arctan2(-x, np.hypot(y, z)))
    said = []
    first, second = Input(), Input()
    for k in range(len(drive.time)):
        for i in range(2):
            for axis in range(3):
                first.raw[i][axis] = second.raw[i][axis] = drive.field[k, vehicle, i, axis]
        first.roll_deg, first.pitch_deg = roll[k, 0], pitch[k, 0]
        second.roll_deg, second.pitch_deg = roll[k, 1], pitch[k, 1]
        run.compass_watch_add(state, step, first, second)
        said.append([[f.blocks, f.compass, *f.change, f.sd, f.odds, f.share] for f in state.fault])
    return np.array(said), state


FAULTS = [
    Fault("magnetometer", 0, 1000.0, 600.0),
    Fault("magnetometer", 1, 1000.0, 600.0),
    Fault("inclinometer", 0, 1.0, 600.0),
    Fault("inclinometer", 1, 1.0, 600.0),
]


@pytest.mark.parametrize("fault", FAULTS, ids=lambda f: f"{f.unit}-{f.compass}")
def test_block_by_block_it_says_what_python_says(fault, folder):
    drive = make_drive(31 + fault.compass, 723.0, rate_hz=4.0, fault=fault)
    said, _ = follow(folder, drive)
    state = start(PARAMS, (1,))
    for k, block in enumerate(zip(*average(drive, 3.0), strict=True)):
        state, seen = advance(PARAMS, state, Block(*block))
        row = 12 * (k + 1)  # the row after the block closes it
        if row >= len(said):
            break
        c = said[row]
        assert c[:, 0].tolist() == state.since[0].tolist(), k
        assert c[:, 1].tolist() == state.named[0].tolist(), k
        np.testing.assert_allclose(c[:, 5], seen.sd[0], rtol=0.01)
        np.testing.assert_allclose(c[:, 7], seen.share[0].max(axis=-1), rtol=0.02, atol=2e-3)
        for group, sd in enumerate(seen.sd[0]):
            np.testing.assert_allclose(
                c[group, 2 : 5 - group], seen.change[0, group, : 3 - group], atol=0.05 * sd
            )
        begun = state.since[0] > 0
        np.testing.assert_allclose(c[begun, 6], seen.odds[0, begun], rtol=0.05, atol=0.3)
    group = 0 if fault.unit == "magnetometer" else 1
    assert said[-1, group, 1] == fault.compass + 1
    assert said[-1, 1 - group, 0] == 0


def test_it_names_what_the_log_names(folder):
    fault = FAULTS[1]
    drive = make_drive(33, 700.0, rate_hz=4.0, fault=fault)
    said, state = follow(folder, drive)
    (told,) = watch_compasses(make_rows(drive), PARAMS, names=("mag1", "mag2")).faults
    assert told.sensor == "mag2"
    assert said[-1, 0, 1] == 2
    # the row that closes a block is the first of the next
    named = drive.time[np.argmax(said[:, 0, 1] > 0)]
    assert named == pytest.approx(told.named_s, abs=0.5)
    assert state.skipped == int(watch_compasses(make_rows(drive), PARAMS, names="ab").state.skipped)


MAIN = """
#include "compass_watch.h"
#include <math.h>
int main(void)
{
    static const float values[] = {0.0f, 1e4f, -3e4f, NAN, INFINITY, 3e38f, 1e-30f};
    static compass_watch w;
    unsigned seed = 1;
    int n, k;
    compass_watch_begin(&w);
    for (n = 0; n < 20000; n++) {
        compass_input a = {0};
        for (k = 0; k < 3; k++) {
            seed = seed * 1664525u + 1013904223u;
            a.raw[0][k] = values[(seed >> 16) % 7u];
            a.raw[1][k] = values[(seed >> 20) % 7u];
        }
        a.roll_deg = values[(seed >> 24) % 7u];
        compass_watch_add(&w, values[seed % 7u], &a, &a);
    }
    for (n = 0; n < 7; n++) {
        for (k = 0; k < 4; k++) {
            if (!isfinite(w.seen[n][k])) {
                return 2;
            }
        }
    }
    return w.fault[0].compass < 0 || w.fault[0].compass > 2 || !isfinite(w.fault[0].sd);
}
"""


def test_no_reading_makes_it_undefined_or_stays_in_it(folder):
    import subprocess

    (folder / "tries.c").write_text(MAIN)
    flags = (SANITIZED[0], "-fsanitize=undefined", SANITIZED[2])
    program = compiled(folder, "compass.c", "compass_watch.c", "tries.c", flags=flags)
    assert subprocess.run([program], check=False).returncode == 0


@pytest.mark.parametrize("name", [n for n in PROCESSORS if not n.startswith("AT")])
def test_it_fits_a_controller(name, folder):
    processor = PROCESSORS[name]
    if not shutil.which(processor.compiler):
        pytest.skip(f"{processor.compiler} not installed")
    processor._compile(folder / "compass_watch.c", ("-std=c99", "-Wall", "-Wextra", "-Werror"))
    flash, ram = processor.measure(folder, "compass_watch.c")
    assert 1000 < flash < 12_000
    assert ram == 0
    assert ctypes.sizeof(State) < 2600
