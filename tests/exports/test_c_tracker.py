"""The tracker in C: that of Python to single precision, through jumps, power cuts and nonsense."""

import ctypes
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.calibration.thermal import Thermal
from agonic.calibration.tracking import TrackerParams
from agonic.cli import run
from agonic.errors import AgonicError
from agonic.exports.firmware.tracker import write_tracker
from agonic.inflight.tracking import Tracker
from tests.exports.controller import compiled, library, try_extremes
from tests.exports.processors import PROCESSORS
from tests.inflight.test_tracking import orbiting, space_station

REFUSED, JUMPED, UNSETTLED, NONE = 1, 2, 4, 8
MODELS = {
    "full": TrackerParams(noise=100.0, walk=0.5, external_sd=20.0),
    "gains": TrackerParams(noise=100.0, solve="gains", matrix_walk=1e-6, external_sd=0.0),
    "bias": TrackerParams(noise=100.0, solve="bias", walk=0.01, external_sd=0.0),
}
WALK = 113.0
"""nT per root second, of the space station."""
MAIN = """
#include "board.h"
#include "mag_tracker.h"

static mag_tracker tracker;

int main(void)
{
    board_tell("right", mag_tracker_self_test());
    mag_tracker_begin(&tracker);
    board_tell("bytes", (long)sizeof tracker);
    return 0;
}
"""


class Board:
    """The exported tracker, compiled, from its start."""

    def __init__(self, tracker: Tracker, folder: Path) -> None:
        write_tracker(tracker.params, tracker.state, folder, name="mag")
        self.run = library(folder, "mag_tracker.c")
        self.run.mag_tracker_update.argtypes = [
            ctypes.c_void_p,
            ctypes.c_float,
            ctypes.c_void_p,
            ctypes.c_float,
        ]
        self.state = ctypes.create_string_buffer(4096)
        self.run.mag_tracker_begin(self.state)
        self.time = tracker.state.time

    def update(self, samples: ag.Samples, reference: ag.Reference) -> np.ndarray:
        """The status of each reading."""
        magnitude = np.broadcast_to(reference.magnitudes(len(samples)), len(samples))
        status = []
        for time, raw, size in zip(samples.time, samples.field, magnitude, strict=True):
            row = np.float32(raw)
            elapsed, self.time = time - self.time, time
            status.append(
                self.run.mag_tracker_update(self.state, elapsed, row.ctypes.data, float(size))
            )
        return np.array(status)

    @property
    def bias(self) -> np.ndarray:
        return np.frombuffer(self.state, np.float32, 10)[1:4].astype(float)

    @property
    def bias_sd(self) -> np.ndarray:
        sd = np.zeros(3, np.float32)
        self.run.mag_tracker_bias_sd(self.state, ctypes.c_void_p(sd.ctypes.data))
        return sd.astype(float)

    def correct(self, raw: np.ndarray) -> np.ndarray:
        field = np.float32(raw)
        place = ctypes.c_void_p(field.ctypes.data)
        self.run.mag_tracker_correct(self.state, place, place)
        return field


def part(made: tuple, first: int, last: int) -> tuple[ag.Samples, ag.Reference]:
    rows = np.arange(first, last)
    return made[0].select(rows), made[1].select(rows)


def check_agreement(board: Board, tracker: Tracker) -> None:
    """To single precision: a hundredth of a standard error, and its size to a thousandth."""
    assert np.abs(board.bias - tracker.bias).max() < 0.01 * tracker.bias_sd.min()
    np.testing.assert_allclose(board.bias_sd, tracker.bias_sd, rtol=1e-3)
    raw = tracker.bias + np.array([20_000.0, -30_000.0, 10_000.0])
    field = tracker.calibration.correct(raw)
    np.testing.assert_allclose(board.correct(raw), field, rtol=0, atol=0.05 + 2e-6 * 40_000)


@pytest.fixture(scope="module")
def settled() -> tuple[Tracker, tuple]:
    """A tracker after 1200 of 1600 readings, and all of them; not to be moved on."""
    made = orbiting(4, n=1600)
    tracker = Tracker(params=MODELS["full"])
    tracker.update(*part(made, 0, 1200))
    return tracker, made


@pytest.mark.slow
@pytest.mark.parametrize(
    ("solve", "gauge"),
    [("full", "symmetric"), ("full", "triangular"), ("gains", "symmetric"), ("bias", "symmetric")],
)
def test_it_agrees_with_python(solve, gauge, tmp_path):
    made = orbiting(2, n=2000, walk=MODELS[solve].walk, strays=0.01)
    truth = made[3]
    ground = ag.Affine(bias=truth.bias + 500.0, matrix=truth.matrix)
    if gauge == "triangular":
        upper = np.linalg.cholesky(truth.matrix.T @ truth.matrix).T
        ground = replace(ground, matrix=upper, gauge="triangular")
    tracker = Tracker(ground, MODELS[solve])
    tracker.update(*part(made, 0, 1000))
    board = Board(tracker, tmp_path)
    refused = tracker.refused
    status = board.update(*part(made, 1000, 2000))
    tracker.update(*part(made, 1000, 2000))
    assert (status & ~REFUSED == 0).all()
    assert not tracker.jumps
    assert (status == REFUSED).sum() == tracker.refused - refused > 5
    check_agreement(board, tracker)


@pytest.mark.slow
@pytest.mark.recordings
def test_it_agrees_on_the_space_station(recordings, tmp_path):
    """Each reading of the second half, with the walk that the first half would choose."""
    made = space_station(recordings)
    half = len(made[0]) // 2
    tracker = Tracker(params=TrackerParams(walk=WALK))
    tracker.update(*part(made, 0, half))
    board = Board(tracker, tmp_path)
    status = board.update(*part(made, half, len(made[0])))
    tracker.update(*part(made, half, len(made[0])))
    assert not (status & (JUMPED | NONE)).any()
    check_agreement(board, tracker)


@pytest.mark.parametrize("size", [1500.0, 20_000.0])
def test_a_jump_is_told_and_the_bias_found_again(size, tmp_path):
    """By the board alone: it has no readings to go back to."""
    jump = size * np.array([0.6, -0.48, 0.64])
    made = orbiting(3, n=3000, jump=jump, at=1700)
    tracker = Tracker(params=replace(MODELS["full"], walk=0.0, external_sd=0.0))
    tracker.update(*part(made, 0, 1500))
    board = Board(tracker, tmp_path)
    status = board.update(*part(made, 1500, 3000))
    found = np.flatnonzero(status & JUMPED)
    assert len(found) == 1
    assert 200 <= found[0] < 300
    assert status[found[0] + 1] & UNSETTLED
    assert not status[-500:].any()
    error = (board.bias - made[2][-1]) / board.bias_sd
    assert np.abs(error).max() < 4
    assert (board.bias_sd < 30).all()


def test_it_goes_on_byte_for_byte_after_a_power_cut(settled, tmp_path):
    tracker, made = settled
    board = Board(tracker, tmp_path)
    board.update(*part(made, 1200, 1400))
    saved = ctypes.create_string_buffer(4096)
    board.run.mag_tracker_save(board.state, saved)
    time = board.time
    board.update(*part(made, 1400, 1600))
    end = board.state.raw
    board.run.mag_tracker_begin(board.state)
    fresh = board.state.raw
    damaged = ctypes.create_string_buffer(saved.raw, 4096)
    damaged[100] = bytes([damaged[100][0] ^ 1])
    assert board.run.mag_tracker_restore(board.state, damaged) == 0
    assert board.state.raw == fresh
    assert board.run.mag_tracker_restore(board.state, saved) == 1
    board.time = time
    board.update(*part(made, 1400, 1600))
    assert board.state.raw == end


def test_readings_that_are_none_change_nothing(settled, tmp_path):
    tracker, made = settled
    board = Board(tracker, tmp_path)
    before = board.state.raw
    good = made[0].field[-1]
    for raw, elapsed, size in (
        ([np.nan, 0, 0], 1.0, 4e4),
        ([np.inf, 0, 0], 1.0, 4e4),
        ([3e38, 3e38, 0], 1.0, 4e4),
        (good, np.nan, 4e4),
        (good, -1.0, 4e4),
        (good, 1.0, 0.0),
        (good, 1.0, np.nan),
    ):
        row = np.float32(raw)
        status = board.run.mag_tracker_update(board.state, elapsed, row.ctypes.data, size)
        assert status == NONE
        assert board.state.raw == before
    zero = np.float32(board.bias)  # no field at all
    assert board.run.mag_tracker_update(board.state, 1.0, zero.ctypes.data, 4e4) & (REFUSED | NONE)
    assert np.isfinite(board.bias).all()


@pytest.mark.slow
def test_no_input_is_undefined(settled, tmp_path):
    write_tracker(settled[0].params, settled[0].state, tmp_path, name="mag")
    try_extremes(
        tmp_path,
        "mag_tracker.c",
        "static mag_tracker t;\n    mag_tracker_begin(&t);",
        "mag_tracker_update(&t, n % 5 ? 1.0f : x[0], x + 1, n % 7 ? x[4] : 40000.0f);\n"
        "        mag_tracker_correct(&t, x + 1, x + 5);\n        mag_tracker_bias_sd(&t, x);\n"
        "        if (n % 5000 == 0) {\n            mag_tracker_begin(&t);\n        }",
    )


def test_what_cannot_be_exported_says_what_to_do(tmp_path):
    made = orbiting(6, n=1200)
    young = Tracker(params=MODELS["full"])
    young.update(*part(made, 0, 20))
    with pytest.raises(AgonicError, match="not settled after 20 readings; pass on more"):
        write_tracker(young.params, young.state, tmp_path)
    warm = Thermal(bias=[[0.0, 0, 0]], matrix=[np.eye(3)], centre_C=20.0, half_range_C=10.0)
    with pytest.raises(AgonicError, match="changes with temperature"):
        write_tracker(young.params, Tracker(warm, MODELS["full"]).state, tmp_path)


def test_the_command_takes_a_track_file(settled, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    settled[0].save("now.json")
    assert run(["export", "now.json", "--to", "c", "--name", "boom"]) == 0
    assert "Written   now/boom_tracker.c" in capsys.readouterr().out
    sources = ("boom_tracker.c", "boom_tracker_selftest.c")
    program = compiled(tmp_path / "now", *sources, flags=("-O2", "-DBOOM_TRACKER_MAIN"))
    assert subprocess.run([program], check=False).returncode == 0
    assert run(["export", "now.json", "--to", "px4"]) == 2
    assert "cannot follow" in capsys.readouterr().err


@pytest.mark.parametrize("name", PROCESSORS)
def test_its_self_test_passes_on_processors(name, settled, tmp_path):
    processor = PROCESSORS[name]
    if processor.missing:
        pytest.skip(processor.missing)
    write_tracker(settled[0].params, settled[0].state, tmp_path, name="mag")
    (tmp_path / "main.c").write_text(MAIN)
    told = processor.run(
        processor.build(tmp_path, "mag_tracker.c", "mag_tracker_selftest.c", "main.c")
    )
    assert told["right"] == 1
    assert told["end"] == 0
    assert told["bytes"] < 1000
    assert processor.measure(tmp_path, "mag_tracker.c")[1] == 0
