"""`simulate_fleet`: its truth undoes its logs, and the whole way finds the faults it plants."""

from __future__ import annotations

import csv
import json
from collections import Counter, defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.cli import run
from agonic.errors import AgonicError, LogError
from agonic.fleet.dataset import calibrate_dataset
from agonic.fleet.engine import Here
from agonic.fleet.run import calibrate_fleet
from agonic.fleet.settings import FleetSettings
from agonic.fleet.simulation.faults import BROKEN, DAMAGED, SWAPPED
from agonic.fleet.simulation.files import make_tables, make_texts, write_dataset, write_logs
from agonic.fleet.simulation.simulate import SimulatedFleet, simulate_fleet
from agonic.population import Population, Row, find_duplicates, find_outliers

FIELD = 48_000.0
nT = 1.0
UNSPOILT = ("", "axis gain", "gain", *SWAPPED)  # faults that a calibration undoes


@pytest.fixture(scope="module")
def fleet() -> SimulatedFleet:
    """Boards with every fault more than once."""
    return simulate_fleet(
        160, broken=0.15, swapped=0.06, duplicated=0.05, damaged=0.09, rows=250, seed=11
    )


@pytest.fixture(scope="module")
def folder(fleet: SimulatedFleet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    home = tmp_path_factory.mktemp("fleet")
    write_logs(make_texts(fleet), home)
    return home


# ---- the truth -----------------------------------------------------------------------------------


def test_the_truth_undoes_the_readings(fleet: SimulatedFleet) -> None:
    truth, undone = fleet.truth, Counter()
    for recorded in fleet.readings():
        for k, field in enumerate(recorded.field):
            log = recorded.first + k
            fault = str(fleet.boards.fault[fleet.board[log]])
            if fault in UNSPOILT:
                calibrated = (field - truth["bias"][log]) @ truth["matrix"][log].T
                size = np.linalg.norm(calibrated, axis=1)
                noise = truth["noise"][log] * np.linalg.norm(truth["matrix"][log], 2)
                assert size.std() < 1.3 * noise + 5 * nT  # of the steps
                assert abs(size.mean() - FIELD) < 60 * nT  # the day's field
                undone[fault] += 1
    assert set(undone) == set(UNSPOILT)


def test_gravity_and_field_keep_their_angle_but_for_swapped_axes(fleet: SimulatedFleet) -> None:
    wanted = np.sin(np.radians(fleet.facts["inclination_deg"]))
    for recorded in fleet.readings():
        for k, field in enumerate(recorded.field):
            log = recorded.first + k
            fault = str(fleet.boards.fault[fleet.board[log]])
            if fault in ("", *SWAPPED):
                down = -recorded.acceleration[k] / 9.80665
                calibrated = (field - fleet.truth["bias"][log]) @ fleet.truth["matrix"][log].T
                vertical = np.einsum("ij,ij->i", calibrated, down) / FIELD
                as_true = abs(vertical - wanted).max() < 0.2
                assert as_true == (fault == "")


def test_shares_are_what_was_asked_for(fleet: SimulatedFleet) -> None:
    groups = Counter(fleet.truth["group"].tolist())
    assert (groups["duplicated"], groups["damaged"]) == (8, 14)
    planted = Counter(fleet.boards.fault.tolist())
    assert sum(planted[name] for name in BROKEN) == 24
    assert sum(planted[name] for name in SWAPPED) == 10
    assert len(fleet) == 168
    assert len(set(fleet.truth["source"])) == 168


def test_boards_scatter_about_their_design() -> None:
    made = simulate_fleet(4000, broken=0, swapped=0, duplicated=0, damaged=0, bias_sd=500.0)
    bias = made.boards.bias
    assert np.allclose(bias.mean(axis=0), [9000, -5000, 3000], atol=4 * 500 / np.sqrt(4000))
    assert np.allclose(bias.std(axis=0), 500, rtol=0.06)
    assert set(made.truth["fault"]) == {""}


def test_the_seed_makes_the_fleet(fleet: SimulatedFleet) -> None:
    def some(seed: int) -> list[tuple[str, bytes]]:
        return list(make_texts(simulate_fleet(20, rows=30, seed=seed)))

    assert some(1) == some(1)
    assert some(1) != some(2)


def test_the_logs_of_a_board_are_of_one_board_at_other_times() -> None:
    made = simulate_fleet(5, logs=3, broken=0, swapped=0, duplicated=0, damaged=0)
    assert len(made) == 15
    of_one = np.flatnonzero(made.truth["sensor"] == "board-2")
    assert len(of_one) == 3
    assert (np.diff(made.truth["start"][of_one]) > np.timedelta64(20, "D").item()).all()
    away = made.truth["bias"][of_one] - made.boards.bias[2]
    slope = made.boards.slope[2] * (made.truth["temperature_C"][of_one] - 25.0)[:, None]
    assert np.allclose(away, slope)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"n": 0}, "n is 0"),
        ({"n": 5, "rows": 3}, "rows is 3"),
        ({"n": 5, "broken": 1.5}, "broken is 1.5"),
        ({"n": 5, "broken": 0.6, "swapped": 0.6}, "broken and swapped"),
    ],
)
def test_impossible_fleets_are_refused(settings: dict, said: str) -> None:
    with pytest.raises(AgonicError, match=said):
        simulate_fleet(**settings)


# ---- files ---------------------------------------------------------------------------------------


def test_copies_have_the_same_bytes(fleet: SimulatedFleet, folder: Path) -> None:
    copies = np.flatnonzero(fleet.truth["original"] != "")
    assert len(copies) == 8
    for log in copies:
        source, original = fleet.truth["source"][log], fleet.truth["original"][log]
        assert (folder / f"{source}.csv").read_bytes() == (folder / f"{original}.csv").read_bytes()


def test_damaged_files_do_not_read_as_good_ones(fleet: SimulatedFleet, folder: Path) -> None:
    met = set()
    for log in np.flatnonzero(fleet.truth["group"] == "damaged"):
        path, fault = folder / f"{fleet.truth['source'][log]}.csv", fleet.truth["fault"][log]
        if fault in ("truncated", "missing values"):
            samples = ag.read(path)
            assert len(samples) < 0.95 * fleet.facts["rows"]
            assert sum(samples.rejected.values()) >= 1
        else:
            with pytest.raises(LogError):
                ag.read(path)
        met.add(fault)
    assert met == set(DAMAGED)


def test_the_dataset_holds_the_same_readings(
    fleet: SimulatedFleet, folder: Path, tmp_path: Path
) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    path = write_dataset(make_tables(fleet), tmp_path / "all.parquet")
    table = {
        name: np.array(column) for name, column in parquet.read_table(path).to_pydict().items()
    }
    sensors = set(fleet.truth["sensor"]) | set(fleet.truth["source"][fleet.truth["original"] != ""])
    assert set(table["sensor"]) == sensors
    log = int(np.flatnonzero(fleet.truth["fault"] == "")[0])
    samples = ag.read(folder / f"{fleet.truth['source'][log]}.csv")
    own = table["sensor"] == fleet.truth["sensor"][log]
    field = np.column_stack([table[f"mag_{a}_nT"][own] for a in "xyz"])
    acceleration = np.column_stack([table[f"acc_{a}_m_s2"][own] for a in "xyz"])
    assert np.array_equal(field, samples.field)
    assert np.allclose(acceleration, samples.acceleration, atol=0.001)


# ---- the command ---------------------------------------------------------------------------------


def test_the_command_writes_logs_and_truth(tmp_path: Path, capsys) -> None:
    out = tmp_path / "lab"
    asked = ["simulate", "fleet", "-o", str(out), "--sensors", "30", "--rows", "60", "--json"]
    assert run([*asked, "--broken", "0.2", "--damaged", "0.1"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["schema"] == "agonic/simulate-fleet@1"
    assert said["sensors"] == 30
    rows = list(csv.DictReader((out / "truth.csv").read_text().splitlines()))
    assert {f"{row['source']}.csv" for row in rows} == {p.name for p in (out / "logs").iterdir()}
    assert Counter(row["fault"] for row in rows if row["fault"]) == Counter(said["faults"])
    assert float(rows[0]["matrix_xx"]) == pytest.approx(1.04, abs=0.1)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (["--sensors", "many"], "Invalid value for '--sensors': it has to be a whole number"),
        (["--sensors", "10", "--broken", "2"], "broken is 2"),
        (["--sensors", "10", "--format", "xml"], "xml"),
        (["--sensors", "10", "--latency", "3"], "--latency"),
    ],
)
def test_what_does_not_suit_is_said_in_one_line(tmp_path: Path, capsys, asked, said) -> None:
    assert run(["simulate", "fleet", "-o", str(tmp_path / "x"), *asked]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


def test_options_of_a_fleet_are_not_those_of_others(tmp_path: Path, capsys) -> None:
    assert run(["simulate", "tumble", "-o", str(tmp_path / "x.csv"), "--broken", "0.1"]) == 2
    assert "No such option: --broken; see agonic simulate tumble --help" in capsys.readouterr().err


# ---- the whole way -------------------------------------------------------------------------------


_RIGHT = {
    "frozen axis": {"frozen axis"},
    "dead axis": {"plane", "small tilt"},
    "clipping": {"clipping"},
    "noise": {"noise"},
    "spikes": {"outliers"},
    "moved magnet": {"field changed"},
    "axis gain": {"gain"},
    "gain": {"gain"},
    **{name: {"axes"} for name in SWAPPED},
}


def judged(fleet: SimulatedFleet, table: Population, row_of: Callable[[int], Row]) -> int:
    """How many good logs are alarmed; every broken or swapped one is named for what it has."""
    apart = defaultdict(set)
    for found in find_outliers(table):
        apart[found.sensor].add(found.quantity)
    false = 0
    for log, fault in enumerate(fleet.truth["fault"].tolist()):
        row = row_of(log)
        words = {*row.findings, *apart[row.sensor]}
        if fault == "":
            false += row.verdict != "good" or bool(apart[row.sensor])
        elif fault in DAMAGED:
            assert row.verdict == "refused" or {"NaN", "torn end"} & words, (fault, row.status)
        elif fault in _RIGHT:
            assert words & _RIGHT[fault], (fault, words, row.status)
    return false


@pytest.mark.slow
def test_the_folder_names_every_planted_fault(
    fleet: SimulatedFleet, folder: Path, tmp_path: Path
) -> None:
    settings = FleetSettings(field_nT=FIELD, name=r"(board-\d+)")
    table = calibrate_fleet([folder], tmp_path / "out", settings=settings, engine=Here())
    rows = {Path(row.source).stem: row for row in table}
    false = judged(fleet, table, lambda log: rows[fleet.truth["source"][log]])
    assert false <= 2  # of 116; chance alarms at one in some hundred
    twice = {Path(source).stem for found in find_duplicates(table) for source in found.sources}
    copies = fleet.truth["original"] != ""
    assert {*fleet.truth["source"][copies], *fleet.truth["original"][copies]} <= twice


@pytest.mark.slow
def test_the_dataset_names_every_planted_fault(fleet: SimulatedFleet, tmp_path: Path) -> None:
    path = write_dataset(make_tables(fleet), tmp_path / "all.parquet")
    table = calibrate_dataset(path, FleetSettings(field_nT=FIELD), engine=Here())
    rows, truth = {row.sensor: row for row in table}, fleet.truth
    own = np.where(truth["original"] == "", truth["sensor"], truth["source"])
    assert set(rows) == set(own)
    assert judged(fleet, table, lambda log: rows[own[log]]) <= 2
