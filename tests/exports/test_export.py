"""What a target makes of a reading is what the calibration makes of it, read back from the file."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.chain import Chain
from agonic.calibration.interference import Interference
from agonic.errors import AgonicError, FrameError, UnitError
from agonic.exports.ardupilot import compute_ardupilot_parameters
from agonic.exports.banner import format_float32, write_banner
from agonic.exports.convert import reduce, split_rotation, turn_into_frame
from agonic.exports.px4 import compute_px4_parameters
from agonic.exports.targets import TARGETS
from agonic.files.calibration import save
from agonic.provenance import Input, Provenance, hash_file
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


@dataclass(frozen=True)
class Target:
    """How a target reads and applies its file; unit in nT, frame None for any axes."""

    parse: Callable
    apply: Callable
    unit: float
    frame: str | None
    symmetric: bool
    float32: bool


READERS = {
    "ardupilot": Target(parse_ardupilot, apply_ardupilot, 100.0, "b", True, True),
    "px4": Target(parse_px4, apply_px4, 1e5, "m", True, True),
    "motioncal": Target(parse_motioncal, apply_motioncal, 1e3, "m", True, True),
    "ros": Target(parse_ros, apply_ros, 1e9, "m", False, False),
    "matlab": Target(parse_matlab, apply_matlab, 1.0, None, False, False),
    "c": Target(parse_c, apply_c, 1.0, None, False, True),
    "table": Target(parse_table, apply_table, 1.0, None, False, False),
}

SEEDS = st.integers(0, 2**32 - 1)
MOUNTING = Rotation.from_euler("ZYX", [90, 20, -170], degrees=True)


def random_affine(seed, kind, frame="m"):
    """Bias of both signs up to 60 µT an axis, gains 0.6 to 1.6 along any axes."""
    rng = np.random.default_rng(seed)
    axes = Rotation.from_rotvec(rng.normal(size=3)).as_matrix()
    matrix = axes @ np.diag(rng.uniform(0.6, 1.6, 3)) @ axes.T * rng.choice([0.5, 1.0, 2.0])
    if kind == "turned":
        matrix = Rotation.from_rotvec(rng.normal(size=3) * 0.1).as_matrix() @ matrix
    if kind == "triangular":
        matrix = np.linalg.cholesky(matrix @ matrix.T).T
    bias = rng.uniform(-60000, 60000, 3)
    return Affine(bias=bias, matrix=matrix, magnitude=50000.0, frame_in=frame, frame_out=frame)


def readings(seed):
    directions = np.random.default_rng(seed).normal(size=(40, 3))
    return 50000 * directions / np.linalg.norm(directions, axis=1, keepdims=True)


@pytest.mark.parametrize("name", READERS)
@settings(max_examples=25)
@given(
    seed=SEEDS,
    kind=st.sampled_from(["symmetric", "turned", "triangular"]),
    mounted=st.booleans(),
)
def test_the_target_gives_the_calibrated_field(name, tmp_path_factory, seed, kind, mounted):
    target = READERS[name]
    calibration = random_affine(seed, kind)
    if mounted:
        calibration = Chain(steps=(calibration, Alignment(rotation=MOUNTING)))
    export = TARGETS[name].write(
        calibration, tmp_path_factory.getbasetemp() / f"mag{TARGETS[name].suffix}"
    )
    raw = readings(seed)
    truth, readings_seen = calibration.correct(raw), raw
    if mounted and target.frame == "m":
        truth = MOUNTING.inv().apply(truth)
    if mounted and target.frame == "b":
        readings_seen = MOUNTING.apply(raw)
    got = target.apply(target.parse(export.path), readings_seen / target.unit) * target.unit
    if target.symmetric:
        left_out, _ = Rotation.align_vectors(truth, got)
        assert np.degrees(left_out.magnitude()) == pytest.approx(reported_angle(export), abs=0.02)
        got = left_out.apply(got)
    # float32 holds 1e5 nT to 0.004 nT; about ten roundings with gains up to 3.2
    assert np.allclose(got, truth, rtol=0, atol=0.1 if target.float32 else 1e-6)


def reported_angle(export):
    """The rotation that the export says it leaves out, degrees."""
    found = re.search(r"a rotation of ([\d.]+) deg", " ".join(export.warnings))
    return float(found[1]) if found else 0.0


@pytest.mark.parametrize("name", ["ardupilot", "px4"])
@pytest.mark.parametrize("frame", ["m", "b"])
def test_a_given_mounting_carries_between_sensor_and_body(name, frame, tmp_path):
    target = READERS[name]
    calibration = random_affine(7, "symmetric", frame)
    export = TARGETS[name].write(calibration, tmp_path / "mag", rotation_bm=MOUNTING)
    raw = readings(7)
    to_target = {"mb": MOUNTING, "bm": MOUNTING.inv()}.get(
        frame + target.frame, Rotation.identity()
    )
    got = target.apply(target.parse(export.path), to_target.apply(raw) / target.unit) * target.unit
    assert np.allclose(got, to_target.apply(calibration.correct(raw)), rtol=0, atol=0.1)
    assert reported_angle(export) == 0.0
    assert "mounting" not in " ".join(export.warnings)


def test_a_fine_alignment_that_the_target_cannot_hold_is_reported(tmp_path):
    coarse = Rotation.from_euler("z", 90, degrees=True)
    fine = Rotation.from_euler("z", 93, degrees=True)
    chain = Chain(steps=(random_affine(3, "symmetric"), Alignment(rotation=fine)))
    export = TARGETS["ardupilot"].write(chain, tmp_path / "mag.param", rotation_bm=coarse)
    assert reported_angle(export) == pytest.approx(3.0, abs=0.011)


@pytest.mark.parametrize(("name", "says"), [("ardupilot", "taken for"), ("px4", None)])
def test_an_unknown_mounting_is_said(name, says, tmp_path):
    warnings = " ".join(
        TARGETS[name].write(random_affine(1, "symmetric"), tmp_path / "mag").warnings
    )
    assert ("mounting" in warnings) == (says is not None)
    assert says is None or says in warnings


@pytest.mark.parametrize("name", TARGETS)
def test_the_same_calibration_gives_the_same_bytes(name, tmp_path):
    chain = Chain(steps=(random_affine(5, "turned"), Alignment(rotation=MOUNTING)))
    first = TARGETS[name].write(chain, tmp_path / "first").path.read_bytes()
    assert TARGETS[name].write(chain, tmp_path / "second").path.read_bytes() == first


@pytest.mark.parametrize("name", ["ardupilot", "px4", "ros", "c", "table"])
def test_comments_carry_equation_origin_and_warnings(name, tmp_path):
    source = Input(name="flight\n12 µ.bin", sha256="ab" * 32, count=321)
    made = Provenance(
        inputs=(source,), method=("renaudin2010",), software="agonic 9", created="now"
    )
    calibration = replace(random_affine(5, "turned"), provenance=made, sensor="MAG2")
    export = TARGETS[name].write(calibration, tmp_path / "mag")
    text = export.path.read_text()
    assert text.isascii()
    assert "field [nT] = matrix @ (raw [nT] - bias)" in text
    assert "MAG2, agonic 9, now" in text
    assert f"flight 12 \\xb5.bin, 321 rows, SHA-256 {'ab' * 32}" in text
    assert "renaudin2010" in text
    assert all(warning in text for warning in export.warnings)


def test_the_hash_in_a_comment_is_that_of_the_calibration_file(tmp_path):
    calibration = random_affine(5, "turned")
    digest = hash_file(save(calibration, tmp_path / "mag.json"))
    assert any(digest in line for line in write_banner(calibration, ""))


REFUSED = [(name, one) for name in ("ardupilot", "px4", "ros") for one in ("unit_in", "unit_out")]


@pytest.mark.parametrize(("name", "unknown"), [*REFUSED, ("motioncal", "unit_out")])
def test_raw_units_are_refused_where_the_target_has_a_unit(name, unknown, tmp_path):
    calibration = replace(random_affine(2, "symmetric"), **{unknown: "raw"})
    with pytest.raises(UnitError, match="fit again"):
        TARGETS[name].write(calibration, tmp_path / "mag")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["matlab", "c", "table"])
def test_raw_units_are_kept_where_they_can_be(name, tmp_path):
    calibration = Affine(bias=[120, -340, 5], matrix=np.diag([91.0, 93, 88]), unit_in="raw")
    export = TARGETS[name].write(calibration, tmp_path / "mag")
    counts = np.array([[600.0, -300.0, 20.0]])
    got = READERS[name].apply(READERS[name].parse(export.path), counts)
    assert np.allclose(got, [[43680.0, 3720.0, 1320.0]], rtol=1e-6)


def test_mirrored_axes_are_refused_by_symmetric_targets(tmp_path):
    mirrored = Affine(bias=np.zeros(3), matrix=np.diag([1.0, 1.0, -1.0]))
    with pytest.raises(AgonicError, match="mirrors"):
        TARGETS["px4"].write(mirrored, tmp_path / "mag.params")


def test_a_long_chain_reduces_to_one_bias_and_matrix():
    later = replace(random_affine(9, "turned"), frame_in="b", frame_out="b")
    chain = Chain(steps=(random_affine(8, "turned"), Alignment(rotation=MOUNTING), later))
    bias, matrix = reduce(chain)
    raw = readings(8)
    assert np.allclose((raw - bias) @ matrix.T, chain.correct(raw), rtol=0, atol=1e-6)


def test_a_singular_matrix_is_refused():
    with pytest.raises(AgonicError, match="singular"):
        reduce(Affine(bias=np.zeros(3), matrix=np.diag([1.0, 1.0, 0.0])))


def test_other_axes_are_refused():
    with pytest.raises(FrameError):
        turn_into_frame(random_affine(2, "symmetric", "c"), "b", unit="milligauss")


@given(seed=SEEDS)
def test_polar_factors_multiply_to_the_matrix(seed):
    matrix = random_affine(seed, "turned").matrix
    symmetric, rotation = split_rotation(matrix)
    assert np.allclose(rotation.as_matrix() @ symmetric, matrix, atol=1e-12)
    assert np.array_equal(symmetric, symmetric.T)
    assert np.linalg.eigvalsh(symmetric).min() > 0


@given(value=st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_decimals_are_exact_in_float32(value):
    assert np.float32(format_float32(value)) == np.float32(value)


def with_source(source, seed=11, frame="m"):
    """A calibration that takes a current or the throttle into account, 20 to 40 % of the field."""
    plain = random_affine(seed, "symmetric", frame)
    size = {"current_A": 600.0, "throttle": 15_000.0}[source]
    plain_fields = {name: getattr(plain, name) for name in ("bias", "matrix", "magnitude")}
    return Interference(
        **plain_fields,
        frame_in=frame,
        frame_out=frame,
        sources=(source,),
        coefficients=size * np.array([[0.6], [-0.5], [0.7]]),
    )


@pytest.mark.parametrize("name", ["ardupilot", "px4"])
@pytest.mark.parametrize("source", ["current_A", "throttle"])
@pytest.mark.parametrize("mounted", [False, True])
def test_autopilots_take_out_what_motors_add(name, source, mounted, tmp_path):
    target = READERS[name]
    calibration = with_source(source)
    options = {"rotation_bm": MOUNTING} if mounted else {}
    export = TARGETS[name].write(calibration, tmp_path / "mag", **options)
    raw = readings(7)
    x = np.random.default_rng(3).uniform(0, 40 if source == "current_A" else 1, len(raw))
    to_target = MOUNTING if mounted and target.frame == "b" else Rotation.identity()
    got = target.apply(target.parse(export.path), to_target.apply(raw) / target.unit, x=x)
    truth = to_target.apply(calibration.correct(raw, **{source: x}))
    assert np.allclose(got * target.unit, truth, rtol=0, atol=0.1)
    off = calibration.correct(raw, **{source: 0 * x})
    assert np.abs(off - calibration.correct(raw, **{source: x})).max() > 5000
    assert any("all" in w and ("MOTCT" in w or "COMP_TYP" in w) for w in export.warnings)


def test_signs_and_units_of_the_motor_terms():
    """MOT is added to the field, mG per A; COMP to the readings, gauss per kA: both undo K."""
    plain = Interference(
        bias=np.zeros(3),
        matrix=2 * np.eye(3),
        sources=("current_A",),
        coefficients=[[300.0], [0.0], [0.0]],
    )
    arducopter, _ = compute_ardupilot_parameters(plain, compass=2)
    assert arducopter["COMPASS_MOT2_X"] == pytest.approx(-6.0)  # 2 × 3 mG per A
    assert arducopter["COMPASS_MOTCT"] == 2
    px4, _ = compute_px4_parameters(plain, slot=1)
    assert px4["CAL_MAG1_XCOMP"] == pytest.approx(-3.0)  # 3 mG per A = 3 G per kA
    assert px4["CAL_MAG_COMP_TYP"] == 2
    throttle = replace(plain, sources=("throttle",))
    assert compute_ardupilot_parameters(throttle)[0]["COMPASS_MOTCT"] == 1
    assert compute_px4_parameters(throttle)[0]["CAL_MAG_COMP_TYP"] == 1
    assert compute_px4_parameters(throttle)[0]["CAL_MAG0_XCOMP"] == pytest.approx(-0.003)
    assert "COMPASS_MOT_X" not in compute_ardupilot_parameters(random_affine(1, "symmetric"))[0]
    assert "CAL_MAG_COMP_TYP" not in compute_px4_parameters(random_affine(1, "symmetric"))[0]


@pytest.mark.parametrize("name", ["motioncal", "ros", "matlab", "c", "table"])
def test_a_target_without_a_term_for_currents_says_what_stays(name, tmp_path):
    target, calibration = READERS[name], with_source("current_A")
    export = TARGETS[name].write(calibration, tmp_path / "mag")
    raw = readings(7)
    got = target.apply(target.parse(export.path), raw / target.unit) * target.unit
    assert np.allclose(got, calibration.correct(raw, current_A=np.zeros(40)), rtol=0, atol=0.1)
    said = [warning for warning in export.warnings if "current_A" in warning]
    per_ampere = np.linalg.norm(calibration.matrix @ calibration.coefficients)
    assert float(re.search(r"([\d.]+) nT per unit", said[0])[1]) == pytest.approx(
        per_ampere, rel=0.01
    )
    assert "setup" in said[0]


@pytest.mark.parametrize("name", TARGETS)
def test_a_mix_of_two_magnetometers_is_refused(name, tmp_path):
    mix = Interference(
        bias=np.zeros(3), matrix=np.eye(3) / 2, sources=("second",), coefficients=-np.eye(3)
    )
    with pytest.raises(AgonicError, match="second magnetometer"):
        TARGETS[name].write(mix, tmp_path / "mag")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["ardupilot", "px4"])
def test_current_and_throttle_together_are_refused(name, tmp_path):
    both = Interference(
        bias=np.zeros(3),
        matrix=np.eye(3),
        sources=("current_A", "throttle"),
        coefficients=np.ones((3, 2)),
    )
    with pytest.raises(AgonicError, match="one of current and throttle"):
        TARGETS[name].write(both, tmp_path / "mag")
