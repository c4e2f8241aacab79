"""The whole calibration that the controller finds: as good as that of a computer, as careful."""

import ctypes
from ctypes import POINTER, byref, c_float

import numpy as np
import pytest

import agonic as ag
from agonic.exports.firmware.writer import write_ellipsoid
from agonic.simulation import random_calibration
from tests.exports.controller import library
from tests.exports.processors import PROCESSORS

GOOD, FEW, NOT_YET, NO_ELLIPSOID, DISTURBED = range(5)
FIELD = 50_000.0


class Sums(ctypes.Structure):
    _fields_ = [
        ("origin", c_float * 3),
        ("sum", c_float * 35),
        ("lost", c_float * 35),
        ("next", c_float),
    ]


class Result(ctypes.Structure):
    _fields_ = [
        ("bias", c_float * 3),
        ("matrix", c_float * 3 * 3),
        ("bias_sd", c_float * 3),
        ("noise", c_float),
        ("field_sd", c_float),
        ("turn", c_float * 3),
    ]

    def array(self, name: str) -> np.ndarray:
        return np.array(getattr(self, name), dtype=float)


@pytest.fixture(scope="module")
def controller(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ellipsoid")
    for file, text in write_ellipsoid("mag").items():
        (folder / file).write_text(text)
    loaded = library(folder, "mag_ellipsoid.c")
    loaded.mag_ellipsoid_add.argtypes = [POINTER(Sums), ctypes.c_void_p]
    loaded.mag_ellipsoid_solve.argtypes = [POINTER(Sums), c_float, POINTER(Result)]
    return loaded


def solve(controller, raw, magnitude=FIELD):
    """Status and result after readings one by one."""
    sums, result = Sums(), Result()
    controller.mag_ellipsoid_begin(byref(sums))
    rows = np.ascontiguousarray(raw, dtype=np.float32)
    for row in range(len(rows)):
        controller.mag_ellipsoid_add(byref(sums), rows.ctypes.data + 12 * row)
    return controller.mag_ellipsoid_solve(byref(sums), magnitude, byref(result)), result


def readings(seed, n, noise, *, tilt_deg=180.0, bias=20_000.0):
    """Readings of a random calibration, every way or with up within an angle of the z axis."""
    rng = np.random.default_rng(seed)
    truth = random_calibration(rng, soft_iron=0.1, cross=0.05, bias=bias)
    z = rng.uniform(np.cos(np.radians(tilt_deg)), 1, n)
    around, across = rng.uniform(0, 2 * np.pi, n), np.sqrt(1 - z**2)
    field = FIELD * np.column_stack([across * np.cos(around), across * np.sin(around), z])
    raw = field @ np.linalg.inv(truth.matrix).T + truth.bias
    return raw + noise * rng.standard_normal((n, 3)), truth


@pytest.mark.parametrize(
    ("n", "noise", "tilt_deg", "bias"),
    [
        (500, 100.0, 180.0, 20_000.0),
        (3000, 50.0, 180.0, 300_000.0),
        (2000, 100.0, 90.0, 20_000.0),
        (2000, 50.0, 60.0, 20_000.0),
    ],
)
def test_it_is_the_adjusted_fit_of_python(controller, n, noise, tilt_deg, bias):
    """From the same readings, in double precision: to a twentieth of a standard error."""
    raw, _ = readings(1, n, noise, tilt_deg=tilt_deg, bias=bias)
    status, result = solve(controller, raw)
    sums = ag.Moments.of(np.float32(raw).astype(float))
    fit = ag.fit_moments(sums, ag.Reference.constant(FIELD), model="full")
    assert status == GOOD
    assert (np.abs(result.array("bias") - fit.calibration.bias) < 0.05 * fit.sd[:3]).all()
    np.testing.assert_allclose(result.array("matrix"), fit.calibration.matrix, atol=1e-4)
    np.testing.assert_allclose(result.array("bias_sd"), fit.sd[:3], rtol=0.1)
    assert result.noise == pytest.approx(fit.noise, rel=0.05)
    assert result.field_sd == pytest.approx(fit.coverage.field_sd_max, rel=0.15)


@pytest.mark.slow
def test_it_is_as_good_as_the_fit_on_a_computer_and_says_how_good(controller):
    """Over seeds: errors at most 1.1 times those of maximum likelihood, of the stated size."""
    ours, theirs, stated = [], [], []
    for seed in range(40):
        raw, truth = readings(seed, 400, 150.0, tilt_deg=120.0, bias=5000.0)
        status, result = solve(controller, raw)
        assert status == GOOD
        fit = ag.fit_ellipsoid(ag.Samples(field=raw), ag.Reference.constant(FIELD), model="full")
        ours.append(result.array("bias") - truth.bias)
        theirs.append(fit.calibration.bias - truth.bias)
        stated.append(ours[-1] / result.array("bias_sd"))
    ours, theirs, stated = map(np.array, (ours, theirs, stated))
    assert np.sqrt((ours**2).mean()) < 1.1 * np.sqrt((theirs**2).mean())
    assert np.abs(stated.mean(axis=0)).max() < 3.5 / np.sqrt(40)
    assert 0.85 < np.sqrt((stated**2).mean()) < 1.15


def test_what_readings_do_not_determine_waits_and_says_where_to_turn(controller):
    raw, _ = readings(2, 2000, 100.0, tilt_deg=40.0)
    status, result = solve(controller, raw)
    assert status == NOT_YET
    assert result.field_sd > 0.01 * FIELD
    assert result.array("turn")[2] < -0.5  # the field never pointed down
    flat = readings(3, 500, 20.0)[0]
    flat[:, 2] = 0.7 * FIELD
    for few in (flat, np.ones((500, 3)) * [3e4, -2e4, 4e4], flat[:, [0, 0, 0]]):
        assert solve(controller, few)[0] == NOT_YET
    assert solve(controller, raw[:29])[0] == FEW


def test_what_is_no_ellipsoid_or_disturbed_is_told(controller):
    hyperboloid = np.random.default_rng(0).normal(size=(400, 3)) * 3000
    away = np.sqrt(1e8 + (hyperboloid[:, :2] ** 2).sum(axis=1))
    hyperboloid[:, 2] = away * np.sign(hyperboloid[:, 2])
    assert solve(controller, hyperboloid)[0] in (NO_ELLIPSOID, NOT_YET)
    raw, _ = readings(4, 4000, 0.06 * FIELD)
    assert solve(controller, raw)[0] == DISTURBED
    cloud = np.random.default_rng(1).normal(size=(5000, 3)) * 20_000
    assert solve(controller, cloud)[0] != GOOD


def test_readings_that_are_none_are_left_out(controller):
    raw, _ = readings(5, 600, 50.0)
    spoiled = np.insert(raw, [10, 200, 400], [[np.nan, 0, 0], [0, np.inf, 0], [0, 0, 3e38]], axis=0)
    right, wrong = solve(controller, raw), solve(controller, spoiled)
    assert wrong[0] == GOOD
    assert bytes(right[1]) == bytes(wrong[1])
    assert solve(controller, raw, magnitude=np.nan)[0] != GOOD
    assert solve(controller, raw, magnitude=0.0)[0] != GOOD


@pytest.mark.recordings
def test_a_sensor_turned_by_hand(controller, recordings):
    """Counts of a real sensor: within what the two fits leave uncertain."""
    cloud = ag.read(recordings / "pointclouds" / "aleksandrbazhin_mag_out.txt")
    fit = ag.fit_ellipsoid(cloud, ag.Reference.constant(FIELD), model="full")
    status, result = solve(controller, cloud.field)
    assert status == GOOD
    apart = np.abs(result.array("bias") - fit.calibration.bias)
    assert (apart < 3 * np.hypot(result.array("bias_sd"), fit.sd[:3])).all()


MAIN = """
#include "board.h"
#include "mag_ellipsoid.h"

#include <math.h>

static mag_ellipsoid fit;
static mag_ellipsoid_result result;

/* Readings of a sphere of 500 about (300, -200, 100), stretched by 10 % along z, on a spiral. */
int main(void)
{
    float x = 1.0f;
    float y = 0.0f;
    int k;
    mag_ellipsoid_begin(&fit);
    for (k = 0; k < 200; k++) {
        const float z = (float)(2 * k - 199) / 200.0f;
        const float across = 500.0f * sqrtf(1.0f - z * z);
        const float turned = -0.7373688f * x - 0.6754903f * y; /* by the golden angle */
        const float raw[3] = {300.0f + across * x, -200.0f + across * y, 100.0f + 550.0f * z};
        mag_ellipsoid_add(&fit, raw);
        y = 0.6754903f * x - 0.7373688f * y;
        x = turned;
    }
    board_fill_stack();
    board_tell("status", mag_ellipsoid_solve(&fit, 50000.0f, &result));
    board_tell("stack", board_stack_depth());
    board_tell("bias", (long)(result.bias[0] * 10.0f + 0.5f));
    board_tell("gain", (long)(result.matrix[2][2] * 100.0f + 0.5f));
    return 0;
}
"""


@pytest.mark.parametrize("name", PROCESSORS)
def test_it_runs_on_processors(name, tmp_path):
    processor = PROCESSORS[name]
    if processor.missing:
        pytest.skip(processor.missing)
    for file, text in write_ellipsoid("mag").items():
        (tmp_path / file).write_text(text)
    (tmp_path / "main.c").write_text(MAIN)
    told = processor.run(processor.build(tmp_path, "mag_ellipsoid.c", "main.c"))
    assert told["status"] == GOOD
    assert told["bias"] == pytest.approx(3000, abs=1)
    assert told["gain"] == pytest.approx(9091, abs=2)
    assert told["stack"] < 1200
    assert told["end"] == 0
