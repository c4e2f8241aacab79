"""What is exported, on the processors it is for: right, small, and never trapped by an input."""

from dataclasses import replace

import pytest

import agonic as ag
from agonic.calibration.setup import Setup
from agonic.exports.firmware import declination_grid, write_firmware
from agonic.network.simulate import simulate_nonaffine
from tests.exports.processors import PROCESSORS
from tests.exports.test_firmware import CHAMBER, COUNTS, HARD, WARM

MAIN = """
#include "board.h"
#include "plain.h"
#include "warm.h"
#include "net.h"
#include "compass.h"
#include "compass_fit.h"

#include <math.h>

static compass_fit fit;

/* How many of readings that are none have a good status; NaN, infinities, no field, too large. */
static int missed(void)
{
    static const float values[] = {NAN, INFINITY, -INFINITY, 0.0f, 3e38f};
    const float one = 30000.0f;
    int good = 0;
    int k;
    int axis;
    for (k = 0; k < 15; k++) {
        compass_input in = {0};
        compass_output out;
        compass_fit_result result;
        float raw[3] = {one, one, one};
        float field[3];
        float *in_raw = &in.raw[0][0];
        const float value = values[k / 3];
        axis = k % 3;
        raw[axis] = value;
        for (axis = 0; axis < 9; axis++) {
            in_raw[axis] = k / 3 == 3 ? 0.0f : raw[axis % 3];
        }
        in.roll_deg = in.pitch_deg = in.latitude_deg = value;
        good += compass_heading(&in, &out) == 0;
        compass_fit_add(&fit, raw);
        good += compass_fit_diagonal(&fit, one, &result) == 0;
        if (k / 3 != 3) {
            good += k < 9 && plain_correct(raw, field);
            good += k < 9 && warm_correct(raw, 20.0f, 0.0f, field);
            good += net_correct(raw, field);
        }
        good += warm_correct(raw, value, value, field) && k / 3 != 3;
    }
    return good;
}

int main(void)
{
    compass_fit_begin(&fit);
    board_tell("compass_wrong", compass_self_test());
    board_tell("plain", plain_self_test());
    board_tell("warm", warm_self_test());
    board_tell("net", net_self_test());
    board_tell("missed", missed());
    return 0;
}
"""


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A folder with the C of three compasses over a table of declinations, and of three sensors."""
    folder = tmp_path_factory.mktemp("exported")
    made = simulate_nonaffine(n=600, seed=1)
    network = ag.fit_network(
        made.samples, made.reference, base=None, hidden=3, compared=False, restarts=1
    ).calibration
    for name, calibration in (
        ("plain", HARD.calibration),
        ("warm", WARM),
        ("net", network),
    ):
        ag.write_c(calibration, folder / f"{name}.h", name=name)
    grid = declination_grid((45.0, 56.0), (-3.0, 17.0), "2026-05-01")
    setup = Setup(
        compasses=(COUNTS, replace(CHAMBER, deviation=None), HARD), horizontal=19e3, vertical=45e3
    )
    write_firmware(setup, folder, declination=grid)
    (folder / "main.c").write_text(MAIN)
    return folder


@pytest.mark.parametrize("name", PROCESSORS)
def test_every_self_test_passes_and_no_input_traps(name, written):
    processor = PROCESSORS[name]
    if processor.missing:
        pytest.skip(processor.missing)
    sources = ("compass.c", "compass_selftest.c", "compass_fit.c", "main.c")
    told = processor.run(processor.build(written, *sources))
    right = {"compass_wrong": 0, "plain": 1, "warm": 1, "net": 1, "missed": 0, "end": 0}
    assert told == right
    for source in sources[:3]:
        flash, ram = processor.measure(written, source)
        assert 300 < flash < 12_000
        assert ram == 0
