"""The calibration that runs on the controller: float32 sums against double precision."""

import ctypes
from ctypes import POINTER, byref, c_float

import numpy as np
import pytest

import agonic as ag
from agonic.exports.firmware.c_text import fill_template
from agonic.simulation import random_calibration
from tests.exports.controller import library

GOOD, FEW, UNDETERMINED, NO_ELLIPSOID = range(4)
FIELD = 50_000.0
GAIN = np.array([1.12, 0.93, 1.03])
HARD_IRON = FIELD * np.array([0.6, -0.48, 0.64])  # as long as the field


class Fit(ctypes.Structure):
    _fields_ = [
        ("origin", c_float * 3),
        ("count", c_float),
        ("sum", c_float * 27),
        ("lost", c_float * 27),
    ]


class Result(ctypes.Structure):
    _fields_ = [
        ("bias", c_float * 3),
        ("gain", c_float * 3),
        ("spread", c_float),
        ("clarity", c_float),
    ]


@pytest.fixture(scope="module")
def controller(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fit")
    for file, template in (("fit.h", "fit/header.h.in"), ("fit.c", "fit/source.c.in")):
        text = fill_template(template, {"name": "mag", "GUARD": "MAG"})
        (folder / f"mag_{file}").write_text(text)
    loaded = library(folder, "mag_fit.c")
    loaded.mag_fit_add.argtypes = [POINTER(Fit), ctypes.c_void_p]
    for model in ("diagonal", "sphere"):
        function = getattr(loaded, f"mag_fit_{model}")
        function.argtypes = [POINTER(Fit), c_float, POINTER(Result)]
    return loaded


def fed(controller, raw):
    """The sums after readings one by one."""
    fit = Fit()
    controller.mag_fit_begin(byref(fit))
    rows = np.ascontiguousarray(raw, dtype=np.float32)
    for row in range(len(rows)):
        controller.mag_fit_add(byref(fit), rows.ctypes.data + 12 * row)
    return fit


def solved(controller, fit, model="diagonal"):
    """Status, bias, gain, spread, clarity."""
    result = Result()
    status = getattr(controller, f"mag_fit_{model}")(byref(fit), FIELD, byref(result))
    return status, np.array(result.bias), np.array(result.gain), result.spread, result.clarity


def double(raw, model="diagonal"):
    """The same least squares in double precision, from the rows themselves by QR."""
    raw = np.float32(raw).astype(float)
    middle = raw.mean(axis=0)
    u = raw - middle
    columns = [u, np.ones((len(u), 1))]
    if model == "diagonal":
        columns.insert(
            0, np.column_stack([u[:, 0] ** 2 - u[:, 2] ** 2, u[:, 1] ** 2 - u[:, 2] ** 2])
        )
    known, target = np.hstack(columns), -(u**2).sum(axis=1)
    scale = np.linalg.norm(known, axis=0)
    found = np.linalg.lstsq(known / scale, target, rcond=None)[0] / scale
    p, q = found[:2] if model == "diagonal" else (0.0, 0.0)
    r, s = found[-4:-1], found[-1]
    square = np.array([1 + p, 1 + q, 1 - p - q])
    size = (r**2 / square).sum() / 4 - s
    return middle - r / square / 2, FIELD * np.sqrt(square / size)


def readings(n, hard, noise, *, tilt_deg=180.0, seed=0):
    """Every way, or with up tilted from the z axis by no more than the angle."""
    rng = np.random.default_rng(seed)
    z = rng.uniform(np.cos(np.radians(tilt_deg)), 1, n)
    around, across = rng.uniform(0, 2 * np.pi, n), np.sqrt(1 - z**2)
    field = FIELD * np.column_stack([across * np.cos(around), across * np.sin(around), z])
    return field / GAIN + hard * HARD_IRON + noise * rng.normal(size=(n, 3))


@pytest.mark.parametrize("model", ["diagonal", "sphere"])
@pytest.mark.parametrize("hard", [0.3, 1.0, 5.0, 20.0])
@pytest.mark.parametrize(("n", "noise"), [(200, 0.0), (3000, 300.0), (60_000, 300.0)])
def test_float32_agrees_with_double_to_three_decimals(controller, model, hard, n, noise):
    raw = readings(n, hard, noise)
    status, bias, gain, _, _ = solved(controller, fed(controller, raw), model)
    expected_bias, expected_gain = double(raw, model)
    assert status == GOOD
    assert np.abs(bias - expected_bias).max() < 1e-5 * FIELD * max(1, hard / 10)  # 0.5 nT
    assert np.abs(gain - expected_gain).max() < 1e-5


@pytest.mark.parametrize(("tilt_deg", "noise"), [(60.0, 100.0), (45.0, 30.0), (35.0, 10.0)])
def test_a_vehicle_that_tilts_little_still_agrees(controller, tilt_deg, noise):
    raw = readings(5000, 3.0, noise, tilt_deg=tilt_deg)
    status, bias, gain, _, _ = solved(controller, fed(controller, raw))
    expected_bias, expected_gain = double(raw)
    assert status == GOOD
    assert np.abs(bias - expected_bias).max() < 1e-3 * FIELD
    assert np.abs(gain - expected_gain).max() < 1e-3


@pytest.mark.parametrize("noise", [20.0, 100.0, 300.0, 1000.0])
def test_noise_shifts_the_gains_by_no_more_than_the_clarity_says(controller, noise):
    """The linear fit is pulled by noise; where by more than some percent, it is refused."""
    statuses = set()
    for tilt_deg in (15.0, 25.0, 35.0, 45.0, 60.0, 90.0, 180.0):
        raw = readings(2000, 1.0, noise, tilt_deg=tilt_deg)
        status, _, gain, _, clarity = solved(controller, fed(controller, raw))
        statuses.add(status)
        assert (status == GOOD) == (clarity >= 50)
        if status == GOOD:
            assert np.abs(gain / GAIN - 1).max() < 4 / clarity + 5 / np.sqrt(2000 * clarity)
    assert statuses == {GOOD, UNDETERMINED}


@pytest.mark.parametrize("hard", [0.5, 4.0])
def test_it_agrees_with_the_fit_in_python(controller, hard):
    raw = readings(4000, hard, 100.0, seed=2)
    status, bias, gain, spread, _ = solved(controller, fed(controller, raw))
    fit = ag.fit_ellipsoid(ag.Samples(field=raw), ag.Reference.constant(FIELD), model="diagonal")
    assert status == GOOD
    assert np.abs(bias - fit.calibration.bias).max() < 1e-3 * FIELD
    assert np.abs(gain - np.diag(fit.calibration.matrix)).max() < 1e-3
    assert spread == pytest.approx(np.std(np.linalg.norm((raw - bias) * gain, axis=1)), rel=0.03)


@pytest.mark.parametrize("seed", range(3))
def test_a_simulated_turn_in_the_hand(controller, seed):
    """Truth of a hand turned every way, within five standard errors of the fit in Python."""
    truth = random_calibration(np.random.default_rng(seed))
    diagonal = ag.Affine(bias=truth.bias, matrix=np.diag(np.diag(truth.matrix)))
    made = ag.simulate("hand", calibration=diagonal, seed=seed)
    size = float(np.median(np.linalg.norm(diagonal.correct(made.samples.field), axis=1)))
    status, bias, gain, _, _ = solved(controller, fed(controller, made.samples.field))
    fit = ag.fit_ellipsoid(made.samples, ag.Reference.constant(FIELD), model="diagonal")
    assert status == GOOD
    assert np.abs(bias - fit.calibration.bias).max() < max(5 * fit.sd[:3].max(), 1e-3 * FIELD)
    assert gain / gain.mean() == pytest.approx(
        np.diag(truth.matrix) / np.diag(truth.matrix).mean(), abs=5e-3
    )
    assert size > 0


@pytest.mark.parametrize("noise", [100.0, 1000.0])
@pytest.mark.parametrize("hard", [0.5, 10.0])
def test_the_spread_is_the_noise(controller, noise, hard):
    raw = readings(3000, hard, noise)
    _, _, gain, spread, _ = solved(controller, fed(controller, raw))
    assert spread == pytest.approx(noise * np.sqrt((gain**2).mean()), rel=0.08)


def test_what_readings_do_not_determine_is_refused(controller):
    flat = readings(500, 1.0, 20.0)
    flat[:, 2] = FIELD * 0.7
    assert solved(controller, fed(controller, flat))[0] == UNDETERMINED
    assert solved(controller, fed(controller, flat), "sphere")[0] == UNDETERMINED
    still = np.ones((500, 3)) * HARD_IRON
    assert solved(controller, fed(controller, still))[0] == UNDETERMINED
    assert solved(controller, fed(controller, readings(9, 1.0, 0.0)))[0] == FEW
    hyperboloid = np.random.default_rng(0).normal(size=(400, 3)) * 3000
    hyperboloid[:, 2] = np.sqrt(1e8 + (hyperboloid[:, :2] ** 2).sum(axis=1)) * np.sign(
        hyperboloid[:, 2]
    )
    assert solved(controller, fed(controller, hyperboloid))[0] == NO_ELLIPSOID
    broken = readings(100, 1.0, 0.0)
    broken[50, 1] = np.nan
    assert solved(controller, fed(controller, broken))[0] != GOOD


def test_a_fit_can_start_anew(controller):
    fit = fed(controller, readings(300, 9.0, 0.0))
    controller.mag_fit_begin(byref(fit))
    rows = np.ascontiguousarray(readings(300, 0.3, 0.0, seed=5), dtype=np.float32)
    for row in range(len(rows)):
        controller.mag_fit_add(byref(fit), rows.ctypes.data + 12 * row)
    assert fit.count == 300
    assert np.abs(solved(controller, fit)[1] - 0.3 * HARD_IRON).max() < 1.0
