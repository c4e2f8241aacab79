"""What a user is told to do suits the recording, and the next step is a command to type."""

import re
import webbrowser
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.cli import run
from agonic.health import Finding
from agonic.recording.advice import adapt_advice
from agonic.simulation import simulate, with_inertial_unit

N = 400


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def still() -> np.ndarray:
    return np.array([20_000.0, 1000.0, 43_000.0]) + np.random.default_rng(0).normal(size=(N, 3))


def say(samples: ag.Samples, capsys: pytest.CaptureFixture[str], *more: str) -> str:
    """What `calibrate` says of samples, in one line."""
    ag.write_csv(samples, "log.csv")
    capsys.readouterr()
    run(["calibrate", "log.csv", "-o", "out", *more])
    return " ".join(capsys.readouterr().out.split())


def test_nobody_tilts_the_nose_of_an_observatory(capsys) -> None:
    said = say(ag.Samples(field=still(), time=60.0 * np.arange(N)), capsys)
    assert "calibrated against absolute measurements (agonic fit north)" in said
    short = say(ag.Samples(field=still(), time=0.1 * np.arange(N)), capsys)
    assert "absolute" not in short
    assert "turn it slowly about all three axes" in short


def test_nobody_turns_a_satellite_by_hand(capsys) -> None:
    time = 10.0 * np.arange(N)
    angle = time / 900
    around = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    track = {"latitude_deg": 80 * np.sin(angle), "longitude_deg": angle}
    whole = {**track, "altitude_m": np.full(N, 450e3), "epoch": datetime(2026, 5, 1, tzinfo=UTC)}
    for more in (track, whole):
        made = ag.Samples(field=40_000 * around + 500 + still() / 1e4, time=time, **more)
        said = say(made, capsys)
        assert "nose" not in said
        assert "one in which the spacecraft turns" in said
        assert ("Next agonic fit inflight log.csv" in said) == (more is whole)


def test_components_of_the_earth_are_no_readings_of_a_sensor() -> None:
    made = ag.Samples(field=still(), frame="n", time=np.arange(N))
    fit = ag.fit_ellipsoid(made)
    names = [finding.name for finding in adapt_advice(fit.findings, made)]
    assert names[0] == "axes of the Earth"
    assert not {"static", "plane"} & set(names)


def test_readings_of_one_length_are_blamed_for_nothing_else(capsys) -> None:
    samples = with_inertial_unit(seed=3)(simulate("car", n=600, rate_Hz=20.0, seed=3).samples)
    lengths = np.linalg.norm(samples.field, axis=1, keepdims=True)
    said = say(samples.with_columns(field=samples.field / lengths), capsys)
    assert "all readings have exactly the same length" in said.lower()
    assert said.count("Refused ") == 1
    assert "Check " not in said


def test_an_orientation_that_the_autopilot_applied_is_corrected_there() -> None:
    found = (Finding("mounting", "refuse", "axes are others", "agonic calibrate --mounting x"),)
    made = ag.Samples(field=still(), time=np.arange(N))
    assert adapt_advice(found, made) == found
    (told,) = adapt_advice(found, ag.Samples(field=still(), frame="b", time=np.arange(N)))
    assert "COMPASS_ORIENT" in told.move
    assert "--mounting" not in told.move


@pytest.mark.slow
def test_a_change_that_is_small_is_followed_by_the_stretch_without_it(capsys) -> None:
    samples = simulate("hand", n=3000, noise=50.0, seed=2).samples
    field = samples.field + np.where(np.arange(3000) < 1000, 1000.0, 0.0)[:, None]
    said = say(samples.with_columns(field=field), capsys)
    command = said.split("Next ")[1].split()
    start, stop = map(float, command[command.index("--between") + 1].split(","))
    assert samples.time is not None
    assert start == pytest.approx(samples.time[1000], abs=1.0)
    assert stop == pytest.approx(samples.time[-1], rel=1e-3)
    assert run([*command[1:], "-o", "again"]) == 0


@pytest.mark.slow
def test_counts_need_no_unit_whatever_their_size(capsys) -> None:
    """Counts of 0.917 mG have the size that milligauss of the Earth's field would have."""
    samples = simulate("hand", n=500, seed=2).samples
    raw = ag.Samples(field=samples.field / 91.7, unit="raw")
    said = say(raw, capsys)
    assert "Next agonic apply out/mag.json log.csv" in said
    assert "--unit" not in said
    level = raw.with_columns(field=raw.field * [1, 1, 0.001])
    assert "Next" not in say(level, capsys)


def test_the_next_command_reads_the_log_as_this_one_did(capsys) -> None:
    """What was typed for the log, its unit, columns and place, is needed by what follows too."""
    made = simulate("hand", n=800, noise=50.0, seed=2).samples
    rows = np.column_stack([made.time, made.field / 100])
    np.savetxt("log.csv", rows, delimiter=",", header="t,a,b,c", comments="")
    typed = ["--columns", "time_s=t,x=a,y=b,z=c", "--unit", "mG", "--at", "48,11"]
    capsys.readouterr()
    assert run(["calibrate", "log.csv", "-o", "out", "--date", "2026-05-01", *typed]) == 0
    following = capsys.readouterr().out.replace("\\\n", "").split("Next      agonic ")[1]
    assert run(following.split()) == 0
    assert Path("corrected.csv").is_file()
    place = ["--at", "48,11", "--date", "2026-05-01", "--method", "ellipsoid"]
    following = say(made, capsys, *place).replace("\\ ", "").split("Next agonic ")[1]
    assert "--at 48,11 --date 2026-05-01" in following
    assert run(following.split()) == 0
    assert Path("headings.csv").is_file()


@pytest.mark.slow
def test_a_rover_s_log_without_its_place_is_asked_for_it(capsys) -> None:
    """Beside a gyro it is not needed: the dip is found with the rest."""
    rover = simulate("circle", tilt_deg=5.0, n=1500, seed=1)
    whole = with_inertial_unit()(rover.samples)
    assert "give the place" not in say(whole, capsys)
    samples = whole.with_columns(rotation_rate=None)
    said = say(samples, capsys)
    assert "give the place (--at LAT,LON)" in said
    assert "Next" not in said  # what is missing cannot be typed as it stands
    (page,) = re.findall(r"cannot be tilted: (docs/\S+\.md)", said)
    assert (Path(__file__).parents[2] / page).is_file()
    assert "--at LAT" not in say(samples, capsys, "--field", "50000")


def test_a_stretch_is_no_cure_for_turns_that_are_missing(capsys) -> None:
    level = simulate("circle", tilt_deg=2.0, n=2000, noise=50.0, seed=3).samples
    jump = np.where(np.arange(2000) < 700, 6000.0, 0.0)[:, None] * [1.0, 0.0, 0.0]
    assert "--between" not in say(level.with_columns(field=level.field + jump), capsys)


def test_what_was_not_read_is_told_with_a_refusal(capsys) -> None:
    made = simulate("circle", tilt_deg=2.0, n=500, seed=3).samples
    rows = np.column_stack([made.time, made.field, np.tile([1.0, 2.0, 16384.0], (500, 1))])
    np.savetxt(
        "log.csv", rows, delimiter=",", comments="", header="time_s,mx_nT,my_nT,mz_nT,ax,ay,az"
    )
    assert run(["calibrate", "log.csv", "-o", "out"]) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert "acc left out" in said
    assert run(["info", "log.csv"]) == 0
    assert " ".join(capsys.readouterr().out.split()).count("acc left out") == 1


def test_a_spacecraft_without_altitude_is_told_what_its_field_rests_on(capsys) -> None:
    angle = np.linspace(0, 4, N)
    track = {"latitude_deg": 50 * np.sin(angle), "longitude_deg": np.degrees(angle) - 100}
    body = simulate("tumble", n=N, seed=1).samples.field
    epoch = datetime(2026, 5, 1, tzinfo=UTC)
    made = ag.Samples(field=body, time=angle * 900, epoch=epoch, **track)
    said = say(made, capsys)
    assert "the field was taken from the world model at sea level" in said
    assert "give it: agonic fit inflight LOG --altitude METRES" in said
    assert "Next" not in said
    high = say(made.with_columns(altitude_m=np.full(N, 400e3)), capsys)
    assert "sea level" not in high
    assert "--altitude" not in high


def test_every_file_is_listed_with_what_it_is_for(capsys, monkeypatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda page: not opened.append(page))
    said = say(simulate("hand", n=800, seed=2).samples, capsys, "--at", "48,11", "--open")
    listed = said.split("Written to out: ")[1].split(" Next ")[0]
    for path in Path("out").iterdir():
        assert f"{path.name} " in listed
    assert "mag.h for firmware" in listed
    assert "report.html the report" in listed
    assert "Next agonic heading out/setup.toml log.csv --at 48,11 --date 20" in said
    assert opened == [Path("out/report.html").resolve().as_uri()]
