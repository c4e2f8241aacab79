"""The C header: it compiles without a warning, its self-test holds, and it computes the field."""

import shutil
import subprocess

import numpy as np
import pytest

from agonic.calibration.affine import Affine
from agonic.errors import AgonicError, LogError
from agonic.exports.c_header import write_c
from agonic.provenance import Input, Provenance
from tests.exports.read_back import apply_c, parse_c

MATRIX = np.array([[1.2, 0.03, -0.02], [0.01, 1.1, 0.05], [-0.04, 0.06, 1.0]])
NASTY = Provenance(inputs=(Input(name="logs/*.csv */ ??/", sha256="00", count=1),))
NANOTESLA = Affine(
    bias=[3123.456, -20000.0, 100.0], matrix=MATRIX, magnitude=48000.0, provenance=NASTY
)
COUNTS = Affine(bias=[12.5, -340.0, 0.0], matrix=MATRIX * 91.3, unit_in="raw")
READINGS = np.array([[25000.0, -31000.25, 42000.5], [-300.0, 0.0, 512.0]])

MAIN = """
#include <stdio.h>
#include <stdlib.h>
#include "mag.h"
int main(int argc, char **argv)
{
    float v[3];
    int i;
    for (i = 1; i + 2 < argc; i += 3) {
        v[0] = strtof(argv[i], NULL);
        v[1] = strtof(argv[i + 1], NULL);
        v[2] = strtof(argv[i + 2], NULL);
        imu_correct(v, v);
        printf("%.9g %.9g %.9g\\n", (double)v[0], (double)v[1], (double)v[2]);
    }
    return imu_self_test() ? 0 : 1;
}
"""


def run(folder):
    """Compile the program around the header and give it the readings."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler: install cc")
    (folder / "main.c").write_text(MAIN)
    program = folder / "main"
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror"]
    subprocess.run([compiler, *flags, folder / "main.c", "-o", program], check=True)
    arguments = [str(value) for value in READINGS.ravel()]
    return subprocess.run([program, *arguments], capture_output=True, text=True, check=False)


@pytest.mark.parametrize("calibration", [NANOTESLA, COUNTS], ids=["nT", "counts"])
def test_the_compiled_header_gives_the_field(calibration, tmp_path):
    write_c(calibration, tmp_path / "mag.h", name="imu")
    result = run(tmp_path)
    assert result.returncode == 0
    field = np.array([line.split() for line in result.stdout.splitlines()], dtype=float)
    truth = calibration.correct(READINGS)
    assert np.allclose(field, truth, rtol=0, atol=4e-7 * np.abs(truth).max())
    ours = apply_c(parse_c(tmp_path / "mag.h", name="imu"), READINGS)
    assert np.allclose(field, ours, rtol=0, atol=4e-7 * np.abs(truth).max())


@pytest.mark.parametrize(("right", "wrong"), [("3123.456f", "3123.556f"), ("1.1f", "1.1001f")])
def test_the_self_test_finds_a_wrong_number(right, wrong, tmp_path):
    header = write_c(NANOTESLA, tmp_path / "mag.h", name="imu").path
    text = header.read_text()
    assert right in text
    header.write_text(text.replace(right, wrong, 1))
    assert run(tmp_path).returncode == 1


def test_the_comment_tells_units_and_axes(tmp_path):
    text = write_c(COUNTS, tmp_path / "mag.h").path.read_text()
    assert "field [nT] = matrix @ (raw [counts] - bias), axes m to m" in text
    assert "/* Bias, raw, axes m. */" in text
    assert "#ifndef AGONIC_MAG_H" in text


@pytest.mark.parametrize("name", ["", "2mag", "a b", "mag;", "mag\n"])
def test_a_name_that_c_does_not_take_is_refused(name, tmp_path):
    with pytest.raises(AgonicError, match="identifier"):
        write_c(NANOTESLA, tmp_path / "mag.h", name=name)


def test_another_header_is_refused(tmp_path):
    header = write_c(NANOTESLA, tmp_path / "mag.h", name="imu").path
    with pytest.raises(LogError, match="no mag_b"):
        parse_c(header)
