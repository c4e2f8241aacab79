"""Setup files: what is written is read back, and every mistake is named."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.chain import Chain
from agonic.calibration.deviation import Deviation
from agonic.calibration.setup import Compass, Setup
from agonic.errors import AgonicError, LogError, UnitError
from agonic.files.calibration import save
from agonic.files.setup import load_setup, save_setup

pytestmark = pytest.mark.usefixtures("empty_folder")


def affine(sensor: str = "mag") -> Affine:
    return Affine(bias=[10.0, -20.0, 30.0], matrix=np.diag([1.0, 1.1, 0.9]), sensor=sensor)


CARD = Deviation(coefficients=[1.0, 2.0, 3.0, 0.5, 0.25], sensor="mag")
FELT = Affine(
    bias=[0.1, 0.2, -0.3],
    matrix=np.eye(3) * 1.01,
    covariance=np.eye(12) * 1e-6,
    gauge="free",
    unit_in="m/s2",
    unit_out="m/s2",
)
MOUNTED = Chain(steps=(affine(), Alignment(rotation=Rotation.from_euler("z", 90, degrees=True))))


def mistakes(text: str) -> str:
    Path("setup.toml").write_text(text)
    with pytest.raises(LogError) as caught:
        load_setup("setup.toml")
    return str(caught.value)


def test_everything_that_is_written_is_read_back() -> None:
    setup = Setup(
        compasses=(
            Compass(calibration=affine("MAG[0]"), deviation=CARD, latency_s=0.014),
            Compass(calibration=affine('it\'s "2"')),
        ),
        tilt="gyro",
        tilt_order="pitch-roll",
        tilt_sd_deg=0.7,
        settling_s=20.0,
        declination_deg=-3.25,
        declination_sd_deg=0.4,
        horizontal=19_100.0,
        vertical=45_600.0,
        magnitude_limit=0.2,
        dip_limit_deg=15.0,
        tilt_limit_deg=60.0,
    )
    again = load_setup(save_setup(setup, "boat.toml"))
    for name in (f.name for f in fields(Setup) if f.name not in ("compasses", "provenance")):
        assert getattr(again, name) == getattr(setup, name), name
    first, second = again.compasses
    assert (first.sensor, second.sensor) == ("MAG[0]", 'it\'s "2"')
    assert first.latency_s == 0.014
    assert first.calibration.bias.tolist() == [10.0, -20.0, 30.0]
    assert first.deviation.coefficients.tolist() == CARD.coefficients.tolist()
    assert (second.latency_s, second.deviation) == (0.0, None)


def test_the_calibration_of_the_accelerometer_goes_along() -> None:
    setup = Setup(compasses=(Compass(calibration=affine()),), accelerometer=FELT)
    again = load_setup(save_setup(setup, "boat.toml")).accelerometer
    assert Path("boat-accelerometer.json").exists()
    np.testing.assert_array_equal(again.matrix, FELT.matrix)
    np.testing.assert_array_equal(again.covariance, FELT.covariance)


def test_an_accelerometer_is_no_compass_nor_the_other_way_round() -> None:
    with pytest.raises(UnitError, match="belongs to the tilt"):
        Compass(calibration=FELT)
    with pytest.raises(AgonicError, match="gives nT and not m/s²"):
        Setup(compasses=(Compass(calibration=affine()),), accelerometer=affine())
    save(affine(), "mag.json")
    said = mistakes('[[compass]]\ncalibration = "mag.json"\n[tilt]\naccelerometer = "mag.json"\n')
    assert "not a calibration of an accelerometer" in said


def test_the_default_setup_is_read_back_too() -> None:
    setup = Setup(compasses=(Compass(calibration=affine()),))
    again = load_setup(save_setup(setup, "plain.toml"))
    for name in (f.name for f in fields(Setup) if f.name not in ("compasses", "provenance")):
        assert getattr(again, name) == getattr(setup, name), name


def test_the_page_s_own_example_is_a_setup() -> None:
    import textwrap

    from agonic.files import setup as setupfile

    save(affine(), "MAG1.json")
    save(CARD, "MAG1-card.json")
    save(FELT, "acc.json")
    example = textwrap.dedent(setupfile.__doc__.partition("\n\n")[2])
    Path("setup.toml").write_text(example)
    setup = load_setup("setup.toml")
    assert setup.compasses[0].sensor == "MAG1"
    assert (setup.declination_deg, setup.horizontal) == (2.7, 19_100)


def test_files_are_found_beside_the_setup_not_beside_the_caller() -> None:
    Path("far/away").mkdir(parents=True)
    save(affine(), "far/mag.json")
    Path("far/away/setup.toml").write_text('[[compass]]\ncalibration = "../mag.json"\n')
    assert load_setup("far/away/setup.toml").compasses[0].sensor == "mag"


def test_a_calibration_file_is_a_setup_of_one_compass() -> None:
    setup = load_setup(save(affine("MAG2"), "mag.json"))
    assert [compass.sensor for compass in setup.compasses] == ["MAG2"]
    assert setup.declination_deg is None


@pytest.mark.parametrize("calibration", [affine(), MOUNTED], ids=["affine", "chain"])
def test_a_compass_may_go_by_another_name(calibration) -> None:
    save(calibration, "mag.json")
    Path("setup.toml").write_text('[[compass]]\nsensor = "MAG3"\ncalibration = "mag.json"\n')
    (compass,) = load_setup("setup.toml").compasses
    assert compass.sensor == "MAG3"
    raw = np.array([[100.0, 200.0, 300.0]])
    assert compass.calibration.correct(raw) == pytest.approx(calibration.correct(raw))


def test_model_is_a_declination() -> None:
    save(affine(), "mag.json")
    Path("s.toml").write_text(
        '[[compass]]\ncalibration = "mag.json"\n[declination]\ndegrees = "model"\n'
    )
    assert load_setup("s.toml").declination_deg is None


ONE = '[[compass]]\ncalibration = "mag.json"\n'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "at least one [[compass]]"),
        ("compass = 3", "at least one [[compass]]"),
        ('[compass]\ncalibration = "mag.json"', "at least one [[compass]]"),
        ("[[compass]]\nlatency_s = 0.1", "needs `calibration`"),
        ('[[compass]]\ncalibration = "gone.json"', "gone.json: there is no such file"),
        (
            '[[compass]]\ncalibration = "other.txt"',
            "other.txt: this is a text, as tables of readings are",
        ),
        ('[[compass]]\ncalibration = "card.json"', "card stands where a calibration is needed"),
        (ONE + 'deviation = "mag.json"', "calibration stands where a deviation card is needed"),
        (ONE + 'latency_s = "late"', "`latency_s` expected `float`, got `str`"),
        (ONE + "latency_s = 1000", "latency_s is 1000"),
        (ONE + 'colour = "red"', "has no key `colour`"),
        (ONE + ONE, "one compass for a sensor"),
        (ONE + "[tilt]\nsource = 'moon'", "`source` 'moon' is not known; use one of auto, log"),
        (ONE + "tilt = 'log'", "has no key `tilt`"),
        ("tilt = 'log'\n" + ONE, "[tilt] must be a section"),
        (ONE + "[declination]\ndegrees = 'east'", "declination"),
        (ONE + "[declination]\ndegrees = 300", "declination_deg is 300"),
        (ONE + "[field]\nhorizontal_nT = 20000", "needs `vertical_nT`"),
        (ONE + "[fields]\nhorizontal_nT = 20000", "fields: not part of a setup"),
        (ONE + "[limits]\nmagnitude = -1", "magnitude_limit is -1"),
        ("[[compass]\n", "a setup (TOML) or a calibration file (JSON) is needed"),
        ("\x00", "a setup (TOML) or a calibration file (JSON) is needed"),
        ("{}", "not a usable calibration file"),
    ],
)
def test_a_mistake_is_named(text, said) -> None:
    save(affine(), "mag.json")
    save(CARD, "card.json")
    Path("other.txt").write_text("hello")
    assert said in mistakes(text)


def test_all_mistakes_are_named_at_once() -> None:
    text = '[[compass]]\ncalibration = "gone.json"\n[tilt]\nsd = 1\n[limits]\ndip_deg = "x"\n'
    said = mistakes(text)
    assert said.startswith("setup.toml: ")
    for part in (
        "[[compass]] 1: gone.json",
        "[tilt] has no key `sd`",
        "[limits] `dip_deg` expected `float`",
    ):
        assert part in said


def test_mistakes_of_value_are_named_beside_the_others() -> None:
    save(affine(), "mag.json")
    said = mistakes(
        ONE + 'colour = 1\nlatency_s = "late"\n[tilt]\nsource = "moon"\norder = "yaw"\n'
        "[declination]\ndegrees = 300\n[limits]\ndip_deg = -5\ntilt_deg = 200\n"
    )
    for part in (
        "has no key `colour`",
        "`latency_s` expected `float`, got `str`",
        "`source` 'moon'",
        "`order` 'yaw'",
        "declination_deg is 300",
        "dip_limit_deg is -5",
        "tilt_limit_deg is 200",
    ):
        assert part in said
    assert "declination_deg is 300" in mistakes(
        ONE + "[declination]\ndegrees = 300\n" + "[tilt]\nsettling_s = -1\n"
    )


def test_a_missing_setup_says_so() -> None:
    with pytest.raises(LogError, match=r"nowhere\.toml: there is no such file"):
        load_setup("nowhere.toml")


def test_the_setup_of_the_documentation_is_one() -> None:
    page = Path(__file__).resolve().parents[2] / "docs" / "jobs" / "find-the-heading.md"
    text = page.read_text(encoding="utf-8").partition("```toml\n")[2].partition("```")[0]
    save(affine("MAG1"), "MAG1.json")
    save(affine("MAG2"), "MAG2.json")
    save(CARD, "MAG1-card.json")
    save(FELT, "acc.json")
    Path("boat.toml").write_text(text)
    setup = load_setup("boat.toml")
    assert [compass.sensor for compass in setup.compasses] == ["MAG1", "compass 2"]
    assert setup.settling_s == 10
