"""A calibration that changes with temperature, for targets that follow it and for the others."""

import ctypes
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Validity
from agonic.calibration.chain import Chain
from agonic.calibration.interference import Interference
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError, UnitError, ValidityError
from agonic.exports.c_header import write_c
from agonic.exports.matlab import write_matlab
from agonic.exports.px4 import compute_px4_parameters, write_px4
from agonic.exports.table import write_table
from agonic.exports.targets import TARGETS, write
from agonic.exports.temperature import (
    compute_remainder,
    evaluate_affine,
    fit_polynomials,
    hold_temperature,
)
from tests.exports.controller import STRICT, library
from tests.exports.read_back import (
    apply_ardupilot,
    apply_c,
    apply_matlab,
    apply_motioncal,
    apply_px4,
    apply_ros,
    apply_table,
    parse_ardupilot,
    parse_c,
    parse_matlab,
    parse_motioncal,
    parse_px4,
    parse_ros,
    parse_table,
)

RNG = np.random.default_rng(12)
MATRIX = np.array([[1.1, 0.03, -0.02], [0.03, 0.94, 0.05], [-0.02, 0.05, 1.03]])
LOW, HIGH = -12.0, 51.0


def small(size):
    """A symmetric change of the matrix."""
    half = RNG.normal(size=(3, 3)) * size
    return (half + half.T) / 2


WARM = Thermal(
    bias=[[20_000.0, -8000, 3000], [900, -700, 400], [-150, 60, 90], [30, 20, -40]],
    matrix=[MATRIX, small(0.01), small(0.003), small(0.001)],
    centre_C=20.0,
    half_range_C=30.0,
    magnitude=49_000.0,
    sensor="MAG",
    validity=Validity(temperature_C=(LOW, HIGH)),
)
STEADY = replace(WARM, matrix=[MATRIX, *np.zeros((3, 3, 3))])
"""Only the bias changes, as PX4 can hold it."""
MOUNTING = Rotation.from_euler("ZYX", [90, 3, 178], degrees=True)
ABOARD = Chain(  # a vehicle's own iron and motors, found after the chamber
    steps=(
        WARM,
        Alignment(rotation=MOUNTING),
        Interference(
            bias=[-4000.0, 2500, 1000],
            matrix=MATRIX,
            magnitude=48_000.0,
            frame_in="b",
            frame_out="b",
            sources=("current_A",),
            coefficients=[[350.0], [0], [-150.0]],
        ),
    )
)
LEVELS = np.linspace(LOW, HIGH, 64)


def fields(calibration, n=400, seed=3, **columns):
    """Readings of a field of 49 µT in every direction at temperatures over the range."""
    rng = np.random.default_rng(seed)
    wanted = rng.normal(size=(n, 3))
    wanted *= 49_000 / np.linalg.norm(wanted, axis=1, keepdims=True)
    temperature = rng.uniform(LOW, HIGH, n).astype(np.float32).astype(float)
    bias, matrix, _ = evaluate_affine(calibration, temperature)
    raw = np.linalg.solve(matrix, wanted[:, :, None])[:, :, 0] + bias
    return raw, temperature, wanted


# ------------------------------------------------------------------ what all of them rest on


def test_at_each_temperature_a_calibration_is_found_by_probing_it():
    bias, matrix, added = evaluate_affine(WARM, LEVELS)
    assert np.allclose(bias, WARM.bias_at(LEVELS), rtol=0, atol=1e-8)
    assert np.allclose(matrix, WARM.matrix_at(LEVELS), rtol=0, atol=1e-13)
    assert added.shape == (64, 3, 0)
    bias, matrix, added = evaluate_affine(ABOARD, LEVELS)
    for k in (0, 30, 63):
        one = ABOARD.at(LEVELS[k]).composed
        assert np.allclose(bias[k], one.bias, rtol=0, atol=1e-7)
        assert np.allclose(matrix[k], one.matrix, rtol=0, atol=1e-12)
        assert np.allclose(added[k], one.coefficients, rtol=0, atol=1e-7)


def test_polynomials_of_a_thermal_calibration_are_its_own():
    found = fit_polynomials(WARM)
    assert np.allclose(found.bias, WARM.bias, rtol=0, atol=1e-8)
    assert np.allclose(found.matrix, WARM.matrix, rtol=0, atol=1e-13)
    assert (found.low_C, found.high_C, found.clamp_C) == (LOW, HIGH, (LOW - 0.5, HIGH + 0.5))


def test_polynomials_follow_a_chain_whose_bias_is_none():
    found = fit_polynomials(ABOARD)
    assert len(found.bias) > 4
    x = ((LEVELS - found.centre_C) / found.half_range_C)[:, None] ** np.arange(len(found.bias))
    bias, matrix, added = evaluate_affine(ABOARD, LEVELS)
    assert np.abs(x @ found.bias - bias).max() < 2e-3  # nT: below the rounding of float32
    assert np.abs(np.tensordot(x, found.matrix, 1) - matrix).max() < 1e-7
    assert np.abs(np.tensordot(x, found.coefficients, 1) - added).max() < 1e-4


@pytest.mark.parametrize("at", [LOW, 20.0, 47.0])
def test_the_error_of_holding_one_temperature_is_that_of_many_fields(at):
    said = compute_remainder(WARM, at)
    raw, temperature, truth = fields(WARM, n=50_000)
    error = np.linalg.norm(WARM.at(at).correct(raw) - truth, axis=1)
    assert 0.95 * said.largest < error.max() <= said.largest
    assert said.rms == pytest.approx(np.sqrt(np.mean(error**2)), rel=0.03)
    assert abs(temperature[error.argmax()] - said.at_C) < 3.0
    angle = np.degrees(said.largest / 49_000)
    assert said.largest_deg == pytest.approx(angle, rel=0.01)


# ------------------------------------------------------------------ PX4


def px4_autopilot(text, raw_gauss, temperature, slot=0):
    """PX4 in its own float32, after `calc_thermal_offsets_3D` and `Correct`: no code of ours."""
    rows = (line.split() for line in text.splitlines() if line and line[0] != "#")
    of = {name: np.float32(value) for _, _, name, value, _ in rows}
    tc = f"TC_M{slot}_"
    corrected = []
    for raw, warm in zip(raw_gauss.astype(np.float32), temperature.astype(np.float32), strict=True):
        delta = min(max(warm, of[tc + "TMIN"]), of[tc + "TMAX"]) - of[tc + "TREF"]
        v = np.empty(3, np.float32)
        for i, axis in enumerate("XYZ"):
            thermal = of[f"{tc}X0_{i}"] + of[f"{tc}X1_{i}"] * delta
            thermal += of[f"{tc}X2_{i}"] * delta * delta
            thermal += of[f"{tc}X3_{i}"] * delta * delta * delta
            v[i] = raw[i] - of[f"CAL_MAG{slot}_{axis}OFF"] - thermal
        s = {
            name: of[f"CAL_MAG{slot}_{name}"]
            for name in ("XSCALE", "YSCALE", "ZSCALE", "XODIAG", "YODIAG", "ZODIAG")
        }
        corrected.append(
            [
                s["XSCALE"] * v[0] + s["XODIAG"] * v[1] + s["YODIAG"] * v[2],
                s["XODIAG"] * v[0] + s["YSCALE"] * v[1] + s["ZODIAG"] * v[2],
                s["YODIAG"] * v[0] + s["ZODIAG"] * v[1] + s["ZSCALE"] * v[2],
            ]
        )
    assert of["TC_M_ENABLE"] == 1
    return np.array(corrected, dtype=float)


@pytest.mark.parametrize("at", [None, -5.0, 40.0])
def test_px4_takes_off_the_bias_of_any_temperature(at, tmp_path):
    export = write_px4(STEADY, tmp_path / "m.params", device_id=7, slot=1, temperature_C=at)
    raw, temperature, truth = fields(STEADY)
    got = px4_autopilot(export.path.read_text(), raw / 1e5, temperature, slot=1) * 1e5
    assert np.abs(got - truth).max() < 0.1  # nT, roundings of float32
    ours = apply_px4(parse_px4(export.path), raw / 1e5, slot=1, temperature_C=temperature) * 1e5
    assert np.abs(ours - truth).max() < 0.1


def test_px4_leaves_what_the_matrix_does_and_says_how_much(tmp_path):
    export = write_px4(WARM, tmp_path / "m.params", device_id=7)
    raw, temperature, truth = fields(WARM, n=3000)
    got = px4_autopilot(export.path.read_text(), raw / 1e5, temperature) * 1e5
    error = np.linalg.norm(got - truth, axis=1)
    said = next(w for w in export.warnings if w.startswith("PX4 holds the matrix of one"))
    largest, rms = (float(n) for n in re.search(r"up to (\d+) nT .* rms (\d+) nT", said).groups())
    assert 0.93 * largest < error.max() <= largest + 1
    assert rms == pytest.approx(np.sqrt(np.mean(error**2)), rel=0.05)
    bare = re.search(r"not subtracted, the file .* up to (\d+) nT", " ".join(export.warnings))
    unmoved = parse_px4(export.path) | {"TC_M_ENABLE": 0}
    plain = apply_px4(unmoved, raw / 1e5, temperature_C=temperature) * 1e5
    worst = np.linalg.norm(plain - truth, axis=1).max()
    assert 0.93 * float(bare[1]) < worst <= float(bare[1]) + 1


def test_px4_units_signs_and_names():
    parameters, warnings = compute_px4_parameters(STEADY, device_id=2**31 + 5, temperature_C=20.0)
    assert (parameters["TC_M_ENABLE"], parameters["TC_M0_ID"]) == (1, 5 - 2**31)
    assert (parameters["TC_M0_TREF"], parameters["TC_M0_TMIN"], parameters["TC_M0_TMAX"]) == (
        20.0,
        LOW,
        HIGH,
    )
    assert parameters["CAL_MAG0_XOFF"] == pytest.approx(0.2)  # the bias at TREF, gauss
    assert [parameters[f"TC_M0_X0_{i}"] for i in range(3)] == [0.0, 0.0, 0.0]
    assert parameters["TC_M0_X1_0"] == pytest.approx(900 / 1e5 / 30)
    assert parameters["TC_M0_X3_2"] == pytest.approx(-40 / 1e5 / 30**3)
    assert any("renews" in w and "1 C" in w for w in warnings)
    assert not any("dT" in w or "rate" in w for w in warnings)
    lagging = compute_px4_parameters(replace(STEADY, rate=[6000.0, 0, 0]))[1]
    assert any("110 nT for each degree C per minute" in w for w in lagging)
    assert any("CAL_MAG0_ID and TC_M0_ID are" in w for w in lagging)
    assert "TC_M_ENABLE" not in compute_px4_parameters(STEADY.at(20.0))[0]


def test_px4_holds_its_last_temperature_beyond_the_range(tmp_path):
    export = write_px4(STEADY, tmp_path / "m.params", device_id=7)
    raw = np.tile([[30_000.0, 10_000, -20_000]], (4, 1))
    got = px4_autopilot(export.path.read_text(), raw / 1e5, np.array([LOW, -60.0, HIGH, 300.0]))
    assert np.array_equal(got[0], got[1])
    assert np.array_equal(got[2], got[3])


def test_px4_turns_the_offset_into_sensor_axes(tmp_path):
    body = replace(STEADY, frame_in="b", frame_out="b")
    export = write_px4(body, tmp_path / "m.params", device_id=7, rotation_bm=MOUNTING)
    raw, temperature, truth = fields(STEADY)
    there = MOUNTING.inv()
    got = px4_autopilot(export.path.read_text(), there.apply(raw) / 1e5, temperature) * 1e5
    assert np.abs(got - there.apply(truth)).max() < 0.1


def test_px4_fits_a_cubic_to_what_is_none_and_tells_the_rest():
    quintic = replace(
        STEADY,
        bias=np.vstack([STEADY.bias, [[0, 0, 0], [300.0, -200, 0]]]),
        matrix=[MATRIX, *np.zeros((5, 3, 3))],
    )
    parameters, warnings = compute_px4_parameters(quintic, device_id=7)
    raw, temperature, truth = fields(quintic, n=3000)
    got = apply_px4(parameters, raw / 1e5, temperature_C=temperature) * 1e5
    said = float(re.search(r"up to (\d+) nT", warnings[0])[1])
    worst = np.linalg.norm(got - truth, axis=1).max()
    assert 0.93 * said < worst <= said + 1
    assert 5 < worst < 150  # of 360 that the fifth power adds


# ------------------------------------------------------------------ C

MAIN = '#include "mag.h"\nint check(void);\nint check(void) { return mag_self_test(); }\n'


def compiled_header(folder, *, rate):
    """`mag_correct` and the self-test of a header, compiled strictly; a function of columns."""
    assert shutil.which("cc"), "these tests need a C compiler: install cc"
    also = ", rate" if rate else ""
    (folder / "main.c").write_text(
        MAIN + "int apply(const float raw[3], float t, float rate, float field[3]);\n"
        "int apply(const float raw[3], float t, float rate, float field[3])\n"
        f"{{ (void)rate; return mag_correct(raw, t{also}, field); }}\n"
    )
    c = library(folder, "main.c")
    pointer = ctypes.POINTER(ctypes.c_float)
    c.apply.argtypes = [pointer, ctypes.c_float, ctypes.c_float, pointer]

    def apply(raw, temperature, rates):
        out = np.zeros((len(raw), 3), np.float32)
        inside = [
            c.apply(
                np.ascontiguousarray(v, np.float32).ctypes.data_as(pointer),
                t,
                r,
                o.ctypes.data_as(pointer),
            )
            for v, t, r, o in zip(raw, temperature, rates, out, strict=True)
        ]
        return out.astype(float), np.array(inside)

    return apply, c.check


@pytest.mark.parametrize(
    "calibration",
    [
        WARM,
        replace(WARM, rate=[4000.0, -1500, 800]),
        replace(WARM, gauge="free"),
        Chain(
            steps=(
                WARM,
                Alignment(rotation=MOUNTING),
                Affine(bias=[5000.0, -3000, 2000], matrix=MATRIX, frame_in="b", frame_out="b"),
            )
        ),
        replace(WARM, bias=WARM.bias[:1], matrix=WARM.matrix[:1]),
    ],
    ids=["thermal", "rate", "free", "chain", "constant"],
)
def test_the_compiled_header_follows_python_over_the_range(calibration, tmp_path):
    rate = "temperature_rate" in calibration.needs
    export = write_c(calibration, tmp_path / "mag.h")
    assert export.warnings == ()
    apply, check = compiled_header(tmp_path, rate=rate)
    assert check() == 1
    raw, temperature, _ = fields(calibration, n=3000)
    raw = raw.astype(np.float32).astype(float)
    rates = np.random.default_rng(4).uniform(-0.05, 0.05, 3000).astype(np.float32).astype(float)
    columns = {"temperature_rate": rates} if rate else {}
    truth = calibration.correct(raw, temperature=temperature, **columns)
    got, inside = apply(raw, temperature, rates)
    assert inside.all()
    assert np.abs(got - truth).max() < 0.05  # nT: 0.02 measured, some ten roundings of 80 000
    ours = apply_c(
        parse_c(export.path), raw, temperature_C=temperature, rate_C_s=rates if rate else 0.0
    )
    assert np.abs(got - ours).max() < 0.05


def test_beyond_the_range_the_header_keeps_to_the_edge_and_says_so(tmp_path):
    write_c(WARM, tmp_path / "mag.h")
    apply, _ = compiled_header(tmp_path, rate=False)
    levels = np.array([LOW - 0.4, HIGH + 0.4, LOW - 0.6, HIGH + 0.6, 1e30, -1e30, np.nan])
    raw = np.tile([[30_000.0, 10_000, -20_000]], (7, 1))
    got, inside = apply(raw, levels, np.zeros(7))
    assert inside.tolist() == [1, 1, 0, 0, 0, 0, 0]
    low, high = LOW - 0.5, HIGH + 0.5
    near = np.array([LOW - 0.4, HIGH + 0.4, low, high, high, low, low])
    assert np.abs(got - WARM.correct(raw, temperature=near)).max() < 0.05


def test_the_self_test_of_the_header_finds_a_wrong_number(tmp_path):
    header = write_c(WARM, tmp_path / "mag.h").path
    text = header.read_text()
    for right, wrong in (("-150.0f", "-151.0f"), ("0.94f", "0.9401f"), ("{20.0f, 3", "{20.1f, 3")):
        assert right in text
        folder = tmp_path / wrong.strip("{").replace(" ", "")
        folder.mkdir()
        (folder / "mag.h").write_text(text.replace(right, wrong, 1))
        assert compiled_header(folder, rate=False)[1]() == 0


def test_the_header_is_cpp_as_well(tmp_path):
    write_c(replace(WARM, rate=[1.0, 0, 0]), tmp_path / "mag.h")
    (tmp_path / "main.cpp").write_text(
        '#include "mag.h"\nint main() { return !mag_self_test(); }\n'
    )
    subprocess.run(
        ["c++", "-Wall", "-Werror", tmp_path / "main.cpp", "-o", tmp_path / "main"], check=True
    )
    assert subprocess.run([tmp_path / "main"]).returncode == 0
    assert "-Wdouble-promotion" in STRICT


def test_a_header_without_a_term_for_currents_says_what_stays(tmp_path):
    export = write_c(ABOARD, tmp_path / "mag.h")
    assert any("current_A" in w and "setup" in w for w in export.warnings)
    raw, temperature, _ = fields(ABOARD)
    got = apply_c(parse_c(export.path), raw, temperature_C=temperature)
    truth = ABOARD.correct(raw, temperature=temperature, current_A=np.zeros(len(raw)))
    assert np.abs(got - truth).max() < 0.05


# ------------------------------------------------------------------ tables


@pytest.mark.parametrize("rate", [None, [4000.0, -1500, 800]])
def test_matlab_and_table_hold_the_polynomials(rate, tmp_path):
    calibration = replace(WARM, rate=rate)
    raw, temperature, _ = fields(calibration)
    rates = np.random.default_rng(4).uniform(-0.05, 0.05, len(raw))
    columns = {} if rate is None else {"temperature_rate": rates}
    truth = calibration.correct(raw, temperature=temperature, **columns)
    late = 0.0 if rate is None else rates
    mat = parse_matlab(write_matlab(calibration, tmp_path / "m.mat").path)
    got = apply_matlab(mat, raw, temperature_C=temperature, rate_C_s=late)
    assert np.abs(got - truth).max() < 1e-6
    table = parse_table(write_table(calibration, tmp_path / "m.csv").path)
    got = apply_table(table, raw, temperature_C=temperature, rate_C_s=late)
    assert np.abs(got - truth).max() < 1e-6
    assert (table["lowest"][0], table["highest"][0], table["centre"][2]) == (LOW, HIGH, "C")


def test_matlab_also_holds_one_temperature(tmp_path):
    mat = parse_matlab(write_matlab(WARM, tmp_path / "m.mat", temperature_C=31.0).path)
    raw, _, _ = fields(WARM)
    assert mat["temperature_C"].item() == 31.0
    assert np.abs(apply_matlab(mat, raw) - WARM.at(31.0).correct(raw)).max() < 1e-6


@pytest.mark.parametrize("gauge", ["symmetric", "free"])
def test_the_table_has_the_standard_errors_of_the_coefficients(gauge, tmp_path):
    size = (12 if gauge == "free" else 9) * 4 + 3
    sd = np.arange(1.0, size + 1)
    calibration = replace(WARM, gauge=gauge, rate=[1.0, 2, 3], covariance=np.diag(sd**2))
    table = parse_table(write_table(calibration, tmp_path / "m.csv").path)
    for name, error in zip(calibration.parameters, sd, strict=True):
        assert table[name][1] == pytest.approx(error), name
    if gauge == "symmetric":
        assert table["matrix_yx_2"][1] == pytest.approx(table["matrix_xy_2"][1])
    assert table["rate_y"] == (pytest.approx(2.0), pytest.approx(sd[-2]), "nT/(C/s)")


# ------------------------------------------------------------------ one temperature

HELD = {
    "ardupilot": (parse_ardupilot, apply_ardupilot, 100.0),
    "motioncal": (parse_motioncal, apply_motioncal, 1e3),
    "ros": (parse_ros, apply_ros, 1e9),
    "c": (parse_c, apply_c, 1.0),
    "table": (parse_table, apply_table, 1.0),
}


@pytest.mark.parametrize("name", HELD)
def test_a_target_without_temperature_is_held_at_one(name, tmp_path):
    parse, apply, unit = HELD[name]
    export = write(name, WARM, tmp_path / "mag", temperature_C=31.0)
    raw, _, _ = fields(WARM)
    got = apply(parse(export.path), raw / unit) * unit
    assert np.abs(got - WARM.at(31.0).correct(raw)).max() < 0.1
    assert str(compute_remainder(WARM, 31.0)) in export.warnings[0]
    assert export.warnings[0].startswith("held at 31 C: over -12 to 51 C the field is off by")


@pytest.mark.parametrize("name", ["ardupilot", "motioncal", "ros"])
def test_without_a_temperature_they_refuse_in_a_sentence(name, tmp_path):
    with pytest.raises(AgonicError, match=r"--temperature.*within -12 to 51"):
        write(name, WARM, tmp_path / "mag")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", TARGETS)
def test_a_temperature_that_makes_no_sense_is_refused(name, tmp_path):
    with pytest.raises(ValidityError, match="outside -12 to 51"):
        write(name, ABOARD.steps[0], tmp_path / "mag", temperature_C=80.0)
    with pytest.raises(AgonicError, match="does not change with temperature"):
        write(name, WARM.at(20.0), tmp_path / "mag", temperature_C=20.0)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["px4", "ardupilot"])
def test_raw_units_have_no_place(name, tmp_path):
    with pytest.raises(UnitError):
        write(name, replace(WARM, unit_in="raw"), tmp_path / "mag", temperature_C=20.0)


@pytest.mark.parametrize("name", TARGETS)
def test_a_mix_of_two_magnetometers_is_refused(name, tmp_path):
    mix = Interference(
        bias=np.zeros(3), matrix=np.eye(3), sources=("second",), coefficients=-np.eye(3)
    )
    with pytest.raises(AgonicError, match="second magnetometer"):
        write(name, Chain(steps=(WARM, mix)), tmp_path / "mag", temperature_C=20.0)
    with pytest.raises(AgonicError, match=r"second magnetometer|--temperature"):
        write(name, Chain(steps=(WARM, mix)), tmp_path / "mag")


@pytest.mark.parametrize("name", ["ardupilot", "px4", "ros", "c", "table"])
def test_comments_are_plain_and_name_the_calibration(name, tmp_path):
    at = 20.0 if name in ("ardupilot", "ros") else None
    text = write(name, WARM, tmp_path / "mag", temperature_C=at).path.read_text()
    assert text.isascii()
    assert "matrix(T) @ (raw [nT] - bias(T)), polynomials of order 3 in x = (T [deg C]" in text
    assert "\\xb0" not in text


def test_a_plain_calibration_is_held_as_it_is():
    plain = Affine(bias=[1, 2, 3], matrix=MATRIX)
    assert hold_temperature(plain, None) == (plain, ())
