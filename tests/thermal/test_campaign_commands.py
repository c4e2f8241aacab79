"""`agonic plan thermal`, `simulate campaign` and `fit thermal` as a person would run them."""

import json
from pathlib import Path

import numpy as np
import pytest

from agonic.cli import run
from agonic.thermal.files.read import read_campaign
from tests.command_line import answer, complaint

pytestmark = pytest.mark.usefixtures("empty_folder")


def test_a_plan_for_programs(capsys) -> None:
    status, said = answer(
        capsys, "plan", "thermal", "--sensors", "2xMMC5883MA,3xMPU-9255", "--range", "-10,50"
    )
    assert status == 0
    assert said["schema"] == "agonic/plan-thermal@1"
    assert len(said["stations"]) == 12
    assert len(said["sensors"]) == 5
    assert said["stations"][1]["turn"].startswith("turn it 90° to the right")
    assert said["station_s"] == 4 * 3600
    assert said["rows"] == 8_640_000
    expected = said["expected_nT"]["MPU-9255-1"]
    assert expected["known"]["bias_rms"] < expected["magnitude"]["bias_rms"] < 3.0
    assert [s["action"] for s in said["profile"][:4]] == ["heat", "hold", "cool", "hold"]


def test_a_plan_for_the_laboratory(capsys) -> None:
    assert run(["plan", "thermal", "--sensors", "MPU-9255", "-o", "plan.html"]) == 0
    assert "Written   plan.html" in capsys.readouterr().out
    assert Path("plan.html").read_text().count("<article") == 12
    assert run(["plan", "thermal", "--sensors", "LIS3MDL:300", "-o", "plan.txt"]) == 0
    assert "LIS3MDL" in Path("plan.txt").read_text()


def test_the_folder_of_a_plan_takes_the_recordings(capsys) -> None:
    words = ["plan", "thermal", "--sensors", "MMC5883MA,MPU-9255", "--folder", "chamber"]
    assert run(words) == 0
    description = Path("chamber/campaign.toml").read_text()
    run(["simulate", "campaign", "-o", "made", "--sensors", "MMC5883MA,MPU-9255", "--rate", "0.02"])
    for file in Path("made").glob("*.csv"):
        file.rename(Path("chamber") / file.name)
    assert Path("chamber/campaign.toml").read_text() == description
    campaign = read_campaign("chamber")
    assert campaign.sensors == ("MMC5883MA", "MPU-9255")
    assert campaign.findings == ()
    assert "is there already" in complaint(capsys, *words)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--sensors", "LIS3MDL"], "LIS3MDL:NOISE"),
        (["--sensors", "MPU-9255", "--range", "cold"], "is not LOW,HIGH in °C"),
        (["--sensors", "MPU-9255", "--range", "50,-10"], "lower end first"),
        (["--sensors", "MPU-9255", "-o", "plan.pdf"], "name it .html or .txt"),
        (["--sensors", "MPU-9255", "--rate", "0"], "rate 0 Hz"),
        (["--sensors", "MPU-9255", "--cooling", "3"], "cool more slowly"),
        ([], "sensors"),
    ],
)
def test_plans_that_cannot_be_are_one_line(capsys, arguments, says) -> None:
    assert says in complaint(capsys, "plan", "thermal", *arguments)


def test_a_simulated_campaign_with_its_truth(capsys) -> None:
    status, said = answer(
        capsys,
        "simulate",
        "campaign",
        "-o",
        "made",
        "--rate",
        "0.02",
        "--fault",
        "missing=3",
        "--fault",
        "truncated=5",
        "--format",
        "csv",
        "--seed",
        "4",
    )
    assert status == 0
    assert said["schema"] == "agonic/simulate-campaign@1"
    assert said["stations"] == 11
    truth = json.loads(Path("made/truth/truth.json").read_text())
    assert set(truth["sensors"]) == set(said["sensors"])
    assert len(truth["matrix_nb"]) == 12
    campaign = read_campaign("made")
    assert 3 not in campaign.stations
    assert len(campaign.recordings["MPU-9255-1"][5]) < 0.41 * 288


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--fault", "fire"], "is not known"),
        (["--fault", "missing=all"], "is not known"),
        (["--fault", "missing=20"], "no station 20"),
        (["--fault", "stuck=x"], "no sensor 'x'"),
        (["--format", "xlsx"], "csv, parquet"),
        (["--sensors", "what"], "what:NOISE"),
    ],
)
def test_simulations_that_cannot_be_are_one_line(capsys, arguments, says) -> None:
    assert says in complaint(
        capsys, "simulate", "campaign", "-o", "made", "--rate", "0.01", *arguments
    )


@pytest.fixture
def recorded() -> str:
    words = ["--sensors", "2xMMC5883MA", "--rate", "0.1", "--seed", "8"]
    assert run(["simulate", "campaign", "-o", "recorded", *words]) == 0
    return "recorded"


@pytest.mark.slow
def test_a_campaign_is_fitted(recorded, capsys) -> None:
    status, said = answer(capsys, "fit", "thermal", recorded, "-o", "results")
    assert status == 0
    assert said["schema"] == "agonic/fit-thermal@1"
    assert (said["verdict"], said["turns"]) == ("good", "known")
    names = ["MMC5883MA-1.json", "MMC5883MA-2.json", "report.html"]
    assert said["files"] == [str(Path("results", name)) for name in names]
    assert Path(said["files"][-1]).read_text().count("<article") == 2
    assert 20.0 < said["chamber_field"]["sd_nT"] < 60.0
    truth = json.loads(Path("recorded/truth/truth.json").read_text())["sensors"]
    for sensor in said["sensors"]:
        at = sensor["at"]
        true = truth[sensor["sensor"]]
        x = (np.array(at["temperature_C"]) - true["centre_C"]) / true["half_range_C"]
        bias = np.polynomial.polynomial.polyval(x, np.array(true["bias"])).T
        error = np.subtract(at["bias_nT"], bias)
        assert np.all(np.abs(error) < 5 * np.array(at["bias_sd_nT"]))
        assert np.abs(error).max() < 100.0
        assert len(sensor["improvement"]) == 4
        assert sensor["held_out"]["improvement"][3] > 0.9 * sensor["improvement"][3]
        assert len(sensor["fixture_deg"]) == 12
        (file,) = sensor["files"]
        assert json.loads(Path(file).read_text())["calibration"]["kind"] == "thermal"


@pytest.mark.slow
def test_a_campaign_in_words(recorded, capsys) -> None:
    capsys.readouterr()
    assert (
        run(
            [
                "fit",
                "thermal",
                recorded,
                "--stations",
                "unknown",
                "--degree",
                "auto",
                "--no-held-out",
            ]
        )
        == 0
    )
    said = capsys.readouterr().out
    assert "2 sensors, stations 1–12, 34 560 readings" in said.replace("\u202f", " ")
    assert "✓ MMC5883MA-2: good" in said
    assert "Standard error: bias" in " ".join(said.split())
    assert "Nothing was written." in said


@pytest.mark.slow
def test_a_spoilt_campaign_leaves_with_1(capsys) -> None:
    run(
        [
            "simulate",
            "campaign",
            "-o",
            "bad",
            "--rate",
            "0.05",
            "--fault",
            "swapped=4,9",
            "--sensors",
            "MMC5883MA,MPU-9255",
            "--fault",
            "missing=11",
        ]
    )
    status, said = answer(capsys, "fit", "thermal", "bad", "-s", "MPU-9255", "--no-held-out")
    assert status == 1
    names = {finding["name"] for finding in said["findings"]}
    assert {"swapped stations", "missing stations"} <= names
    assert said["turns"] == "unknown"
    assert [sensor["sensor"] for sensor in said["sensors"]] == ["MPU-9255"]


def test_one_station_alone_is_refused_with_what_is_missing(recorded, capsys) -> None:
    alone = f"{recorded}/station-01.csv"
    status, said = answer(capsys, "fit", "thermal", alone, "-o", "alone", "--no-held-out")
    assert status == 1
    told = "stations 2–12 of 12 are missing: 1 left do not determine nine numbers"
    assert [one["what"] for one in said["findings"]] == [told]
    refused = "1 of twelve stations cannot determine nine numbers; record the others."
    assert [sensor["status"] for sensor in said["sensors"]] == [refused, refused]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["nowhere"], "no such file or folder"),
        ([".", "--degree", "3.5"], "give 0 to 9, or auto"),
        (["."], "no recordings"),
        (["recorded", "--stations", "perhaps"], "'perhaps'"),
        (["recorded", "--sensor", "x"], "no sensor x"),
        (["recorded", "--bin-width", "0"], "above zero"),
    ],
)
def test_campaigns_that_cannot_be_fitted_are_one_line(request, capsys, arguments, says) -> None:
    if "recorded" in arguments:
        request.getfixturevalue("recorded")
    assert says in complaint(capsys, "fit", "thermal", *arguments)
