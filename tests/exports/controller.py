"""A controller for tests: compiles generated C without a warning and calls it."""

import ctypes
import shutil
import subprocess
from ctypes import POINTER, byref, c_float, c_int
from pathlib import Path

import numpy as np

from tests.exports.objects import compile_once

STRICT = (
    "-std=c99",
    "-pedantic",
    "-Wall",
    "-Wextra",
    "-Werror",
    "-Wconversion",
    "-Wdouble-promotion",
    "-Wshadow",
    "-Wstrict-prototypes",
    "-Wmissing-prototypes",
    "-Wundef",
    "-Wcast-qual",
)
SANITIZED = (
    "-O1",
    "-fsanitize=undefined,float-cast-overflow,float-divide-by-zero",
    "-fno-sanitize-recover=all",
)
OUTPUTS = (
    "magnitude",
    "inclination_deg",
    "compass_deg",
    "magnetic_deg",
    "declination_deg",
    "true_deg",
    "disturbance",
)
VECTORS = {"raw", "second"}  # a row a magnetometer
OF_EACH = {"temperature_C", "temperature_rate_C_s"}  # a number a magnetometer


def compiled(folder: Path, *sources: str, flags: tuple[str, ...] = ("-O2",)) -> Path:
    """Sources of a folder as a program, or as a library where a flag says -shared."""
    assert shutil.which("cc"), "these tests need a C compiler: install cc"
    target = folder / "-".join(["built", *(s.removesuffix(".c") for s in sources)])
    command = ["cc", *STRICT, *flags]
    objects = [
        compile_once(command, folder / source, (folder / source).with_suffix(".o"))
        for source in sources
    ]
    subprocess.run(["cc", *flags, *objects, "-o", target, "-lm"], check=True)
    return target


TRIES = """
#include <math.h>
INCLUDE
int main(void)
{
    static const float values[] = {0.0f, 1.0f, -1.0f, 1e-30f, 1e-44f, 30000.0f, -45000.0f, 1e9f,
                                   9e14f, 3.4e38f, -3.4e38f, INFINITY, -INFINITY, NAN};
    unsigned int seed = 1;
    float x[8];
    int n, k;
    BEGIN
    for (n = 0; n < 40000; n++) {
        for (k = 0; k < 8; k++) {
            seed = seed * 1664525u + 1013904223u;
            x[k] = values[(seed >> 16) % (n % 3 ? 14u : 9u)];
        }
        CALL
    }
    return 0;
}
"""


def try_extremes(folder: Path, source: str, begin: str, call: str) -> None:
    """Run a call on numbers of all kinds, x[8], under sanitizers: nothing is undefined."""
    header = f'#include "{source.removesuffix(".c")}.h"'
    text = TRIES.replace("INCLUDE", header).replace("BEGIN", begin).replace("CALL", call)
    (folder / "tries.c").write_text(text)
    program = compiled(folder, source, "tries.c", flags=SANITIZED)
    done = subprocess.run([program], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr


def library(folder: Path, *sources: str, flags: tuple[str, ...] = ()) -> ctypes.CDLL:
    """Sources of a folder, loaded."""
    return ctypes.CDLL(str(compiled(folder, *sources, flags=("-O2", "-shared", "-fPIC", *flags))))


class Controller:
    """`compass_heading` of a folder, with inputs of the given names."""

    def __init__(self, folder: Path, inputs: tuple[str, ...], *, compasses: int = 1) -> None:
        self.run = library(folder, "compass.c")
        vector = c_float * 3
        kinds = {
            **dict.fromkeys(VECTORS, vector * compasses),
            **dict.fromkeys(OF_EACH, c_float * compasses),
            "acceleration": vector,
        }

        class Input(ctypes.Structure):
            _fields_ = [(name, kinds.get(name, c_float)) for name in inputs]

        class Output(ctypes.Structure):
            _fields_ = [
                ("field", vector),
                *((name, c_float) for name in OUTPUTS),
                ("used", c_int),
                ("status", c_int),
            ]

        self.Input, self.Output = Input, Output
        self.run.compass_heading.argtypes = [POINTER(Input), POINTER(Output)]

    def heading(self, **columns: np.ndarray) -> dict[str, np.ndarray]:
        """The outputs for columns of inputs, a row each."""
        given = np.zeros(len(columns["raw"]), np.dtype(self.Input))
        for name in given.dtype.names:
            given[name] = columns[name]
        got = np.zeros(len(given), np.dtype(self.Output))
        for i in range(len(given)):
            record = self.Input.from_buffer(given[i : i + 1])
            status = self.run.compass_heading(
                byref(record), self.Output.from_buffer(got[i : i + 1])
            )
            assert status == got["status"][i]
        return {name: got[name].astype(float, copy=False) for name in got.dtype.names}
