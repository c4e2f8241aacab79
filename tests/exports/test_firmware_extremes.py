"""The generated C under sanitizers: no input, however extreme, is undefined behaviour."""

import itertools
import subprocess
from dataclasses import replace

import numpy as np
import pytest

import agonic as ag
from agonic.calibration.setup import Compass, Setup
from agonic.cli import run
from agonic.exports.firmware import declination_grid, write_firmware
from agonic.exports.firmware.grid import DeclinationGrid
from tests.exports.controller import SANITIZED, Controller, compiled
from tests.exports.test_firmware import COUNTS, HARD, WARM

GRID = declination_grid((45.0, 55.0), (0.0, 20.0), "2026-05-01", tolerance_deg=0.5)
OUTSIDE = 8
TRIES = """
#include <math.h>
#include <string.h>
#include "compass.h"
#include "compass_ellipsoid.h"
#include "compass_fit.h"
int main(void)
{
    const float values[] = {0.0f, 1.0f, -1.0f, 1e-30f, 1e-44f, 180.0f, 191925712.0f, 3.4e38f,
                            -3.4e38f, INFINITY, -INFINITY, NAN};
    const int count = (int)(sizeof values / sizeof *values);
    compass_input in;
    compass_output out;
    compass_fit fit;
    compass_fit_result result;
    static compass_ellipsoid sums;
    compass_ellipsoid_result found;
    float inputs[sizeof in / sizeof(float)];
    unsigned int seed = 1;
    int n, k;
    compass_fit_begin(&fit);
    compass_ellipsoid_begin(&sums);
    for (n = 0; n < 20000; n++) {
        for (k = 0; k < (int)(sizeof inputs / sizeof *inputs); k++) {
            seed = seed * 1664525u + 1013904223u;
            inputs[k] = n < count ? values[n] : values[(seed >> 16) % (unsigned int)count];
        }
        memcpy(&in, inputs, sizeof in);
        compass_heading(&in, &out);
        if (n % 40 == 0) {
            compass_fit_begin(&fit);
            if (n % 400 == 0) {
                compass_ellipsoid_begin(&sums);
            }
        }
        inputs[0] *= n % 80 < 40 ? 1.0f : 1e-19f; /* small ones too, whose products vanish */
        compass_fit_add(&fit, inputs);
        compass_ellipsoid_add(&sums, inputs);
        if (n % 16 == 0) {
            compass_ellipsoid_solve(&sums, values[n % count], &found);
        }
        compass_fit_sphere(&fit, values[n % count], &result);
        compass_fit_diagonal(&fit, values[n % count], &result);
    }
    return 0;
}
"""


@pytest.mark.slow
@pytest.mark.parametrize("tilt", ["accelerometer", "auto", "level"])
def test_no_input_is_undefined(tilt, tmp_path):
    warm = Compass(calibration=replace(WARM, frame_in="b", frame_out="b"))
    setup = Setup(compasses=(HARD, COUNTS, warm), tilt=tilt)
    write_firmware(setup, tmp_path, declination=GRID)
    (tmp_path / "tries.c").write_text(TRIES)
    program = compiled(
        tmp_path, "compass.c", "compass_fit.c", "compass_ellipsoid.c", "tries.c", flags=SANITIZED
    )
    done = subprocess.run([program], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr


def test_a_place_that_is_none_is_outside(tmp_path):
    """Degrees × 10⁷ from a receiver, nothing at all, and 3.4e38."""
    write_firmware(Setup(compasses=(HARD,)), tmp_path, declination=GRID)
    inputs = ("raw", "roll_deg", "pitch_deg", "latitude_deg", "longitude_deg")
    places = [
        (50.0, 10.0, False),
        (50.0, 370.0, False),
        (50.0, 730.0, True),
        (50.0, 191925712.0, True),
        (50.0, 3.4e38, True),
        (50.0, np.nan, True),
        (np.nan, 10.0, True),
        (-np.inf, 10.0, True),
        (501234567.0, 10.0, True),
    ]
    n = len(places)
    latitude, longitude, outside = map(np.array, zip(*places, strict=True))
    flat = dict.fromkeys(("roll_deg", "pitch_deg"), np.zeros(n))
    got = Controller(tmp_path, inputs).heading(
        raw=np.tile([150_000.0, -90_000, 80_000], (n, 1)).reshape(n, 1, 3),
        latitude_deg=latitude,
        longitude_deg=longitude,
        **flat,
    )
    expected, flags = GRID.at(latitude, longitude)
    np.testing.assert_array_equal((got["status"].astype(int) & OUTSIDE) > 0, outside)
    np.testing.assert_array_equal(flags, outside)
    np.testing.assert_allclose(got["declination_deg"], expected, atol=1e-3)
    assert isinstance(GRID, DeclinationGrid)


@pytest.mark.slow
def test_two_compasses_that_tie_pass_their_self_test(tmp_path):
    """Levelled and without a strength to expect, the dip is off by the same for both."""
    two = tuple(
        Compass(
            calibration=ag.Affine(
                bias=[100.0 * k, 0, 50], matrix=np.eye(3) * (1 + k / 7), sensor=f"MAG{k}",
                frame_in="b", frame_out="b", magnitude=49_000.0,
            )
        )
        for k in range(2)
    )  # fmt: skip
    for tilt, flags in itertools.product(("level", "auto"), (("-O0",), ("-O3",))):
        folder = tmp_path / f"{tilt}{flags[0]}"
        setup = Setup(compasses=two, tilt=tilt, horizontal=20_000.0, vertical=44_000.0)
        write_firmware(setup, folder, declination=2.0)
        program = compiled(
            folder, "compass.c", "compass_selftest.c", flags=(*flags, "-DCOMPASS_MAIN")
        )
        done = subprocess.run([program], capture_output=True, text=True, check=False)
        assert done.stdout.endswith(" 0 wrong\n"), done.stdout


def test_headers_of_several_sensors_go_in_one_program(tmp_path):
    """Named after the sensor, or as asked: by the command, in Python, for a sensor of one name."""
    biases = {"mag1": 3000.0, "mag2": -500.0, "left": 1500.0, "right": -2500.0}
    for name, bias in biases.items():
        sensor = name if name.startswith("mag") else "mag1"
        mag = ag.Affine(bias=[bias, 0, 0], matrix=np.eye(3), sensor=sensor, magnitude=50_000.0)
        file = str(ag.save(mag, tmp_path / f"{name}.json"))
        asked = [] if name == sensor else ["--name", name]
        assert run(["export", file, "--to", "c", *asked]) == 0
        own = tmp_path / f"python_{name}.h"
        ag.write_c(mag, own, **({"name": name} if asked else {}))
        assert own.read_bytes() == (tmp_path / f"{name}.h").read_bytes()
    assert run(["export", file, "--to", "ros", "--name", "left"]) == 2
    included = "".join(f'#include "{name}.h"\n' for name in biases)
    tried = "".join(
        f"    {name}_correct(raw, field);\n"
        f"    right_ones += field[0] == {-bias}f && {name}_self_test();\n"
        for name, bias in biases.items()
    )
    (tmp_path / "all.c").write_text(
        f"{included}int main(void)\n{{\n    const float raw[3] = {{0.0f, 0.0f, 0.0f}};\n"
        f"    float field[3];\n    int right_ones = 0;\n{tried}    return right_ones != 4;\n}}\n"
    )
    assert subprocess.run([compiled(tmp_path, "all.c")], check=False).returncode == 0
