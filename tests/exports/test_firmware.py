"""The generated C against the chain in Python: any attitude, any setup, recorded flights."""

import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.calibration.base import Validity
from agonic.calibration.deviation import Deviation
from agonic.calibration.interference import Interference
from agonic.calibration.setup import Compass, Setup
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError
from agonic.exports.firmware import DeclinationGrid, declination_grid, prediction, write_firmware
from agonic.exports.firmware.plan import Plan
from agonic.exports.firmware.prediction import predict
from agonic.exports.firmware.selftest import draw_attitudes, make_known_readings
from agonic.headings.compute import heading
from agonic.maths.rotations.attitude import rot_nb
from tests.exports.controller import STRICT, Controller, compiled

MATRIX = np.array([[1.1, 0.03, -0.02], [0.03, 0.94, 0.05], [-0.02, 0.05, 1.03]])
MOUNTED = ag.alignment.Alignment(rotation=Rotation.from_euler("ZYX", [90, 3, 178], degrees=True))
DIP = np.radians(66.0)
FIELD_N = 49_000 * np.array([np.cos(DIP), 0.0, np.sin(DIP)])  # magnetic north, east, down
HARD = Compass(  # hard iron several times the field
    calibration=ag.Affine(
        bias=[130_000.0, -90_000, 40_000],
        matrix=MATRIX,
        magnitude=49_000.0,
        sensor="MAG1",
        frame_in="b",
        frame_out="b",
    ),
    deviation=Deviation(coefficients=[1.0, 12, 8, 5, 1.5], heel=[-0.07, 0.02, 0.03, -0.04]),
)
COUNTS = Compass(  # counts, a mounting, two sources
    calibration=ag.Chain(
        steps=(
            Interference(
                bias=[12.0, -40, 7],
                matrix=MATRIX * 90,
                unit_in="raw",
                magnitude=49_000.0,
                sensor="MAG2",
                sources=("throttle", "second"),
                coefficients=np.array([[30.0, 0.2, 0, 0], [-9, 0, -0.1, 0], [55, 0, 0.05, 0.3]]),
            ),
            MOUNTED,
        )
    )
)
MOTORS = Compass(
    calibration=Interference(
        bias=[900.0, 0, -3000],
        matrix=MATRIX,
        magnitude=49_000.0,
        sensor="MAG3",
        frame_in="b",
        frame_out="b",
        sources=("current_A",),
        coefficients=[[600.0], [0], [-450.0]],
    ),
    latency_s=0.014,
)
QUAD = Compass(
    calibration=Interference(
        bias=[-700.0, 300, 2000],
        matrix=MATRIX,
        magnitude=49_000.0,
        sensor="MAG6",
        frame_in="b",
        frame_out="b",
        sources=("motor1_duty^1.5", "esc2_A+esc3_A", "heater_W>0.5", "motor1_duty"),
        coefficients=[[4000.0, 20, 900, 10], [-3000.0, 5, 0, -30], [0, -12, 800, 0]],
    ),
)
WARM = Thermal(  # hysteresis as well
    bias=[[20_000.0, -8000, 3000], [900, -700, 400], [-150, 60, 90], [30, 20, -40]],
    matrix=[MATRIX, 0.02 * MATRIX, 0.004 * np.eye(3), [[0, 1e-3, 0], [1e-3, 0, 0], [0, 0, 2e-3]]],
    centre_C=20.0,
    half_range_C=30.0,
    rate=[4000.0, -1500, 800],
    magnitude=49_000.0,
    sensor="MAG4",
    validity=Validity(temperature_C=(-12.0, 51.0)),
)
CHAMBER = Compass(calibration=ag.Chain(steps=(WARM, MOUNTED)), deviation=HARD.deviation)
ABOARD = Compass(  # calibrated in a chamber, then on board, where bias and motors come after
    calibration=ag.Chain(
        steps=(
            replace(WARM, rate=None, sensor="MAG5", validity=Validity(temperature_C=(0.0, 40.0))),
            MOUNTED,
            Interference(
                bias=[-4000.0, 2500, 1000],
                matrix=MATRIX,
                magnitude=49_000.0,
                frame_in="b",
                frame_out="b",
                sources=("current_A", "motor1_duty^2"),
                coefficients=[[350.0, 1000], [0, -500], [-150.0, 700]],
            ),
        )
    )
)
FELT = ag.Affine(
    bias=[0.4, -0.2, 0.3],
    matrix=[[0.02, 1.01, -0.03], [-0.99, 0.01, 0.02], [0.01, 0.03, 1.02]],
    unit_in="m/s2",
    unit_out="m/s2",
    gauge="free",
)
GRID = declination_grid((45.0, 56.0), (-3.0, 17.0), "2026-05-01")
DATE_LINE = declination_grid((-49.9, -30.3), (165.1, -160.7), "2026-05-01")
SETUPS = {
    "one": (Setup(compasses=(HARD,)), -123.4),
    "inclinometer": (Setup(compasses=(HARD,), tilt_order="pitch-roll"), 2.5),
    "accelerometer": (Setup(compasses=(HARD,), tilt="accelerometer"), 2.5),
    "calibrated": (Setup(compasses=(HARD,), tilt="accelerometer", accelerometer=FELT), 2.5),
    "counts": (Setup(compasses=(COUNTS,), tilt="gyro", horizontal=19e3, vertical=45e3), GRID),
    "level": (Setup(compasses=(MOTORS,), tilt="level", horizontal=19_930.0, vertical=44_764.0), 0),
    "chamber": (Setup(compasses=(replace(CHAMBER, deviation=None),), tilt="level"), -3.0),
    "aboard": (Setup(compasses=(MOTORS, ABOARD, CHAMBER), horizontal=19e3, vertical=45e3), GRID),
    "motors": (Setup(compasses=(QUAD, MOTORS), tilt="log"), 4.0),
    "three": (Setup(compasses=(MOTORS, COUNTS, HARD), tilt="log", tilt_limit_deg=60), DATE_LINE),
}


def inputs_of(plan):
    """The members of the C input, in order."""
    tilt = {"angles": ("roll_deg", "pitch_deg"), "acceleration": ("acceleration",), "level": ()}
    where = (
        ("latitude_deg", "longitude_deg") if isinstance(plan.declination, DeclinationGrid) else ()
    )
    sources = [prediction.MEMBERS.get(name, name) for name in plan.columns]
    warm = ("temperature_C",) if plan.warm else ()
    return ("raw", *tilt[plan.tilt], *sources, *warm, *where)


def apart(a, b):
    return np.abs((a - b + 180) % 360 - 180)


@pytest.fixture(scope="module", params=SETUPS)
def firmware(request, tmp_path_factory):
    """A plan, the folder of its C, and what was said."""
    setup, declination = SETUPS[request.param]
    folder = tmp_path_factory.mktemp(request.param)
    written = write_firmware(setup, folder, declination=declination)
    return Plan(setup=setup, declination=declination), folder, written


def test_the_self_test_passes_and_the_c_is_clean(firmware):
    _, folder, written = firmware
    assert written.files == tuple(
        folder / f"compass{end}"
        for end in (
            *(".h", ".c", "_selftest.c", "_fit.h", "_fit.c"),
            *("_ellipsoid.h", "_ellipsoid.c"),
            *(("_watch.h", "_watch.c") if "two" in str(folder) else ()),
        )
    )
    sources = [path.name for path in written.files if path.suffix == ".c"]
    program = compiled(folder, *sources, flags=("-Os", "-DCOMPASS_MAIN"))
    done = subprocess.run([program], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "compass: 40 known readings, 0 wrong\n")


def test_c_gives_what_python_gives_for_any_attitude(firmware):
    plan, folder, _ = firmware
    inputs = make_known_readings(plan, count=5000, seed=3)
    c = Controller(folder, inputs_of(plan), compasses=len(plan.calibrations))
    got, expected = c.heading(**inputs), predict(plan, inputs)
    for name in ("compass_deg", "magnetic_deg", "declination_deg", "true_deg"):
        assert apart(got[name], getattr(expected, name)).max() < 0.01, name
    assert np.abs(got["field"] - expected.field).max() < 0.1  # nT, ten roundings of 170 000
    assert np.abs(got["inclination_deg"] - expected.inclination_deg).max() < 0.05  # flat at 90
    sure = np.abs(expected.disturbance - 1) > 1e-4
    assert (got["used"] == expected.used)[sure].all()
    assert (got["status"] == expected.status)[sure].mean() > 0.999  # but for readings on a limit


def test_a_temperature_out_of_range_is_flagged_and_held_at_the_edge(tmp_path):
    """Python extrapolates with a warning; a controller must not let a cubic run away."""
    setup = Setup(compasses=(replace(ABOARD, calibration=ag.Chain(steps=(WARM, MOUNTED))),))
    write_firmware(setup, tmp_path, declination=0)
    c = Controller(
        tmp_path,
        (
            "raw",
            "roll_deg",
            "pitch_deg",
            "temperature_rate_C_s",
            "temperature_C",
        ),
    )
    levels = np.array([-12.4, 51.4, -12.6, -300.0, 51.6, 900.0, np.nan])
    raw = np.tile(np.array([30_000.0, -20_000, 25_000]), (7, 1, 1))
    still = dict.fromkeys(("roll_deg", "pitch_deg"), np.zeros(7))
    got = c.heading(
        raw=raw, temperature_C=levels[:, None], temperature_rate_C_s=np.zeros((7, 1)), **still
    )
    flagged = (got["status"].astype(int) & prediction.Status.TEMPERATURE) > 0
    assert flagged.tolist() == [False, False, True, True, True, True, True]
    near = np.array([-12.4, 51.4, -12.5, -12.5, 51.5, 51.5, -12.5])
    truth = MOUNTED.rotation.apply(WARM.correct(raw[:, 0], temperature=near))
    assert np.abs(got["field"] - truth).max() < 0.1
    extrapolated = WARM.bias_at(900.0) - WARM.bias_at(51.5)
    assert np.linalg.norm(extrapolated) > 100_000


def test_temperature_matters_and_float_follows_it(tmp_path):
    """Each number is a polynomial: with the temperature of another, the heading is elsewhere."""
    write_firmware(Setup(compasses=(CHAMBER,)), tmp_path, declination=0)
    plan = Plan(setup=Setup(compasses=(CHAMBER,)), declination=0.0)
    inputs = make_known_readings(plan, count=3000, seed=4)
    c = Controller(tmp_path, inputs_of(plan))
    right, expected = c.heading(**inputs), predict(plan, inputs)
    assert np.abs(right["field"] - expected.field).max() < 0.1
    wrong = c.heading(**inputs | {"temperature_C": np.full_like(inputs["temperature_C"], 20.0)})
    assert np.median(apart(wrong["compass_deg"], right["compass_deg"])) > 0.2


def test_the_headings_are_those_of_rotations_built_independently(tmp_path):
    """No code shared with the generator: SciPy turns the field, the C turns it back."""
    write_firmware(Setup(compasses=(replace(HARD, deviation=None),)), tmp_path, declination=7.0)
    rng = np.random.default_rng(8)
    roll, pitch, yaw = draw_attitudes(rng, 3000).T
    turn = Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, roll]), degrees=True)
    raw = turn.inv().apply(FIELD_N) @ np.linalg.inv(MATRIX).T + HARD.calibration.bias
    c = Controller(tmp_path, ("raw", "roll_deg", "pitch_deg"))
    got = c.heading(raw=raw[:, None], roll_deg=roll, pitch_deg=pitch)
    assert apart(got["magnetic_deg"], yaw).max() < 0.01
    assert apart(got["true_deg"], yaw + 7).max() < 0.01
    assert np.abs(got["inclination_deg"] - 66).max() < 0.01
    assert not got["status"].any()


def test_both_orders_of_tilt_are_their_own_rotations(tmp_path):
    turn = Rotation.from_euler("ZXY", [[201.0, 35.0, -50.0]], degrees=True)  # heading, roll, pitch
    raw = turn.inv().apply(FIELD_N)
    plain = Compass(calibration=ag.Affine(bias=np.zeros(3), matrix=np.eye(3)))
    write_firmware(Setup(compasses=(plain,), tilt_order="pitch-roll"), tmp_path, declination=0)
    c = Controller(tmp_path, ("raw", "roll_deg", "pitch_deg"))
    got = c.heading(raw=raw[:, None], roll_deg=[35.0], pitch_deg=[-50.0])
    assert apart(got["compass_deg"], 201.0).max() < 0.01


def test_down_as_a_vector_needs_no_angles(tmp_path):
    write_firmware(
        Setup(compasses=(replace(HARD, deviation=None),), tilt="accelerometer"),
        tmp_path,
        declination=0,
    )
    roll, pitch, yaw = draw_attitudes(np.random.default_rng(2), 500, largest_tilt_deg=79).T
    turn = rot_nb(roll, pitch, yaw)
    raw = np.einsum("nij,i->nj", turn, FIELD_N) @ np.linalg.inv(MATRIX).T + HARD.calibration.bias
    force = -9.81 * turn[:, 2]
    force[0] *= 1.2
    c = Controller(tmp_path, ("raw", "acceleration"))
    got = c.heading(raw=raw[:, None], acceleration=force)
    assert apart(got["compass_deg"], yaw).max() < 0.01
    assert got["status"][0] == prediction.Status.ACCELERATED
    assert not got["status"][1:].any()


@pytest.fixture(scope="module")
def plain(tmp_path_factory) -> Controller:
    """A compass that needs no correction, at a known place."""
    folder = tmp_path_factory.mktemp("plain")
    setup = Setup(
        compasses=(Compass(calibration=ag.Affine(bias=np.zeros(3), matrix=np.eye(3))),),
        horizontal=float(FIELD_N[0]),
        vertical=float(FIELD_N[2]),
    )
    write_firmware(setup, folder, declination=0)
    return Controller(folder, ("raw", "roll_deg", "pitch_deg"))


@pytest.mark.parametrize(
    ("wrong", "status"),
    [
        ({"scale": 1.2}, prediction.Status.DISTURBED),
        ({"roll": 81.0}, prediction.Status.STEEP),
        ({"dip": 89.0}, prediction.Status.DISTURBED | prediction.Status.VERTICAL),
        ({"dip": 50.0}, prediction.Status.DISTURBED),
        ({"nan": True}, prediction.Status.DISTURBED | prediction.Status.VERTICAL),
    ],
)
def test_what_makes_a_heading_meaningless_is_flagged(wrong, status, plain):
    dip, roll = np.radians(wrong.get("dip", 66.0)), wrong.get("roll", 10.0)
    field_n = 49_000 * wrong.get("scale", 1.0) * np.array([np.cos(dip), 0, np.sin(dip)])
    raw = rot_nb(np.array(roll), np.array(5.0), np.array(200.0)).T @ field_n
    if wrong.get("nan"):
        raw[1] = np.nan
    got = plain.heading(raw=raw[None, None], roll_deg=[roll], pitch_deg=[5.0])
    assert got["status"].tolist() == [status]
    assert np.isfinite(got["true_deg"][0]) != bool(wrong.get("nan"))


@pytest.mark.parametrize(
    ("place", "outside"),
    [
        ((50.0, 5.0), False),
        ((45.0, -3.0), False),
        ((56.0, 17.0), False),
        ((44.0, 5.0), True),
        ((57.0, 5.0), True),
        ((50.0, -4.0), True),
        ((50.0, 18.0), True),
        ((50.0, 190.0), True),
        ((50.0, 365.0), False),
        ((float("nan"), 5.0), True),
        ((50.0, float("nan")), True),
    ],
)
def test_beyond_the_grid_the_nearest_edge_counts_and_is_flagged(place, outside, tmp_path_factory):
    folder = tmp_path_factory.getbasetemp() / "grid"
    if not folder.exists():
        write_firmware(Setup(compasses=(replace(HARD, deviation=None),)), folder, declination=GRID)
    names = ("raw", "roll_deg", "pitch_deg", "latitude_deg", "longitude_deg")
    raw = FIELD_N @ np.linalg.inv(MATRIX).T + HARD.calibration.bias
    level = {"roll_deg": [0.0], "pitch_deg": [0.0]}
    latitude, longitude = place
    got = Controller(folder, names).heading(
        raw=raw[None, None], latitude_deg=[latitude], longitude_deg=[longitude], **level
    )
    assert bool(got["status"][0]) == outside
    east = np.nan_to_num(longitude, nan=-3.0)
    east = 17.0 if 17 < east < 187 else (east + 180) % 360 - 180
    near = np.clip(np.nan_to_num(latitude, nan=45.0), 45, 56), np.clip(east, -3, 17)
    model = ag.wmm().at(*near, 0.0, "2026-05-01").declination_deg
    assert got["declination_deg"][0] == pytest.approx(float(model), abs=0.1)


@pytest.mark.parametrize("tolerance", [0.5, 0.05])
@pytest.mark.parametrize("west_east", [(165.0, -160.0), (-180.0, 180.0), (0.0, 20.0)])
def test_a_table_follows_the_model_between_its_nodes(west_east, tolerance):
    grid = declination_grid((-45.0, 50.0), west_east, "2026-05-01", tolerance_deg=tolerance)
    rng = np.random.default_rng(5)
    width = (west_east[1] - west_east[0]) % 360 or 360
    latitude = rng.uniform(-45, 50, 4000)
    longitude = (west_east[0] + rng.uniform(0, width, 4000) + 180) % 360 - 180
    found, outside = grid.at(latitude, longitude)
    model = ag.wmm().at(latitude, longitude, 0.0, "2026-05-01").declination_deg
    assert not outside.any()
    assert apart(found, model).max() < 1.2 * tolerance
    assert tolerance / 20 < grid.error_deg <= tolerance


def test_a_box_that_no_table_can_follow_names_the_place():
    with pytest.raises(AgonicError, match=r"latitude 8\d, longitude 1"):
        declination_grid((70.0, 90.0), (100.0, 180.0), "2026-05-01")


@pytest.mark.parametrize(
    ("latitudes", "longitudes"),
    [((50, 40), (0, 20)), ((40, 95), (0, 20)), ((40, 50), (5, 5)), ((40, float("nan")), (0, 9))],
)
def test_a_box_without_area_is_refused(latitudes, longitudes):
    with pytest.raises(AgonicError, match="not a box"):
        declination_grid(latitudes, longitudes, "2026-05-01")


def test_of_several_compasses_the_first_undisturbed_is_used(tmp_path):
    two = (HARD.calibration, replace(HARD.calibration, sensor="MAG2"))
    write_firmware(
        Setup(compasses=tuple(Compass(calibration=c) for c in two)), tmp_path, declination=0
    )
    factors = [(1, 1), (1.3, 1), (1, 1.3), (1.3, 1.2), (1.2, 1.3), (np.nan, 1), (np.nan, np.nan)]
    raw = [
        [f * FIELD_N @ np.linalg.inv(MATRIX).T + HARD.calibration.bias for f in pair]
        for pair in factors
    ]
    level = dict.fromkeys(("roll_deg", "pitch_deg"), np.zeros(len(factors)))
    c = Controller(tmp_path, ("raw", "roll_deg", "pitch_deg"), compasses=2)
    got = c.heading(raw=np.array(raw), **level)
    assert got["used"].tolist() == [0, 1, 0, 1, 0, 1, 0]
    assert ((got["status"].astype(int) & prediction.Status.DISTURBED) > 0).tolist() == [
        False,
        False,
        False,
        True,
        True,
        False,
        True,
    ]


def test_a_wrong_constant_fails_the_self_test(tmp_path):
    write_firmware(Setup(compasses=(HARD,)), tmp_path, declination=2.5)
    source = tmp_path / "compass.c"
    text = source.read_text()
    for right, wrong in (("12.0f", "12.1f"), ("0.94f", "0.941f"), ("return 2.5f", "return 2.6f")):
        assert right in text
        source.write_text(text.replace(right, wrong, 1))
        program = compiled(tmp_path, "compass.c", "compass_selftest.c", flags=("-DCOMPASS_MAIN",))
        done = subprocess.run([program], capture_output=True, text=True)
        assert done.returncode == 1
        assert int(re.search(r"(\d+) wrong", done.stdout)[1]) > 20


def test_single_precision_only_no_variables_and_nothing_but_math_h(firmware):
    plan, _, written = firmware
    for path in written.files:
        text = re.sub(r"/\*.*?\*/", "", path.read_text(), flags=re.DOTALL)
        text = re.sub(r"#ifdef __AVR__.*?#else", "", text, flags=re.DOTALL)  # its flash
        kept = text.split("#ifdef COMPASS_MAIN")[0]
        assert "double" not in kept
        assert not re.search(r"\d\.\d+(e[-+]?\d+)?(?![\dfe])", kept), "a constant in double"
        assert set(re.findall(r"#include <(.*)>", kept)) <= {"math.h"}
        assert not re.search(r"\b(malloc|calloc|alloca|free)\b", kept)
        assert path.read_text().isascii()
        assert not re.search(r"[ \t]$", path.read_text(), re.MULTILINE)
    if shutil.which("size"):
        watched = {"compass_watch.c"} if plan.watched else set()
        always = {"compass.c", "compass_fit.c", "compass_ellipsoid.c"}
        assert set(written.sizes) == always | watched
        for size in written.sizes.values():
            assert size.variables == 0
            assert 300 < size.code < 10_000
        assert written.sizes["compass.c"].constants >= 4 * (plan.constants - 9)


@pytest.mark.slow
def test_two_setups_live_in_one_cpp_program(tmp_path):
    for name in ("boat", "car"):
        write_firmware(Setup(compasses=(HARD,)), tmp_path, name=name, declination=2.5)
    main = "".join(f'#include "{n}{part}.h"\n' for n in ("boat", "car") for part in ("", "_fit"))
    main += "int main(void) { return boat_self_test() + car_self_test(); }\n"
    (tmp_path / "main.cpp").write_text(main)
    objects = []
    for name in ("boat", "boat_selftest", "boat_fit", "car", "car_selftest", "car_fit"):
        objects.append(tmp_path / f"{name}.o")
        subprocess.run(["cc", *STRICT, "-c", tmp_path / f"{name}.c", "-o", objects[-1]], check=True)
    command = ["c++", "-Wall", "-Werror", tmp_path / "main.cpp", *objects, "-lm"]
    subprocess.run([*command, "-o", tmp_path / "main"], check=True)
    assert subprocess.run([tmp_path / "main"]).returncode == 0


def test_the_files_tell_their_origin(firmware):
    plan, _, written = firmware
    for path in written.files[:3]:
        text = path.read_text()
        for compass in plan.setup.compasses:
            assert f"Calibration of magnetometer {compass.sensor}" in text
        assert text.count("SHA-256 of the calibration file") == len(plan.calibrations)
        if isinstance(plan.declination, DeclinationGrid):
            assert "WMM2025 on 2026-05-01" in text
        else:
            assert f"Declination: {plan.declination:g} deg everywhere" in text


def test_what_the_controller_cannot_know_is_said(tmp_path):
    unknown = Compass(calibration=ag.Affine(bias=np.zeros(3), matrix=np.eye(3)), latency_s=0.02)
    written = write_firmware(
        Setup(compasses=(unknown,), tilt="accelerometer"), tmp_path, declination=0
    )
    said = " ".join(written.warnings)
    for words in ("disturbances will not be noticed", "20 ms late", "sensor axes", "at rest only"):
        assert words in said


def test_bad_input_is_refused(tmp_path):
    setup = Setup(compasses=(HARD,))
    with pytest.raises(AgonicError, match="needs a declination"):
        write_firmware(setup, tmp_path / "x")
    with pytest.raises(AgonicError, match="identifier"):
        write_firmware(setup, tmp_path / "x", name="my compass", declination=0)
    flat = ag.Affine(bias=np.zeros(3), matrix=np.diag([1.0, 1, 0]))
    with pytest.raises(AgonicError, match="singular"):
        write_firmware(Setup(compasses=(Compass(calibration=flat),)), tmp_path / "x", declination=0)
    assert not (tmp_path / "x").exists()


@pytest.mark.recordings
def test_a_recorded_flight(recordings, tmp_path):
    """Three compasses of a quadrotor, 84 to 236 s: the same headings as `heading` gives."""
    log = recordings / "vehicle" / "ardupilot" / "log171.bin"
    own = [ag.read(log, sensor) for sensor in ("MAG", "MAG2")]
    time = own[0].time
    rows = [(s.time > time[0] + 84) & (s.time < time[0] + 236) for s in own]
    samples = [s.select(r) for s, r in zip(own, rows, strict=True)]
    card = Deviation(coefficients=[0.5, 3, -2, 1, 0.4], heel=[-0.05, 0, 0.02, 0])
    motors = Interference(
        bias=samples[1].logged.bias,
        matrix=samples[1].logged.matrix,
        sensor="MAG2",
        frame_in="b",
        frame_out="b",
        sources=("current_A",),
        coefficients=[[300.0], [0], [-500.0]],
    )
    plain = ag.Affine(
        bias=samples[0].logged.bias,
        matrix=samples[0].logged.matrix,
        sensor="MAG",
        frame_in="b",
        frame_out="b",
    )
    there = ag.igrf().at(-35.3624, 149.1651, 600.0, "2015-11-21")
    setup = Setup(
        compasses=(Compass(calibration=plain, deviation=card), Compass(calibration=motors)),
        tilt="log",
        declination_deg=float(there.declination_deg),
        horizontal=float(there.horizontal),
        vertical=float(there.down),
    )
    for sensor, (compass, one) in enumerate(zip(setup.compasses, samples, strict=True)):
        alone = replace(setup, compasses=(compass,))
        folder = tmp_path / str(sensor)
        write_firmware(alone, folder)
        plan = Plan(setup=alone, declination=setup.declination_deg)
        c = Controller(folder, inputs_of(plan))
        got = c.heading(
            raw=one.field[:, None],
            roll_deg=one.roll_deg,
            pitch_deg=one.pitch_deg,
            current_A=one.current_A,
        )
        expected = heading(one, alone, smooth=False)
        assert len(one) > 1400
        assert apart(got["true_deg"], expected.true_deg).max() < 0.01
        assert apart(got["compass_deg"], expected.compass_deg).max() < 0.01
        disturbed = (got["status"].astype(int) & prediction.Status.DISTURBED) > 0
        # a log shows what a row by itself does not: that it lies inside a disturbance
        assert (disturbed & ~expected.flags["disturbed"]).mean() < 0.001
        assert (disturbed == expected.flags["disturbed"]).mean() > 0.99


def test_python_headings_and_firmware_agree_on_which_compass_to_believe(tmp_path):
    """The same readings through `ag.heading` and the C, with one sensor disturbed at times."""
    rng = np.random.default_rng(4)
    n = 800
    roll, pitch, yaw = draw_attitudes(rng, n).T
    field_b = np.einsum("nij,i->nj", rot_nb(roll, pitch, yaw), FIELD_N)
    calibrations = [HARD.calibration, replace(HARD.calibration, sensor="MAG2")]
    pushes = rng.normal(0, 4000, (2, n, 3))
    raw = [(field_b + p) @ np.linalg.inv(MATRIX).T + HARD.calibration.bias for p in pushes]
    setup = Setup(
        compasses=tuple(Compass(calibration=c) for c in calibrations),
        tilt="log",
        horizontal=float(FIELD_N[0]),
        vertical=float(FIELD_N[2]),
        declination_deg=-8.0,
    )
    samples = [
        ag.Samples(
            field=r, time=np.arange(n), roll_deg=roll, pitch_deg=pitch, name=c.sensor, frame="b"
        )
        for r, c in zip(raw, calibrations, strict=True)
    ]
    expected = heading(samples, setup, smooth=False)
    write_firmware(setup, tmp_path)
    c = Controller(tmp_path, ("raw", "roll_deg", "pitch_deg"), compasses=2)
    got = c.heading(raw=np.stack(raw, axis=1), roll_deg=roll, pitch_deg=pitch)
    same = got["used"] == expected.used
    assert same.mean() > 0.995
    assert {0, 1} == set(expected.used)
    assert apart(got["true_deg"], expected.true_deg)[same].max() < 0.01
    disturbed, steep = (
        (got["status"].astype(int) & bit) > 0
        for bit in (prediction.Status.DISTURBED, prediction.Status.STEEP)
    )
    assert (disturbed & ~expected.flags["disturbed"]).mean() < 0.005
    assert (disturbed == expected.flags["disturbed"]).mean() > 0.99
    assert (steep == expected.flags["tilted"]).mean() > 0.995
    assert all(rows.any() for rows in (disturbed, ~disturbed))


@pytest.mark.slow
def test_the_same_setup_gives_the_same_bytes(tmp_path):
    for folder in ("first", "second"):
        write_firmware(Setup(compasses=(HARD,)), tmp_path / folder, declination=GRID)
    for path in (tmp_path / "first").iterdir():
        assert path.read_bytes() == (tmp_path / "second" / path.name).read_bytes()
