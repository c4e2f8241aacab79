"""The bound of the C's numeric error: inputs that try to exceed it do not, and come near it."""

import ctypes
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.calibration.setup import Compass, Setup
from agonic.exports.firmware import write_firmware
from agonic.exports.firmware.error_bound import compute_error_bound_deg
from agonic.exports.firmware.plan import Plan
from agonic.exports.firmware.prediction import predict
from agonic.maths.rotations.attitude import rot_nb
from tests.exports.controller import Controller, library
from tests.exports.test_firmware import CHAMBER, FELT, GRID, HARD, MOTORS, apart, inputs_of

SOFT = Compass(calibration=replace(HARD.calibration, bias=[3000.0, -2000, 500]))
PLACE = {"horizontal": 19_930.0, "vertical": 44_764.0}
SETUPS = {
    "hard iron and a card": (Setup(compasses=(HARD,), **PLACE), -123.4),
    "little iron": (Setup(compasses=(SOFT,), **PLACE), 2.5),
    "inclinometer": (Setup(compasses=(SOFT,), tilt_order="pitch-roll", **PLACE), 2.5),
    "no place": (Setup(compasses=(SOFT,)), 2.5),
    "accelerometer": (Setup(compasses=(SOFT,), tilt="accelerometer", **PLACE), 2.5),
    "calibrated": (Setup(compasses=(SOFT,), tilt="accelerometer", accelerometer=FELT, **PLACE), 2),
    "level": (Setup(compasses=(SOFT,), tilt="level", **PLACE), 0.1),
    "table": (Setup(compasses=(SOFT,), **PLACE), GRID),
}
MANY = """
#include "compass.h"
void many(const compass_input *in, compass_output *out, long n);
void many(const compass_input *in, compass_output *out, long n)
{
    long k;
    for (k = 0; k < n; k++) {
        compass_heading(in + k, out + k);
    }
}
"""


def draw(plan, rng, n):
    """Inputs that make the errors large: fields and tilts on the limits of the status."""
    setup = plan.setup
    edge = rng.random(n) < 0.7
    tilt = setup.tilt_limit_deg * np.where(edge, 1 - 1e-3 * rng.random(n), np.sqrt(rng.random(n)))
    z, around = np.cos(np.radians(tilt)), rng.uniform(0, 2 * np.pi, n)
    if plan.tilt == "level":
        z = np.ones(n)
    across = np.sqrt(1 - z**2)
    roll = np.degrees(np.arctan2(across * np.sin(around), z))
    pitch = np.degrees(np.arcsin(-across * np.cos(around)))
    if plan.order == "pitch-roll":
        roll, pitch = pitch, roll
    heading = np.where(rng.random(n) < 0.5, rng.uniform(0, 360, n), rng.normal(0, 3, n) % 360)
    expected = plan.expected[0]
    share = setup.magnitude_limit * (1 - 1e-3 * rng.random(n)) * rng.choice([-1, 1], n)
    size = expected * (1 + share)
    if plan.dip is not None:
        most = np.radians(setup.dip_limit_deg) * (1 - 1e-3 * rng.random(n))
        dip = np.sign(plan.dip) * (abs(plan.dip) + np.where(edge, most, -most))
    elif plan.tilt == "level":
        dip = np.where(rng.random(n) < 0.5, 0.0, 1.1)
        size = size / np.cos(dip)
    else:  # as steep as a level part of 2000 nT lets it be
        dip = np.where(edge, np.arccos(2001.0 / size), rng.uniform(-1.4, 1.4, n))
    if plan.order == "pitch-roll":
        turned = np.column_stack([heading, roll, pitch])
        turn = Rotation.from_euler("ZXY", turned, degrees=True).as_matrix()
    else:
        turn = rot_nb(roll, pitch, heading)
    field = np.einsum("nij,ni->nj", turn, np.stack([np.cos(dip), 0 * dip, np.sin(dip)], 1))
    field *= size[:, None]
    force = -9.80665 * turn[:, 2] * rng.uniform(0.951, 1.049, n)[:, None]
    inputs = {"roll_deg": roll, "pitch_deg": pitch}
    if plan.accelerometer is not None:
        force = force @ np.linalg.inv(plan.accelerometer.matrix).T + plan.accelerometer.bias
    inputs["acceleration"] = force
    calibration = plan.calibrations[0]
    inputs["raw"] = (field @ np.linalg.inv(calibration.matrix).T + calibration.bias)[:, None]
    inputs["latitude_deg"] = rng.uniform(45.0, 56.0, n)
    inputs["longitude_deg"] = rng.uniform(-3.0, 17.0, n)
    return {name: v.astype(np.float32).astype(np.float64) for name, v in inputs.items()}


def find_worst(plan, folder, n, seed=0, step=100_000):
    """The largest error of true_deg where the status is 0, degrees, and of how many inputs."""
    (folder / "many.c").write_text(MANY)
    run = library(folder, "compass.c", "many.c")
    c = Controller(folder, inputs_of(plan), compasses=len(plan.calibrations))
    rng, worst, good = np.random.default_rng(seed), 0.0, 0
    for _ in range(n // step):
        inputs = draw(plan, rng, step)
        given = np.zeros(step, np.dtype(c.Input))
        for name in given.dtype.names:
            given[name] = inputs[name]
        got = np.zeros(step, np.dtype(c.Output))
        run.many(
            given.ctypes.data_as(ctypes.c_void_p),
            got.ctypes.data_as(ctypes.c_void_p),
            ctypes.c_long(step),
        )
        right = got["status"] == 0
        truth = predict(plan, inputs).true_deg
        off = apart(got["true_deg"].astype(np.float64), truth)[right]
        worst, good = max(worst, float(off.max())), good + int(right.sum())
    return worst, good


def bound_of(name, folder):
    """The plan of a setup, and the bound that its header states."""
    setup, declination = SETUPS[name]
    write_firmware(setup, folder, declination=declination)
    plan = Plan(setup=setup, declination=declination)
    said = re.search(r"true_deg is within\s+(\S+) degrees", (folder / "compass.h").read_text())
    stated = float(said[1])
    assert stated == pytest.approx(compute_error_bound_deg(plan), rel=0.01)
    return plan, stated


@pytest.mark.parametrize("name", SETUPS)
def test_no_input_exceeds_the_bound_and_some_come_near(name, tmp_path):
    plan, bound = bound_of(name, tmp_path)
    worst, good = find_worst(plan, tmp_path, 100_000)
    assert good > 30_000
    assert worst <= bound
    assert bound <= 10 * worst


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hard iron and a card", "accelerometer"])
def test_ten_million_inputs_do_not_exceed_the_bound(name, tmp_path):
    plan, bound = bound_of(name, tmp_path)
    worst, _ = find_worst(plan, tmp_path, 10_000_000, seed=1)
    assert worst <= bound <= 10 * worst


def test_where_no_bound_is_known_none_is_stated(tmp_path):
    for compass in (MOTORS, CHAMBER):  # signals of any size; polynomials of temperature
        write_firmware(Setup(compasses=(compass,)), tmp_path, declination=1.0)
        assert "exact arithmetic" not in (tmp_path / "compass.h").read_text()
