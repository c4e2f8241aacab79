"""Columns that go through a filter, on a controller: as in Python, to 0.01 degrees."""

from __future__ import annotations

from ctypes import POINTER, Structure, byref, c_float, c_int
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.calibration.setup import Compass, Setup
from agonic.calibration.timing import follow, undo_filter
from agonic.exports.ardupilot import compute_ardupilot_parameters
from agonic.exports.firmware.writer import write_firmware
from tests.exports.controller import Controller

STEP_S = 0.05
SOURCES = ("current_A~0.3", "rod_x_Am2~-0.8", "motor1_duty^2~0.1")


def compass(*sources: str, sensor: str = "MAG") -> Compass:
    added = np.array([[90.0, -4000.0, 6000.0], [-60.0, 2500.0, 900.0], [30.0, 1000.0, -3000.0]])
    return Compass(
        calibration=ag.Interference(
            bias=[900.0, 0, -3000],
            matrix=np.eye(3),
            magnitude=49_000.0,
            sensor=sensor,
            frame_in="b",
            frame_out="b",
            sources=sources,
            coefficients=added[:, : len(sources)],
        )
    )


def test_a_filter_and_its_reverse_undo_each_other() -> None:
    rng = np.random.default_rng(0)
    time = np.cumsum(rng.uniform(0.01, 0.4, 300))
    x = rng.normal(size=300)
    np.testing.assert_allclose(undo_filter(time, follow(time, x, 0.5), 0.5), x, atol=1e-9)
    late = np.concatenate([time, [time[-1] + 1e4]])
    assert undo_filter(late, np.append(x, 3.0), 0.5)[-1] == pytest.approx(3.0)


def test_the_controller_follows_what_python_follows(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    n = 400
    columns = {
        "current_A": follow(np.arange(n) * STEP_S, rng.uniform(0, 20, n), 0.3),
        "rod_x_Am2": np.repeat(rng.choice([-0.2, 0.0, 0.2], n // 20), 20),
        "motor1_duty": rng.uniform(0.2, 0.9, n),
    }
    turn = np.linspace(0, 4 * np.pi, n)
    field = np.stack([20e3 * np.cos(turn), -20e3 * np.sin(turn), np.full(n, 44e3)], axis=1)
    samples = ag.Samples(
        field=field,
        unit="nT",
        frame="b",
        name="MAG",
        time=np.arange(n) * STEP_S,
        roll_deg=np.zeros(n),
        pitch_deg=np.zeros(n),
        disturbers={name: columns[name] for name in ("rod_x_Am2", "motor1_duty")},
        current_A=columns["current_A"],
    )
    setup = Setup(compasses=(compass(*SOURCES),), tilt="log", declination_deg=2.0)
    written = write_firmware(setup, tmp_path)
    assert any("_follow" in one for one in written.warnings)
    expected = ag.heading(samples, setup).true_deg
    names = ("raw", "roll_deg", "pitch_deg", *columns)
    controller = Controller(tmp_path, names)

    class Memory(Structure):
        _fields_ = (("last", c_float * 3), ("begun", c_int))

    run = controller.run.compass_follow
    run.argtypes = [POINTER(Memory), c_float, POINTER(controller.Input)]
    memory, followed = Memory(), {name: np.zeros(n) for name in columns}
    for i in range(n):
        record = controller.Input(**{name: values[i] for name, values in columns.items()})
        run(byref(memory), STEP_S, byref(record))
        for name, values in followed.items():
            values[i] = getattr(record, name)
    got = controller.heading(
        raw=field[:, None], roll_deg=np.zeros(n), pitch_deg=np.zeros(n), **followed
    )
    apart = (got["true_deg"] - expected + 180) % 360 - 180
    assert np.abs(apart).max() < 0.01
    plain = controller.heading(
        raw=field[:, None], roll_deg=np.zeros(n), pitch_deg=np.zeros(n), **columns
    )
    assert np.abs((plain["true_deg"] - expected + 180) % 360 - 180).max() > 1.0


def test_two_compasses_with_different_time_constants_are_refused(tmp_path: Path) -> None:
    both = Setup(
        compasses=(compass("current_A~0.3"), compass("current_A", sensor="MAG2")),
        declination_deg=0.0,
    )
    with pytest.raises(ag.AgonicError, match="different time constants"):
        write_firmware(both, tmp_path)


def test_what_a_controller_learns_late_is_said(tmp_path: Path) -> None:
    setup = Setup(compasses=(compass("current_A@0.2"),), declination_deg=0.0)
    assert any("0.2 s late" in one for one in write_firmware(setup, tmp_path).warnings)


def test_a_target_with_a_term_for_the_current_takes_it_as_recorded(tmp_path: Path) -> None:
    late, plain = compass("current_A~0.3").calibration, compass("current_A").calibration
    made = [ag.write_ardupilot(one, tmp_path / "mag.param") for one in (late, plain)]
    parameters = [compute_ardupilot_parameters(one)[0] for one in (late, plain)]
    assert parameters[0] == parameters[1]
    assert any("without removing" in one for one in made[0].warnings)
    assert not any("without removing" in one for one in made[1].warnings)
