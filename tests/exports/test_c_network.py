"""The C header of a network, compiled: field, domain guard and self-test; and where none can go."""

import ctypes
import re
import shutil
import subprocess
import warnings
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.chain import Chain
from agonic.calibration.interference import Interference
from agonic.calibration.network import Network
from agonic.calibration.setup import Compass, Setup
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError, AgonicWarning
from agonic.exports.c_header import write_c
from agonic.exports.firmware import write_firmware
from agonic.exports.targets import TARGETS
from agonic.exports.targets import write as write_target
from agonic.files.calibration import load, save
from agonic.network.fit import fit_network
from agonic.network.simulate import simulate_nonaffine, simulate_paper
from agonic.reference import Reference
from tests.exports.controller import compiled, library

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler: install cc")

TURN = Alignment(rotation=Rotation.from_euler("zyx", [30, 20, -10], degrees=True), frame_out="b")
SOURCE = """
#include "mag.h"
int correct(const float *raw, const float *beside, float *field);
int test(void);
int correct(const float *raw, const float *beside, float *field)
{
    (void)beside;
    return mag_correct(raw, CALL field);
}
int test(void) { return mag_self_test(); }
"""
STATED = "Error of float32: up to "


@pytest.fixture(scope="module")
def trained() -> dict[str, Network | Chain]:
    """Networks of every kind of base, input and output."""
    made = simulate_nonaffine(n=1500, seed=3)
    hot = Thermal(
        bias=[[120.0, -80.0, 40.0], [30.0, -20.0, 10.0], [4.0, 0.0, -3.0]],
        matrix=[np.eye(3), 0.001 * np.diag([1.0, -2.0, 1.0]), np.zeros((3, 3))],
        centre_C=15.0,
        half_range_C=30.0,
    )
    current = np.sin(np.arange(1500) / 40.0)
    duty = np.abs(np.cos(np.arange(1500) / 55.0))
    aboard = Interference(
        bias=[100.0, -50.0, 20.0],
        matrix=np.eye(3),
        sources=("current_A", "second"),
        coefficients=np.hstack([[[90.0], [-40.0], [10.0]], 0.01 * np.eye(3)]),
    )
    samples = made.samples.with_columns(
        current_A=current,
        second=made.samples.field[:, [1, 2, 0]],
        disturbers={"motor1_duty": duty},
    )

    def fit(**settings) -> Network:
        known = settings.pop("reference", made.reference)
        return fit_network(samples, known, compared=False, restarts=1, **settings).calibration

    length = Reference.magnitude(np.linalg.norm(made.field, axis=1))
    plain = fit(hidden=4)
    return {
        "affine": plain,
        "two layers": fit(hidden=(4, 3)),
        "thermal": fit(base=hot, inputs=("field", "temperature"), hidden=4),
        "thermal alone": fit(base=hot, hidden=3),
        "motor": fit(inputs=("field", "motor1_duty"), hidden=3),
        "aboard": fit(base=aboard, inputs=("field", "current_A"), hidden=3),
        "magnitude": fit(reference=length, target="magnitude", hidden=3),
        "none": fit(base=None, hidden=5, inputs=("field", "temperature")),
        "held": fit(base=hot, inputs=("field", "temperature"), hidden=4).at(20.0),
        "chain": Chain(steps=(plain, TURN)),
        "in a chain": Chain(
            steps=(Affine(bias=[1e3, 0.0, 0.0], matrix=0.5 * np.eye(3)), plain, TURN)
        ),
    }


KINDS = (
    "affine",
    "two layers",
    "thermal",
    "thermal alone",
    "motor",
    "aboard",
    "magnitude",
    "none",
    "held",
    "chain",
    "in a chain",
)


class Header:
    """A compiled header."""

    def __init__(self, calibration, folder: Path) -> None:
        self.text = write_c(calibration, folder / "mag.h", name="mag").path.read_text()
        (folder / "mag.c").write_text(
            SOURCE.replace("CALL", "beside," if "beside[" in self.text else "")
        )
        self.run = library(folder, "mag.c", flags=("-lm",))

    def correct(self, raw: np.ndarray, beside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        field, inside = np.empty((len(raw), 3), dtype=np.float32), np.empty(len(raw), dtype=int)
        pointer = ctypes.POINTER(ctypes.c_float)
        for k, (one, more) in enumerate(zip(raw, beside, strict=True)):
            rows = [np.ascontiguousarray(v, dtype=np.float32) for v in (one, more)]
            inside[k] = self.run.correct(
                *(v.ctypes.data_as(pointer) for v in rows), field[k].ctypes.data_as(pointer)
            )
        return field, inside


def readings(calibration, n: int = 400, spread: float = 1.0) -> tuple[np.ndarray, dict]:
    """Readings about those of the training, and further out, with what is beside them."""
    rng = np.random.default_rng(7)
    raw = rng.normal(size=(n, 3))
    raw *= spread * rng.uniform(0.7, 1.3, (n, 1)) * 50_000.0 / np.linalg.norm(raw, axis=1)[:, None]
    columns = {
        "temperature": rng.uniform(-5.0, 35.0, n),
        "current_A": rng.uniform(-1.0, 1.0, n),
        "motor1_duty": rng.uniform(0.0, 1.0, n),
        "second": 50_000.0 * rng.uniform(-1.0, 1.0, (n, 3)),
    }
    raw = raw.astype(np.float32).astype(float)
    known = {k: v.astype(np.float32).astype(float) for k, v in columns.items()}
    return raw, {name: known[name] for name in calibration.needs}


def flat(columns: dict, n: int) -> np.ndarray:
    return np.column_stack([*columns.values(), np.zeros(n)])


@pytest.mark.parametrize("kind", KINDS)
def test_compiled_field_and_guard_are_those_of_python(kind, trained, tmp_path) -> None:
    calibration = trained[kind]
    header = Header(calibration, tmp_path)
    raw, columns = readings(calibration)
    if kind == "in a chain":
        raw = 2.0 * raw
    field, inside = header.correct(raw, flat(columns, len(raw)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AgonicWarning)
        expected = calibration.correct(raw, **columns)
    stated = float(header.text.split(STATED)[1].split()[0])
    # float32 resolves 50 000 nT to 0.004; readings that stray in x count for their size
    np.testing.assert_allclose(field, expected, rtol=0, atol=max(4 * stated, 0.3))
    network = next(s for s in getattr(calibration, "steps", (calibration,)) if s.kind == "network")
    before = raw if kind != "in a chain" else calibration.steps[0].correct(raw)
    share = network.inside(before, **columns)
    clear = np.abs(share - 0.5) > 1e-3
    assert (inside[clear] == (share[clear] > 0.5)).all()
    assert 0 < inside.mean() < 1


@pytest.mark.parametrize("kind", KINDS)
def test_self_test_passes_and_finds_a_wrong_number(kind, trained, tmp_path) -> None:
    """A number in one of its tables; every table comes in turn."""
    header = Header(trained[kind], tmp_path)
    assert header.run.test() == 1
    tables = ["U", "V", "base", "reach"] if "mag_base" in header.text else ["U", "V"]
    table = tables[KINDS.index(kind) % len(tables)]
    found = re.search(rf"mag_{table}(\[\d+\])*(?: AGONIC_FLASH)? = [{{\s]*([-.\d]+)", header.text)
    assert found
    wrong = f"{1.02 * float(found[2]) + 0.02:.6f}"
    text = header.text[: found.start(2)] + wrong + header.text[found.end(2) :]
    (tmp_path / "wrong.h").write_text(text)
    main = '#include "wrong.h"\nint main(void) { return mag_self_test(); }\n'
    (tmp_path / "wrong.c").write_text(main)
    program = compiled(tmp_path, "wrong.c", flags=("-O0",))
    assert subprocess.run([program], check=False).returncode == 0, table


def test_far_away_only_the_base_is_left(trained, tmp_path) -> None:
    network = trained["affine"]
    header = Header(network, tmp_path)
    raw, _ = readings(network, spread=6.0)
    field, inside = header.correct(raw, np.zeros((len(raw), 1)))
    assert not inside.any()
    np.testing.assert_allclose(field, network.base.correct(raw), rtol=0, atol=0.2)


def test_thermometer_that_fails_leaves_the_base_and_says_so(tmp_path) -> None:
    made = simulate_nonaffine(n=2000, seed=4)
    fit = fit_network(made.samples, made.reference, inputs=("field", "temperature"), compared=False)
    header = Header(fit.calibration, tmp_path)
    raw, _ = readings(fit.calibration, n=20)
    field, inside = header.correct(raw, np.full((20, 1), np.nan))
    assert not inside.any()
    np.testing.assert_allclose(field, fit.base.correct(raw), rtol=0, atol=0.1)


def test_header_states_size_and_error(trained, tmp_path) -> None:
    network = trained["affine"]
    text = write_c(network, tmp_path / "mag.h", name="mag").path.read_text()
    m = 4 * 4 + 3 * 5  # weights of 3-4-3
    count = m + 6 + 4 + 12 + 64 * 3 + 2  # scales, output, base, centres, reach and bound
    assert f"Size: {count} float constants, {4 * count} bytes; 4 calls of tanhf" in text
    assert 0 < float(text.split(STATED)[1].split()[0]) < 0.1


def test_saved_network_is_exported_the_same(trained, tmp_path) -> None:
    first = write_c(trained["thermal"], tmp_path / "a.h").path.read_bytes()
    again = load(save(trained["thermal"], tmp_path / "cal.json"))
    assert write_c(again, tmp_path / "b.h").path.read_bytes() == first


def test_network_without_a_base_is_warned_of(tmp_path) -> None:
    made = simulate_paper(15.0)
    fit = fit_network(made.samples, made.reference, base=None, compared=False)
    written = write_c(fit.calibration, tmp_path / "mag.h", name="mag")
    assert "no base to fall back to" in written.warnings[0]
    assert Header(fit.calibration, tmp_path).run.test() == 1


@pytest.mark.parametrize("target", sorted(set(TARGETS) - {"c"}))
@pytest.mark.parametrize("kind", ["affine", "thermal", "chain"])
def test_other_targets_refuse_it_in_a_sentence(target, kind, trained, tmp_path) -> None:
    with pytest.raises(AgonicError, match="network"):
        write_target(target, trained[kind], tmp_path / "out")
    assert not list(tmp_path.iterdir())


def test_firmware_of_a_setup_refuses_it_in_a_sentence(trained, tmp_path) -> None:
    for kind in ("chain", "thermal"):
        setup = Setup(compasses=(Compass(calibration=trained[kind]),))
        with pytest.raises(AgonicError, match="network"):
            write_firmware(setup, tmp_path / "out", declination=0.0)


def test_steps_that_no_matrix_holds_are_refused(trained, tmp_path) -> None:
    warm = Thermal(
        bias=[[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]],
        matrix=[np.eye(3), np.zeros((3, 3))],
        centre_C=20.0,
        half_range_C=30.0,
    )
    with pytest.raises(AgonicError, match="the base of the network"):
        write_c(Chain(steps=(warm, trained["affine"])), tmp_path / "mag.h")
    with pytest.raises(AgonicError, match="one network"):
        write_c(Chain(steps=(trained["affine"], trained["affine"])), tmp_path / "mag.h")
    with pytest.raises(AgonicError, match="does not change with temperature"):
        write_c(trained["affine"], tmp_path / "mag.h", temperature_C=20.0)
