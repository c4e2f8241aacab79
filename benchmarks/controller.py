"""What exports cost on a controller: flash, RAM, stack and time, in emulators."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from tests.exports.processors import PROCESSORS, Processor
from tests.exports.test_c_tracker import MODELS
from tests.exports.test_firmware import CHAMBER, COUNTS, HARD, WARM
from tests.inflight.test_tracking import orbiting
from tests.inflight.turning import turn_about

import agonic as ag
from agonic.calibration.setup import Setup
from agonic.calibration.tracking import TrackerParams
from agonic.exports.firmware import declination_grid, write_firmware
from agonic.exports.firmware.tracker import write_tracker
from agonic.exports.firmware.training import write_training
from agonic.exports.firmware.writer import write_ellipsoid
from agonic.inflight.tracking import Tracker
from agonic.network.simulate import simulate_paper
from benchmarks.tables import markdown

MAIN = """
#include "board.h"
{includes}
{state}
static void call(void)
{{
{call}
}}
int main(void)
{{
    unsigned long from;
    int k;
{begin}
    board_tell("state", (long)({held}));
    board_fill_stack();
    call();
    board_tell("stack", board_stack_depth());
    from = board_ticks();
    for (k = 0; k < {times}; k++) {{
        call();
    }}
    board_tell("count", (long)((board_ticks() - from) * board_tick_size / {times}));
    return 0;
}}
"""
HELD_RAW = "sizeof start + sizeof raw + sizeof field"
HELD_CHAIN = "sizeof in + sizeof out"
RAW = (
    "static float start[3] = {31000.0f, -12000.0f, 9000.0f};\nstatic float *volatile raw = start;\n"
    "static float field[3];"
)
CHAIN = "static compass_input in;\nstatic compass_output out;"
CALL_CHAIN = "    in.raw[0][0] += 1.0f;\n    compass_heading(&in, &out);"


class Case(NamedTuple):
    """Something exported: the sources that it takes, and how it is called."""

    name: str
    sources: tuple[str, ...]
    includes: str
    state: str
    call: str
    held: str
    begin: str = ""
    times: int = 50


TURN = """\
    float x = 1.0f;
    float y = 0.0f;
    mag_ellipsoid_begin(&fit);
    for (k = 0; k < 200; k++) {
        const float z = (float)(2 * k - 199) / 200.0f;
        const float across = 500.0f * sqrtf(1.0f - z * z);
        const float turned = -0.7373688f * x - 0.6754903f * y;
        raw[0] = 300.0f + across * x;
        raw[1] = across * y - 200.0f;
        raw[2] = 550.0f * z;
        mag_ellipsoid_add(&fit, raw);
        y = 0.6754903f * x - 0.7373688f * y;
        x = turned;
    }"""
ELLIPSOID = """\
#include <math.h>
static float raw[3];
static mag_ellipsoid fit;
static mag_ellipsoid_result result;"""
LEARN = """\
    unsigned long seed = 1;
    int status = PAPER_TRAINING_BUSY;
    int k;
    paper_training_begin(&training);
    for (k = 0; k < PAPER_TRAINING_WINDOW; k++) {
        float way[3];
        float reading[3];
        float size = 0.0f;
        int i;
        for (i = 0; i < 3; i++) { /* readings after the change of the paper, all ways */
            seed = (seed * 1664525UL + 1013904223UL) & 0xFFFFFFFFUL;
            way[i] = (float)(seed >> 8) / 8388608.0f - 1.0f;
            reading[i] = (float)((seed >> 4) & 0xFFUL) / 37.0f - 3.4f; /* noise of 2 nT */
            size += way[i] * way[i];
        }
        for (i = 0; i < 3; i++) {
            way[i] = 4000.0f + 100.0f * way[i] / sqrtf(size);
        }
        reading[0] += 0.9579f * way[0] - 0.0209f * way[1] - 0.0065f * way[2] - 652.7f;
        reading[1] += 0.0020f * way[0] + 0.9456f * way[1] - 0.0040f * way[2] + 1266.4f;
        reading[2] += 0.0011f * way[0] + 0.0561f * way[1] + 0.9637f * way[2] - 444.5f;
        paper_training_add(&training, reading, way);
    }
    paper_training_start(&training);
    while (status == PAPER_TRAINING_BUSY) {
        status = paper_training_run(&training);
    }"""
CASES = (
    Case("bias and matrix", (), "plain", RAW, "    plain_correct(raw, field);", HELD_RAW),
    Case(
        "cubics of temperature",
        (),
        "warm",
        RAW,
        "    warm_correct(raw, 31.0f, 0.01f, field);",
        HELD_RAW,
    ),
    Case("network 3-3-3", (), "net", RAW, "    net_correct(raw, field);", HELD_RAW),
    Case(
        "heading, one compass with a deviation",
        ("one/compass.c",),
        "one/compass",
        CHAIN,
        CALL_CHAIN,
        HELD_CHAIN,
    ),
    Case(
        "heading, three compasses, a table of declinations",
        ("three/compass.c",),
        "three/compass",
        CHAIN,
        CALL_CHAIN,
        HELD_CHAIN,
    ),
    Case(
        "a reading for the calibration on board",
        ("mag_ellipsoid.c",),
        "mag_ellipsoid",
        ELLIPSOID,
        "    mag_ellipsoid_add(&fit, raw);",
        "sizeof raw",
        f"{TURN}\n    (void)result;",
    ),
    Case(
        "its bias and matrix",
        ("mag_ellipsoid.c",),
        "mag_ellipsoid",
        ELLIPSOID,
        "    mag_ellipsoid_solve(&fit, 50000.0f, &result);",
        "sizeof raw + sizeof result",
        TURN,
        3,
    ),
    Case(
        "a retraining of 3-3-3 over 1500 readings",
        ("paper_training.c",),
        "paper_training",
        "#include <math.h>\nstatic paper_training training;",
        LEARN,
        "0",
        times=1,
    ),
    *(
        Case(
            f"tracker, {words}",
            (f"{name}_tracker.c",),
            f"{name}_tracker",
            f"#include <math.h>\n{RAW}\nstatic float size;\nstatic {name}_tracker tracker;",
            f"    {name}_tracker_update(&tracker, 1.0f, raw, size);",
            f"{HELD_RAW} + sizeof size",
            f"    {name}_tracker_begin(&tracker);\n"
            f"    {name}_tracker_correct(&tracker, raw, field);\n"
            "    size = sqrtf(field[0] * field[0] + field[1] * field[1] + field[2] * field[2]);",
        )
        for name, words in (("bias", "external field and bias"), ("full", "and matrix"))
    ),
    *(
        Case(
            f"tracker beside a gyro, {words}",
            (f"turn_{name}_tracker.c",),
            f"turn_{name}_tracker",
            f"{RAW}\nstatic float rate[3] = {{0.3f, -0.2f, 0.1f}};\n"
            f"static turn_{name}_tracker tracker;",
            f"    turn_{name}_tracker_update(&tracker, 0.05f, raw, rate, {size});",
            f"{HELD_RAW} + sizeof rate",
            f"    turn_{name}_tracker_begin(&tracker);\n"
            f"    turn_{name}_tracker_correct(&tracker, raw, field);\n"
            "    for (k = 0; k < 3; k++) { /* a reading that fits */\n"
            "        rate[k] = tracker.now.x[6 + k];\n"
            "        raw[k] = tracker.now.x[3 + k] + tracker.now.x[k];\n    }",
        )
        for name, words, size in (
            ("bias", "field, bias, its bias, delay", "0.0f"),
            ("full", "matrix and magnitude too", "50000.0f"),
        )
    ),
)


def main() -> None:
    """A table for each processor that can be emulated here."""
    with TemporaryDirectory() as folder:
        _export(Path(folder))
        for name, processor in PROCESSORS.items():
            print(f"## {name}\n")
            unit = "cycles" if processor.board == "avr" else "instructions"
            print(f"{processor.missing or _table(processor, unit, Path(folder))}\n")
    print(WORDS)


WORDS = """\
Flash: what a program with the call has more than an empty one, with the functions of the
mathematical library that it takes. RAM: variables that outlive a call; the 104 bytes are those in
which newlib keeps errno, which its mathematics sets. Stack: bytes below the caller, 64 standing
for that or less. Count: one call, the mean of many: cycles in simavr, instructions in qemu. On a
Cortex-M4F most instructions take one cycle, loads two, divisions and roots fourteen. Compiled for
size (-Os)."""


def _table(processor: Processor, unit: str, folder: Path) -> str:
    empty = _linked(processor, folder, Case("", (), "", "", "", "0"))
    rows = []
    for case in CASES:
        if "retraining" in case.name and "4M" not in processor.memory:
            continue  # it keeps 38 kB of readings and sums, and wants floats in hardware
        flash, ram, told = _linked(processor, folder, case)
        rows.append(
            [
                case.name,
                f"{flash - empty[0]}",
                f"{ram - empty[1] - told['state']}",
                f"{told['stack']}",
                f"{told['count']}",
            ]
        )
    return markdown(["exported", "flash", "RAM", "stack", unit], rows)


def _linked(processor: Processor, folder: Path, case: Case) -> tuple[int, int, dict[str, int]]:
    """Flash and RAM of a program that makes the call, and what it tells."""
    includes = "".join(f'#include "{name}.h"\n' for name in case.includes.split())
    values = {**case._asdict(), "includes": includes}
    (folder / "main.c").write_text(MAIN.format(**values))
    program = processor.build(folder, *case.sources, "main.c")
    flash, ram = processor.measure_file(program)
    return flash, ram, processor.run(program)


def _export(folder: Path) -> None:
    """Everything that the cases call."""
    made = simulate_paper(directions="space", seed=1).select(slice(1500))
    network = ag.fit_network(
        made.samples, made.reference, hidden=3, compared=False, restarts=1
    ).calibration
    for name, calibration in (("plain", HARD.calibration), ("warm", WARM), ("net", network)):
        ag.write_c(calibration, folder / f"{name}.h", name=name)
    grid = declination_grid((45.0, 56.0), (-3.0, 17.0), "2026-05-01")
    compasses = (COUNTS, replace(CHAMBER, deviation=None), HARD)
    three = Setup(compasses=compasses, horizontal=19e3, vertical=45e3)
    write_firmware(Setup(compasses=(HARD,)), folder / "one", declination=2.5)
    write_firmware(three, folder / "three", declination=grid)
    alone = ag.fit_network(
        made.samples, made.reference, base=None, hidden=3, compared=False, restarts=1
    ).calibration
    write_training(alone, folder, window=1500, name="paper")
    for file, text in write_ellipsoid("mag").items():
        (folder / file).write_text(text)
    for name in ("bias", "full"):
        samples, known, _, _ = orbiting(0, n=1500)
        tracker = Tracker(params=replace(MODELS[name], external_sd=20.0, walk=0.5))
        tracker.update(samples, known)
        write_tracker(tracker.params, tracker.state, folder, name=name)
    for name in ("bias", "full"):
        made = turn_about(0, soft_iron=0.02 if name == "full" else 0.0)
        settings = TrackerParams(noise=100.0, solve=name, gyro=True, walk=0.5, external_sd=20.0)
        turned = Tracker(params=settings)
        turned.update(made.samples, made.magnitude if name == "full" else None)
        write_tracker(turned.params, turned.state, folder, name=f"turn_{name}")


if __name__ == "__main__":
    main()
