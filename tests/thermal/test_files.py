"""Reading a campaign: what simulation wrote comes back, and what is wrong with files is named."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from agonic.errors import LogError
from agonic.thermal.campaign.recording import Campaign
from agonic.thermal.files.read import read_campaign
from agonic.thermal.files.schema import read_description
from agonic.thermal.files.write import write_campaign
from agonic.thermal.simulation.campaign import Faults, SimulatedCampaign, simulate_campaign

SENSORS = "2xMMC5883MA,MPU-9255"


@pytest.fixture(scope="module")
def made() -> SimulatedCampaign:
    return simulate_campaign(SENSORS, rate_Hz=0.02, seed=2)


@pytest.fixture
def folder(made, tmp_path) -> Path:
    write_campaign(made.description, made.stations(), tmp_path)
    return tmp_path


def same(read: Campaign, made: SimulatedCampaign) -> None:
    assert read.sensors == made.campaign.sensors
    for name, by in made.campaign.recordings.items():
        assert set(read.recordings[name]) == set(by)
        for number, samples in by.items():
            got = read.recordings[name][number]
            np.testing.assert_allclose(got.field, samples.field, atol=0.06)  # 0.1 nT on file
            np.testing.assert_allclose(got.temperature, samples.temperature, atol=1e-9)
            np.testing.assert_allclose(got.time, samples.time, atol=1e-3)


@pytest.mark.parametrize("format", ["csv", "parquet"])
def test_what_was_written_comes_back(made, tmp_path, format) -> None:
    write_campaign(made.description, made.stations(), tmp_path, format=format)
    campaign = read_campaign(tmp_path)
    same(campaign, made)
    assert campaign.findings == ()
    assert campaign.description.profile == made.description.profile
    told, read = made.description.rotations, campaign.description.rotations
    assert max((told[n].inv() * read[n]).magnitude() for n in told) < 1e-5
    assert len(campaign.inputs) == 12
    assert campaign.description.sensors[0].reading_sd == pytest.approx(100.26, abs=0.01)


def test_without_pyarrow(made, folder, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    same(read_campaign(folder), made)


def test_without_a_description(made, folder) -> None:
    (folder / "campaign.toml").unlink()
    campaign = read_campaign(folder)
    assert campaign.sensors == ("mag1", "mag2", "mag3")
    assert campaign.stations == tuple(range(1, 13))
    assert campaign.description.rotations is not None


def long_table(made: SimulatedCampaign, sensor_column: bool) -> str:
    """All stations, and all sensors, in one table; every clock starts anew."""
    lines = ["time_s,station,mag_x_uT,mag_y_uT,mag_z_uT,temperature_C,sensor"]
    for name, by in made.campaign.recordings.items():
        for number, s in by.items():
            rows = zip(s.time - s.time[0], s.field * 1e-3, s.temperature, strict=True)
            lines += [f"{t:.1f},{number},{x},{y},{z},{c},{name}" for t, (x, y, z), c in rows]
        if not sensor_column:
            break
    text = "\n".join(lines)
    return text if sensor_column else text.replace(",sensor", "").replace(",MMC5883MA-1", "")


@pytest.mark.parametrize("pyarrow", [True, False])
def test_one_file_with_columns_of_station_and_sensor(made, tmp_path, monkeypatch, pyarrow) -> None:
    if not pyarrow:
        monkeypatch.setitem(sys.modules, "pyarrow", None)
    path = tmp_path / "all.csv"
    path.write_text(long_table(made, sensor_column=True))
    campaign = read_campaign(path)
    assert campaign.sensors == made.campaign.sensors
    assert campaign.rows == made.campaign.rows
    np.testing.assert_allclose(
        campaign.recordings["MPU-9255"][7].field, made.campaign.recordings["MPU-9255"][7].field
    )
    joined = campaign.samples("MPU-9255")
    assert (np.diff(joined.time) > 0).all()


def test_one_file_named_in_the_description(made, tmp_path) -> None:
    (tmp_path / "all.csv").write_text(long_table(made, sensor_column=False))
    (tmp_path / "campaign.toml").write_text(
        'files = "all.csv"\n[[sensor]]\nname = "board"\ncolumn = "mag"\n'
    )
    campaign = read_campaign(tmp_path)
    assert campaign.sensors == ("board",)
    assert campaign.stations == tuple(range(1, 13))


def test_kelvin_is_told_by_its_size_or_by_its_header(made, tmp_path) -> None:
    hot = simulate_campaign(SENSORS, rate_Hz=0.02, seed=2, faults=Faults(kelvin=True))
    write_campaign(hot.description, hot.stations(), tmp_path)
    campaign = read_campaign(tmp_path)
    assert [f.name for f in campaign.findings] == ["kelvin"]
    same(campaign, made)
    for file in tmp_path.glob("*.csv"):
        file.write_text(re.sub(r"(temperature\d)_C", r"\1_K", file.read_text()))
    campaign = read_campaign(tmp_path)
    assert campaign.findings == ()
    same(campaign, made)


def test_a_file_that_ends_in_the_middle_of_a_line(made, folder) -> None:
    file = folder / "station-04.csv"
    data = file.read_bytes()
    file.write_bytes(data[: int(0.4 * len(data)) - 3])
    campaign = read_campaign(folder)
    assert campaign.stations == tuple(range(1, 13))
    assert len(campaign.recordings["MPU-9255"][4]) < 0.45 * 288
    assert any("ends in the middle" in f.what for f in campaign.findings)


def test_damaged_files_are_named_and_the_rest_is_read(made, folder) -> None:
    (folder / "station-02.csv").write_bytes(b"\x00\x01\x02" * 500)
    (folder / "station-05.csv").write_text("")
    (folder / "station-09.csv").write_text("time_s,volts\n0,1\n1,2\n")
    campaign = read_campaign(folder)
    said = [f.what for f in campaign.findings if f.name == "damaged file"]
    assert [any(name in text for text in said) for name in ("-02.", "-05.", "-09.")] == [True] * 3
    assert campaign.stations == (1, 3, 4, 6, 7, 8, 10, 11, 12)


def test_a_broken_parquet_file(made, tmp_path) -> None:
    write_campaign(made.description, made.stations(), tmp_path, format="parquet")
    file = tmp_path / "station-03.parquet"
    file.write_bytes(file.read_bytes()[:2000])
    campaign = read_campaign(tmp_path)
    assert 3 not in campaign.stations
    assert "station-03.parquet" in campaign.findings[0].what


def test_words_among_the_numbers_cost_their_rows_only(made, folder) -> None:
    file = folder / "station-01.csv"
    lines = file.read_text().splitlines()
    lines[100] = lines[100].replace(",", ",overflow,", 1).rsplit(",", 1)[0]
    file.write_text("\n".join(lines))
    campaign = read_campaign(folder)
    assert len(campaign.recordings["MMC5883MA-1"][1]) == 287


def test_a_sensor_that_is_absent_and_one_that_borrows_its_temperature(made, folder) -> None:
    toml = folder / "campaign.toml"
    text = toml.read_text().replace('column = "mag2"', 'column = "mag7"')
    text = text.replace('column = "mag3"', 'column = "mag3"\ntemperature_of = "MMC5883MA-1"')
    toml.write_text(text)
    campaign = read_campaign(folder)
    assert campaign.sensors == ("MMC5883MA-1", "MPU-9255")
    assert [f.name for f in campaign.findings] == ["absent sensor"]
    one, other = (campaign.recordings[name][3].temperature for name in campaign.sensors)
    np.testing.assert_array_equal(one, other)


def test_units_of_the_description(made, folder) -> None:
    for file in folder.glob("*.csv"):
        file.write_text(file.read_text().replace("_uT", "", 9))
    toml = folder / "campaign.toml"
    toml.write_text('unit = "uT"\n' + toml.read_text())
    same(read_campaign(folder), made)


def test_progress(folder) -> None:
    told: list[tuple[str, float]] = []
    read_campaign(folder, progress=lambda name, share: told.append((name, share)))
    assert [name for name, _ in told][:2] == ["station-01.csv", "station-02.csv"]
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1], len(told)) == (0.0, 1.0, 13)


def test_every_mistake_of_a_description_is_named_at_once(tmp_path) -> None:
    path = tmp_path / "campaign.toml"
    path.write_text("""
colour = "red"
files = "station-{number}.csv"
unit = "furlong"
rate_Hz = -1
[[sensor]]
name = "a"
noise_nT = "much"
[[sensor]]
name = "b"
temperature_of = "z"
[[sensor]]
name = "b"
[[station]]
number = 1
file = "first.csv"
roll_deg = 90
[[station]]
pose = "top up"
[profile]
highest_C = "hot"
speed = 3
[chamber]
""")
    with pytest.raises(LogError) as error:
        read_description(path)
    for said in (
        "no key `colour`, `chamber`",
        "`noise_nT` expected",
        "temperature_of 'z'",
        "sensor 'b' is described twice",
        "no file first.csv",
        "[[station]] 1: roll_deg",
        "[[station]] 2 needs `number`",
        "no key `speed`",
        "`highest_C` expected `float`",
    ):
        assert said in str(error.value)
    path.write_text('files = "station-{number}.csv"\nunit = "furlong"\nrate_Hz = -1\n')
    with pytest.raises(LogError) as error:
        read_description(path)
    for said in ("is not a pattern", "'furlong' is not known", "rate_Hz is -1"):
        assert said in str(error.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("= 3", "this is not TOML"),
        ("sensor = 3", "two brackets"),
        ("[profile]\nlowest_C = 60\n", "lower end first"),
        ("profile = 3", r"\[profile\] must be a section"),
    ],
)
def test_descriptions_that_are_none(tmp_path, text, says) -> None:
    path = tmp_path / "campaign.toml"
    path.write_text(text)
    with pytest.raises(LogError, match=says):
        read_campaign(tmp_path)


def test_folders_that_hold_no_campaign(tmp_path) -> None:
    with pytest.raises(LogError, match="no recordings"):
        read_campaign(tmp_path)
    with pytest.raises(LogError, match="no such file"):
        read_campaign(tmp_path / "nowhere")
    (tmp_path / "left.csv").write_text("time_s,mag_x_uT,mag_y_uT,mag_z_uT\n0,1,2,3\n")
    (tmp_path / "right.csv").write_text("time_s,mag_x_uT,mag_y_uT,mag_z_uT\n0,1,2,3\n")
    with pytest.raises(LogError, match="number the files"):
        read_campaign(tmp_path)


def test_every_file_of_a_sensor_is_known(made, folder) -> None:
    campaign = read_campaign(folder)
    files = campaign.files("MPU-9255")
    assert len({file.sha256 for file in files}) == 12
    assert sum(file.count for file in files) == len(campaign.samples("MPU-9255"))
