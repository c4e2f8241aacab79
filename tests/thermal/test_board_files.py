"""Files as laboratories have them: one a board, headers of any language, columns named by hand."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from agonic.errors import LogError
from agonic.samples import Samples
from agonic.thermal.campaign.recording import Campaign
from agonic.thermal.checks.programme import check_campaign
from agonic.thermal.files.read import read_campaign
from agonic.thermal.files.schema import read_description
from agonic.thermal.files.write import write_description
from agonic.thermal.simulation.campaign import SimulatedCampaign, simulate_campaign

SENSORS = "2xMMC5883MA,MPU-9255"
HEAD = ("time_s", "mag{}_x_uT", "mag{}_y_uT", "mag{}_z_uT", "temperature{}_C")


@pytest.fixture(scope="module")
def made() -> SimulatedCampaign:
    return simulate_campaign(SENSORS, rate_Hz=0.02, seed=2)


def table(
    sensors: list[Samples], head: tuple[str, ...] = HEAD, separator: str = ",", comma: str = "."
) -> str:
    """The recordings of a station as text; the first header is that of the clock."""
    names = [head[0], *(h.format(k) for k in range(1, len(sensors) + 1) for h in head[1:])]
    columns = [sensors[0].time]
    for samples in sensors:
        columns += [*(samples.field.T * 1e-3), samples.temperature]
    rows = (separator.join(f"{v:.4f}".replace(".", comma) for v in row) for row in zip(*columns))  # noqa: B905
    return separator.join(names) + "\n" + "\n".join(rows) + "\n"


def write_boards(
    made: SimulatedCampaign, folder: Path, name: Callable[[str, int], str], **how: object
) -> None:
    """Two boards, the first with two sensors, a file each at every station."""
    one, two, three = (made.campaign.recordings[n] for n in made.campaign.sensors)
    for number in one:
        for board, own in (("obc", [one[number], two[number]]), ("ext", [three[number]])):
            path = folder / name(board, number)
            path.parent.mkdir(exist_ok=True)
            path.write_text(table(own, **how), "utf-8")  # type: ignore[arg-type]


def same(read: Campaign, made: SimulatedCampaign, names: dict[str, str]) -> None:
    assert read.sensors == tuple(names)
    for name, truth in names.items():
        assert read.stations == tuple(range(1, 13))
        for number, samples in made.campaign.recordings[truth].items():
            got = read.recordings[name][number]
            np.testing.assert_allclose(got.field, samples.field, atol=0.06)
            np.testing.assert_allclose(got.temperature, samples.temperature, atol=1e-4)


def findings(campaign: Campaign) -> set[str]:
    return {finding.name for finding in campaign.findings}


NAMES = {
    "a file a board and station": lambda board, k: f"{board}_pos{k:02d}.csv",
    "with a date": lambda board, k: f"2026-03-{k:02d} {board} position {k}.csv",
    "a folder a board": lambda board, k: f"{board}/pos{k:02d}.csv",
    "numbered boards": lambda board, k: f"board{len(board) + (board == 'ext')}_{k:02d}.csv",
}


@pytest.mark.parametrize("kind", NAMES)
def test_boards_with_the_same_names_get_names_of_their_own(made, tmp_path, kind) -> None:
    if kind == "numbered boards":
        write_boards(made, tmp_path, lambda b, k: f"board{1 + (b == 'ext')}_{k:02d}.csv")
        obc, ext = "board1", "board2"
    else:
        write_boards(made, tmp_path, NAMES[kind])
        obc, ext = "obc", "ext"
    read = read_campaign(tmp_path)
    told = next(f for f in read.findings if f.name == "sensors renamed")
    assert (told.severity, ext in told.what) == ("note", True)
    first, second, third = made.campaign.sensors
    expected = {ext: third, f"{obc} mag1": first, "mag2": second}
    same(read, made, {name: expected[name] for name in read.sensors})
    assert len(read.sensors) == 3


def test_a_description_names_the_sensors_of_each_board(made, tmp_path) -> None:
    write_boards(made, tmp_path, lambda b, k: f"{b}_pos{k:02d}.csv")
    first, second, third = made.campaign.sensors
    (tmp_path / "campaign.toml").write_text(
        'files = "{board}_pos{station:02d}.csv"\n'
        f'[[sensor]]\nname = "{third}"\ncolumn = "mag1"\nboard = "ext"\n'
        f'[[sensor]]\nname = "{first}"\ncolumn = "mag1"\nboard = "OBC"\n'
        f'[[sensor]]\nname = "{second}"\ncolumn = "mag2_x_uT"\nboard = "OBC"\n'
        f'temperature_of = "{third}"\n'
    )
    for file in tmp_path.glob("obc*"):
        file.rename(tmp_path / file.name.replace("obc", "OBC"))
    read = read_campaign(tmp_path)
    assert findings(read) == set()
    assert read.sensors == (third, first, second)
    borrowed = read.recordings[second][4].temperature
    np.testing.assert_allclose(borrowed, read.recordings[third][4].temperature)


def test_a_board_is_needed_where_names_are_the_same(made, tmp_path) -> None:
    write_boards(made, tmp_path, lambda b, k: f"{b}_pos{k:02d}.csv")
    (tmp_path / "campaign.toml").write_text('[[sensor]]\nname = "A"\ncolumn = "mag1"\n')
    said = next(f for f in read_campaign(tmp_path).findings if f.name == "sensor twice")
    assert (said.severity, "board" in said.move) == ("check", True)


def test_a_station_recorded_again_is_no_board(made, tmp_path) -> None:
    write_boards(made, tmp_path, lambda b, k: f"{b}_pos{k:02d}.csv")
    for file in tmp_path.glob("ext*"):
        file.unlink()
    (tmp_path / "again_pos03.csv").write_text((tmp_path / "obc_pos03.csv").read_text())
    read = read_campaign(tmp_path)
    assert read.sensors == ("mag1", "mag2")
    assert findings(read) == {"sensor twice"}


def test_columns_of_any_header_are_named_in_the_description(made, tmp_path) -> None:
    """Headers that say nothing, a thermometer for both sensors, units in brackets."""
    head = ("ticks", "A{}a [mkT]", "A{}b [mkT]", "A{}c [mkT]", "P{}")
    write_boards(made, tmp_path, lambda b, k: f"{b}_pos{k:02d}.csv", head=head)
    first, second, third = made.campaign.sensors

    def columns(k: int, temperature: str) -> str:
        return (
            f'columns = {{ x = "A{k}a [mkT]", y = "A{k}b [mkT]", z = "A{k}c [mkT]", '
            f'temperature = "{temperature}" }}\n'
        )

    (tmp_path / "campaign.toml").write_text(
        'unit = "uT"\ncolumns = { time_s = "ticks" }\n'
        f'[[sensor]]\nname = "{first}"\nboard = "obc"\n{columns(1, "P1")}'
        f'[[sensor]]\nname = "{second}"\nboard = "obc"\n{columns(2, "P1")}'
        f'[[sensor]]\nname = "{third}"\nboard = "ext"\n{columns(1, "P1")}'
    )
    read = read_campaign(tmp_path)
    assert findings(read) == set()
    same_temperature = read.recordings[second][5].temperature
    np.testing.assert_allclose(same_temperature, read.recordings[first][5].temperature)
    for name in made.campaign.sensors:
        truth = made.campaign.recordings[name][5]
        np.testing.assert_allclose(read.recordings[name][5].field, truth.field, atol=0.06)
        np.testing.assert_allclose(np.diff(read.recordings[name][5].time), np.diff(truth.time))
    described = read_description(write_description(read.description, tmp_path / "again.toml"))
    assert described.sensors == read.description.sensors
    assert (described.unit, described.columns) == ("uT", {"time_s": "ticks"})


def test_one_column_is_named_beside_headers_that_speak(made, tmp_path) -> None:
    head = (*HEAD[:4], "Sonde {}")
    write_boards(made, tmp_path, lambda b, k: f"{b}_pos{k:02d}.csv", head=head)
    toml = tmp_path / "campaign.toml"
    toml.write_text(
        '[[sensor]]\nname = "A"\ncolumn = "mag1"\nboard = "obc"\n'
        'columns = { temperature_C = "Sonde 1" }\n'
        '[[sensor]]\nname = "B"\ncolumn = "mag2"\nboard = "obc"\n'
        'columns = { temperature_C = "Sonde 2" }\n'
    )
    read = read_campaign(tmp_path)
    for name, truth in zip("AB", made.campaign.sensors, strict=False):
        np.testing.assert_allclose(
            read.recordings[name][7].temperature,
            made.campaign.recordings[truth][7].temperature,
            atol=1e-4,
        )
    toml.write_text(
        '[[sensor]]\nname = "A"\nboard = "obc"\n'
        'columns = { x = "mag1_x_uT", y = "mag1_y_uT", z = "mag1_z_uT", temperature = "Probe" }\n'
    )
    with pytest.raises(LogError, match=r"campaign.toml names 'Probe'; the columns are 'time_s'"):
        read_campaign(tmp_path)
    toml.write_text('[[sensor]]\nname = "A"\ncolumns = { x = "a", y = "b", warmth = "c" }\n')
    with pytest.raises(LogError, match=r"'warmth' is not a column.*x, y only of x, y and z"):
        read_campaign(tmp_path)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1251", "utf-16"])
def test_cyrillic_headers_and_units(made, tmp_path, encoding) -> None:
    """As a table program with Russian settings writes them."""
    one = made.campaign.recordings[made.campaign.sensors[0]]
    head = ("Время, с", "Bx, мкТл", "By, мкТл", "Bz, мкТл", "T, °C")
    for number, samples in one.items():
        text = table([samples], head, ";", ",")
        (tmp_path / f"Положение {number:02d}.csv").write_bytes(text.encode(encoding))
    same(read_campaign(tmp_path), made, {"mag": made.campaign.sensors[0]})


def test_a_long_table_with_cyrillic_headers(made, tmp_path) -> None:
    one = made.campaign.recordings[made.campaign.sensors[0]]
    lines = ['"Положение","Время, с","Bx, мкТл","By, мкТл","Bz, мкТл","T, °C"']
    for number, s in one.items():
        rows = zip(s.time - s.time[0], s.field * 1e-3, s.temperature, strict=True)
        lines += [f"{number},{t:.1f},{x:.4f},{y:.4f},{z:.4f},{c:.4f}" for t, (x, y, z), c in rows]
    (tmp_path / "Камера.csv").write_text("\n".join(lines), "utf-8")
    same(read_campaign(tmp_path), made, {"mag": made.campaign.sensors[0]})


def test_a_pose_of_its_own_without_angles_is_no_standard_turn(tmp_path) -> None:
    toml = tmp_path / "campaign.toml"
    toml.write_text(
        "[[station]]\nnumber = 1\n"
        '[[station]]\nnumber = 2\npose = "antenna to the window"\n'
        '[[station]]\nnumber = 3\npose = "rear up, left side to the back"\n'
        "[[station]]\nnumber = 4\nroll_deg = 10\npitch_deg = 0\nheading_deg = 0\n"
    )
    described = read_description(toml)
    known = [station.rot_nb is not None for station in described.stations]
    assert known == [True, False, True, True]
    assert described.stations[1].pose == "antenna to the window"
    assert described.rotations is None


def test_a_unit_is_kept_where_no_sensor_is_described(made, tmp_path) -> None:
    head = ("time_s", "mag{}_x", "mag{}_y", "mag{}_z", "temperature{}_C")
    write_boards(made, tmp_path, lambda b, k: f"{b}_pos{k:02d}.csv", head=head)
    (tmp_path / "campaign.toml").write_text('unit = "uT"\nname = "no sensors"\n')
    read = read_campaign(tmp_path)
    assert {s.unit for by in read.recordings.values() for s in by.values()} == {"nT"}


# ---- boards keep working ------------------------------------------------------------------------


def test_a_clock_that_begins_anew_loses_no_reading(made, tmp_path) -> None:
    """The board was reset twice at station 2, and once at station 5."""
    write_boards(made, tmp_path, lambda b, k: f"{b}_pos{k:02d}.csv")
    for number, rows in ((2, (60, 150)), (5, (100,))):
        file = tmp_path / f"obc_pos{number:02d}.csv"
        head, *lines = file.read_text().splitlines()
        cells = [line.split(",", 1) for line in lines]
        times = np.array([float(time) for time, _ in cells])
        for row in rows:
            times[row:] -= times[row]
        lines = [f"{t:.1f},{rest}" for t, (_, rest) in zip(times, cells, strict=True)]
        file.write_text("\n".join([head, *lines]) + "\n")
    read = read_campaign(tmp_path)
    truth = made.campaign.recordings[made.campaign.sensors[0]]
    for number in (2, 5):
        samples = read.recordings["obc mag1"][number]
        assert len(samples) == len(truth[number])
        np.testing.assert_allclose(np.diff(samples.time), np.diff(truth[number].time), atol=1e-6)
    assert {n: len(at) for n, at in read.restarts["obc mag1"].items()} == {2: 2, 5: 1}
    _, found = check_campaign(read)
    said = next(f for f in found if f.name == "clock restarts")
    assert said.severity == "check"
    assert "3 times" in said.what
    assert "stations 2, 5" in said.what
    assert "obc" in said.what


def test_gaps_are_counted_once_for_each_board(made, tmp_path) -> None:
    write_boards(made, tmp_path, lambda b, k: f"{b}_pos{k:02d}.csv")
    file = tmp_path / "obc_pos04.csv"
    lines = file.read_text().splitlines()
    file.write_text("\n".join(lines[:100] + lines[125:]) + "\n")
    _, found = check_campaign(read_campaign(tmp_path))
    said = next(f for f in found if f.name == "recording gaps")
    assert said.what.startswith("1 gap ")
    assert "station 4" in said.what


def test_boards_with_clocks_of_their_own(made, tmp_path) -> None:
    """One counts from when it was switched on, the other writes dates."""
    write_boards(made, tmp_path, lambda b, k: f"{b}_pos{k:02d}.csv")
    for file in tmp_path.glob("ext*"):
        head, *lines = file.read_text().splitlines()
        rows = (line.split(",", 1) for line in lines)
        moved = [f"{1_770_000_000 + float(t):.1f},{rest}" for t, rest in rows]
        file.write_text("\n".join([head.replace("time_s", "unix_time_s"), *moved]))
    read = read_campaign(tmp_path)
    assert any("clocks of the boards" in f.what for f in read.findings)
    _, found = check_campaign(read)
    assert {f.severity for f in found} == {"note"}
