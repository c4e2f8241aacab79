"""The calibration file: exact, described by its schema, and clear about what is wrong with it."""

import json
from dataclasses import replace

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Validity
from agonic.calibration.chain import Chain
from agonic.calibration.encoding import encode, schema
from agonic.calibration.interference import Interference
from agonic.errors import AgonicError, LogError
from agonic.files.calibration import load, save
from agonic.fit import Fit
from agonic.provenance import Input, Provenance

FLOATS = st.floats(allow_nan=False, allow_infinity=False)
POSITIVE = st.none() | st.floats(min_value=0, allow_infinity=False)
SCALARS = st.none() | st.booleans() | st.integers(-(2**53), 2**53) | FLOATS | st.text()
INPUTS = st.builds(Input, name=st.text(), sha256=st.text(), count=st.integers(0, 2**53))
PROVENANCES = st.builds(
    Provenance,
    inputs=st.lists(INPUTS, max_size=2).map(tuple),
    settings=st.dictionaries(st.text(), SCALARS | st.lists(SCALARS, max_size=3), max_size=3),
    method=st.lists(st.text(), max_size=2).map(tuple),
    parents=st.lists(st.text(), max_size=2).map(tuple),
    software=st.text(),
    created=st.text(),
)


def affine_like(noun, gauge: str, parameters: int, **more):
    """Random calibrations of one kind and gauge, with so many parameters in the covariance."""
    return st.builds(
        noun,
        gauge=st.just(gauge),
        covariance=st.none() | arrays(float, (parameters, parameters), elements=FLOATS),
        **COMMON,
        **more,
    )


COMMON = {
    "bias": arrays(float, 3, elements=FLOATS),
    "matrix": arrays(float, (3, 3), elements=FLOATS),
    "unit_in": st.sampled_from(["nT", "raw"]),
    "model": st.sampled_from(["sphere", "diagonal", "full"]),
    "magnitude": POSITIVE,
    "noise": POSITIVE,
    "sensor": st.text(),
    "device_id": st.none() | st.integers(0, 2**31),
    "latency_s": FLOATS,
    "validity": st.builds(
        Validity,
        largest_reading=st.none() | FLOATS,
        temperature_C=st.none() | st.tuples(FLOATS, FLOATS),
    ),
    "provenance": PROVENANCES,
}
AFFINES = st.one_of(
    affine_like(Affine, "symmetric", 9),
    affine_like(Affine, "triangular", 9),
    affine_like(Affine, "free", 12),
    affine_like(
        Interference,
        "free",
        24,
        sources=st.just(("throttle", "second")),
        coefficients=arrays(float, (3, 4), elements=FLOATS),
        second_sensor=st.none() | st.text(),
    ),
)
ROTATIONS = st.integers(0, 2**32 - 1).map(
    lambda seed: Rotation.from_rotvec(np.random.default_rng(seed).normal(size=3))
)
ALIGNMENTS = st.builds(
    Alignment,
    rotation=ROTATIONS,
    covariance=st.none() | arrays(float, (3, 3), elements=FLOATS),
    provenance=PROVENANCES,
)
CHAINS = st.builds(
    lambda affine, turn, provenance: Chain(steps=(affine, turn), provenance=provenance),
    AFFINES,
    ALIGNMENTS,
    PROVENANCES,
)

AFFINE = Affine(bias=[1.5, -20000.0, 0.1], matrix=np.diag([1.0, 1.1, 0.9]), magnitude=49500.0)
CHAIN = Chain(steps=(AFFINE, Alignment(rotation=Rotation.from_euler("z", 30, degrees=True))))


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return tmp_path_factory.mktemp("calibrations") / "mag.json"


def same(left, right):
    """Equal in every field, to the bit."""
    if isinstance(left, Chain):
        pairs = zip(left.steps, right.steps, strict=True)
        return left.provenance == right.provenance and all(same(a, b) for a, b in pairs)
    if isinstance(left, Rotation):
        return np.array_equal(left.as_quat(), right.as_quat())
    if isinstance(left, Affine | Alignment):
        a, b = vars(left), vars(right)
        return (
            type(left) is type(right) and a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
        )
    return np.array_equal(left, right) if isinstance(left, np.ndarray) else left == right


@pytest.mark.slow
@settings(max_examples=40)
@given(calibration=AFFINES | ALIGNMENTS | CHAINS)
def test_every_number_and_word_survives(file, calibration):
    save(calibration, file)
    restored = load(file)
    assert same(calibration, restored)
    assert encode(restored) == file.read_bytes()


@pytest.mark.parametrize("calibration", [AFFINE, CHAIN, CHAIN.steps[1]])
def test_file_agrees_with_its_schema(calibration):
    jsonschema.validate(json.loads(encode(calibration)), schema())  # which is examined as well


def test_schema_refuses_a_short_bias():
    document = json.loads(encode(AFFINE))
    document["calibration"]["bias"].pop()
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(document, schema())


def test_schema_tells_units():
    affine = schema()["$defs"]["AffineRecord"]["properties"]
    assert "unit_in" in affine["bias"]["description"]
    assert "unit_out" in affine["magnitude"]["description"]


def test_people_can_read_it():
    lines = encode(AFFINE).decode().splitlines()
    assert lines[1] == '  "schema": "agonic/calibration@1",'
    assert lines[2] == '  "equation": "field [nT] = matrix @ (raw [nT] - bias)",'
    assert '    "bias": [1.5, -20000.0, 0.1],' in lines
    assert "      [1.0, 0.0, 0.0]," in lines


def test_text_that_looks_like_rows_is_left_alone(file):
    named = replace(AFFINE, sensor="a [\n  1,\n  2\n] b")
    save(named, file)
    assert load(file).sensor == named.sensor


def test_quaternion_is_scalar_first():
    quarter = Alignment(rotation=Rotation.from_euler("z", 90, degrees=True))
    document = json.loads(encode(quarter))
    assert document["calibration"]["rotation"]["quat_wxyz"] == pytest.approx(
        [0.5**0.5, 0, 0, 0.5**0.5]
    )


def test_numpy_scalars_are_numbers(file):
    settings = {"loss": np.float64(1.5), "rows": np.int64(3), "limits": (np.float32(0.5), 2)}
    provenance = Provenance(settings=settings)
    save(replace(AFFINE, noise=np.float64(12.5), provenance=provenance), file)
    restored = load(file)
    assert restored.noise == 12.5
    assert restored.provenance.settings == {"loss": 1.5, "rows": 3, "limits": [0.5, 2]}


def edited(change):
    document = json.loads(encode(CHAIN))
    change(document, document["calibration"]["steps"][0])
    return json.dumps(document).encode()


def put(key, value):
    return lambda document, affine: affine.__setitem__(key, value)


def turned(*quat_wxyz):
    return edited(lambda d, _: d["calibration"]["steps"][1]["rotation"].update(quat_wxyz=quat_wxyz))


def test_unknown_fields_are_passed_over(file):
    file.write_bytes(edited(put("remark", "made on the roof")))
    assert same(load(file), CHAIN)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "this is empty, and a calibration file is needed"),
        (encode(AFFINE)[:200], "truncated"),
        (b"\x89PNG\r\n\x1a\n\x00\xff", "this is a PNG picture, and a calibration"),
        (b"time_s,mag_x_nT\n0,1\n", "this is a text, as tables of readings are"),
        (b"[1, 2]", "a calibration file is needed"),
        (b'{"schema": "agonic/calibration@1", "x":' + b"[" * 100_000, "recursion"),
        (b'{"bias": [1, 2, 3]}', '"schema": "agonic/calibration@1"'),
        (b'{"schema": "agonic/calibrate@1"}', '"schema": "agonic/calibration@1"'),
        (edited(lambda d, _: d.__setitem__("schema", "agonic/calibration@2")), "newer agonic"),
        (edited(lambda d, _: d.pop("calibration")), "calibration"),
        (edited(put("bias", [1.0, 2.0])), "bias"),
        (edited(put("matrix", [[1, 0, 0], [0, 1, 0]])), "matrix"),
        (edited(put("matrix", [[1, 0, 0], [0, None, 0], [0, 0, 1]])), "matrix[1][1]"),
        (edited(put("covariance", [[1.0] * 9] * 8)), "covariance"),
        (edited(put("kind", "tidal")), "tidal"),
        (edited(put("unit_in", "uT")), "unit_in"),
        (edited(put("frame_out", "c")), "c does not meet m"),
        (encode(AFFINE).replace(b"1.5,", b"NaN,"), "malformed"),
        (encode(AFFINE).replace(b"1.5,", b"1e999,"), "out of range"),
        (turned(0, 0, 0, 0), "norm"),
    ],
)
def test_a_damaged_file_says_what_is_wrong(file, content, says):
    file.write_bytes(content)
    with pytest.raises(LogError) as raised:
        load(file)
    message = str(raised.value)
    assert says in message
    assert str(file) in message
    assert "\n" not in message


def test_a_missing_file(tmp_path):
    with pytest.raises(LogError, match="there is no such file"):
        load(tmp_path / "nothing.json")


def test_a_rounded_quaternion_is_made_a_rotation(file):
    content = edited(
        lambda d, _: d["calibration"]["steps"][1].update(
            rotation={"quat_wxyz": [0.7071, 0, 0, 0.7071]}
        )
    )
    file.write_bytes(content)
    turned = load(file).steps[1].correct([1.0, 0.0, 0.0])
    assert np.allclose(turned, [0.0, 1.0, 0.0], atol=1e-12)


def test_nothing_that_json_cannot_hold_is_lost_silently(tmp_path):
    for chosen in ({"limit": float("nan")}, {"limit": [float("inf")]}, {"when": {1, 2}}):
        with pytest.raises(AgonicError, match="cannot be saved"):
            save(replace(AFFINE, provenance=Provenance(settings=chosen)), tmp_path / "x.json")
    with pytest.raises(AgonicError, match="cannot be saved"):
        save(replace(AFFINE, unit_in="uT"), tmp_path / "x.json")
    assert list(tmp_path.iterdir()) == []


def test_a_fit_is_not_a_calibration(tmp_path):
    with pytest.raises(AgonicError, match=r"fit\.calibration"):
        save(Fit.__new__(Fit), tmp_path / "mag.json")
    with pytest.raises(AgonicError, match="dict was given"):
        save({"bias": [0, 0, 0]}, tmp_path / "mag.json")
