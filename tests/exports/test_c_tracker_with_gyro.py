"""The tracker beside a gyro in C: that of Python to single precision, through magnets and all."""

import ctypes
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.calibration.tracking import TrackerParams
from agonic.exports.firmware.tracker import write_tracker
from agonic.inflight.tracking import Tracker
from tests.exports.controller import library, try_extremes
from tests.exports.processors import PROCESSORS
from tests.exports.test_c_tracker import JUMPED, MAIN, NONE, REFUSED, UNSETTLED
from tests.inflight.turning import turn_about

PARAMS = TrackerParams(noise=100.0, solve="bias", gyro=True)


class Board:
    """The exported tracker, compiled, from its start."""

    def __init__(self, tracker: Tracker, folder: Path) -> None:
        write_tracker(tracker.params, tracker.state, folder, name="mag")
        self.run = library(folder, "mag_tracker.c", "mag_tracker_selftest.c")
        single, place = ctypes.c_float, ctypes.c_void_p
        self.run.mag_tracker_update.argtypes = [place, single, place, place, single]
        self.state = ctypes.create_string_buffer(4096)
        self.run.mag_tracker_begin(self.state)
        self.time = tracker.state.time

    def update(self, samples: ag.Samples, magnitude: float = 0.0) -> np.ndarray:
        """The status of each reading."""
        raw, rate = np.float32(samples.field), np.float32(samples.rotation_rate)
        elapsed = np.diff(samples.time, prepend=self.time)
        self.time = samples.time[-1]
        return np.array(
            [
                self.run.mag_tracker_update(
                    self.state, elapsed[k], raw[k].ctypes.data, rate[k].ctypes.data, magnitude
                )
                for k in range(len(raw))
            ]
        )

    def read(self, name: str) -> np.ndarray:
        """Three numbers that a function gives."""
        three = np.zeros(3, np.float32)
        getattr(self.run, f"mag_tracker_{name}")(self.state, ctypes.c_void_p(three.ctypes.data))
        return three.astype(float)

    @property
    def bias(self) -> np.ndarray:
        return np.frombuffer(self.state, np.float32, 16)[3:6].astype(float)


def halves(samples: ag.Samples, first: int) -> tuple[ag.Samples, ag.Samples]:
    rows = np.arange(len(samples))
    return samples.select(rows < first), samples.select(rows >= first)


def check_agreement(board: Board, tracker: Tracker, share: float = 0.02) -> None:
    """To single precision: a fiftieth of a standard error, and its size to a hundredth."""
    turn = tracker.state.turn
    assert turn is not None
    sd = np.sqrt(np.diag(turn.covariance))
    assert np.abs(board.bias - tracker.bias).max() < share * sd[3:6].min()
    np.testing.assert_allclose(board.read("bias_sd"), sd[3:6], rtol=share / 2)
    field = turn.field @ tracker.state.turned.rotation.T
    assert np.abs(board.read("field") - field).max() < share * sd[:3].max()


@pytest.fixture(scope="module")
def settled() -> tuple[Tracker, ag.Samples]:
    """A tracker after 700 of 1200 readings, and the rest; not to be moved on."""
    first, second = halves(turn_about(4).samples, 700)
    tracker = Tracker(params=PARAMS)
    tracker.update(first)
    return tracker, second


@pytest.mark.slow
@pytest.mark.parametrize(("solve", "gauge"), [("bias", ""), ("full", ""), ("full", "free")])
def test_it_agrees_with_python(solve: str, gauge: str, tmp_path: Path) -> None:
    made = turn_about(2, soft_iron=0.02 if solve == "full" else 0.0)
    ground = None
    if gauge:
        turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        ground = ag.Affine(bias=[0.0, 0.0, 0.0], matrix=turn, gauge="free")
        rate = made.samples.rotation_rate @ turn.T
        made = made._replace(samples=made.samples.with_columns(rotation_rate=rate))
    tracker = Tracker(ground, replace(PARAMS, solve=solve, matrix_sd=0.02))
    first, second = halves(made.samples, 700)
    known = ag.Reference.constant(50_000.0, sd=200.0) if solve == "full" else None
    tracker.update(first, known)
    board = Board(tracker, tmp_path)
    assert board.run.mag_tracker_self_test() == 1
    status = board.update(second, 0.0 if known is None else 50_000.0)
    tracker.update(second, known)
    assert (status & ~REFUSED == 0).all()
    check_agreement(board, tracker)


@pytest.mark.slow
@pytest.mark.recordings
def test_it_agrees_while_a_magnet_comes_and_goes(recordings: Path, tmp_path: Path) -> None:
    samples = ag.read(recordings / "vehicle/broad/34_disturbed_attached_magnet_3cm.mat")
    ground = ag.Affine(bias=[0.0, 0.0, 0.0], matrix=np.eye(3))
    first, second = halves(samples, int(np.searchsorted(samples.time, 70.0)))
    tracker = Tracker(ground, TrackerParams(solve="bias", bias_sd=1000.0, noise=640.0))
    tracker.update(first)
    board = Board(tracker, tmp_path)
    before = len(tracker.jumps)
    part, rest = halves(second, int(np.searchsorted(second.time, 98.0)))
    assert (board.update(part) & ~REFUSED == 0).all()
    tracker.update(part)
    check_agreement(board, tracker, share=0.1)
    status = board.update(rest)
    tracker.update(rest)
    assert np.count_nonzero(status & JUMPED) == len(tracker.jumps) - before == 1
    assert not status[-1] & UNSETTLED
    check_agreement(board, tracker, share=0.2)


@pytest.mark.slow
def test_it_goes_on_byte_for_byte_after_a_power_cut(settled, tmp_path: Path) -> None:
    tracker, rest = settled
    first, second = halves(rest, 200)
    board = Board(tracker, tmp_path)
    board.update(first)
    saved = ctypes.create_string_buffer(4096)
    board.run.mag_tracker_save(board.state, saved)
    time = board.time
    board.update(second)
    end = board.state.raw
    board.run.mag_tracker_begin(board.state)
    assert board.run.mag_tracker_restore(board.state, saved) == 1
    board.time = time
    board.update(second)
    assert board.state.raw == end


@pytest.mark.slow
def test_readings_that_are_none_change_nothing(settled, tmp_path: Path) -> None:
    tracker, rest = settled
    board = Board(tracker, tmp_path)
    before, raw = board.state.raw, rest.field[0]
    for reading, rate, elapsed, size in (
        ([np.nan, 0, 0], [0, 0, 0], 1.0, 0.0),
        ([3e38, 3e38, 0], [0, 0, 0], 1.0, 0.0),
        (raw, [0, np.inf, 0], 1.0, 0.0),
        (raw, [0, 0, 0], np.nan, 0.0),
        (raw, [0, 0, 0], 0.0, 0.0),
        (raw, [0, 0, 0], 1.0, np.nan),
    ):
        one, other = np.float32(reading), np.float32(rate)
        call = board.run.mag_tracker_update
        assert call(board.state, elapsed, one.ctypes.data, other.ctypes.data, size) == NONE
        assert board.state.raw == before


@pytest.mark.slow
def test_no_input_is_undefined(settled, tmp_path: Path) -> None:
    write_tracker(settled[0].params, settled[0].state, tmp_path, name="mag")
    try_extremes(
        tmp_path,
        "mag_tracker.c",
        "static mag_tracker t;\n    mag_tracker_begin(&t);",
        "mag_tracker_update(&t, n % 5 ? 0.1f : x[0], x + 1, x + 4, n % 7 ? 0.0f : x[4]);\n"
        "        mag_tracker_field(&t, x + 5);\n        mag_tracker_bias_sd(&t, x);\n"
        "        if (n % 5000 == 0) {\n            mag_tracker_begin(&t);\n        }",
    )


@pytest.mark.parametrize("name", PROCESSORS)
def test_its_self_test_passes_on_processors(name: str, settled, tmp_path: Path) -> None:
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
    assert told["bytes"] < 500
    assert processor.measure(tmp_path, "mag_tracker.c")[1] == 0
