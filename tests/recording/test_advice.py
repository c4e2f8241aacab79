"""What a user is told to do suits the recording, and the next step is a command to type."""

import webbrowser
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.cli import run
from agonic.recording.advice import suit_advice
from agonic.simulation import simulate

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
    for more in (track, {**track, "altitude_m": np.full(N, 450e3)}):
        made = ag.Samples(field=40_000 * around + 500 + still() / 1e4, time=time, **more)
        said = say(made, capsys)
        assert "nose" not in said
        assert "one in which the spacecraft turns" in said
        assert "Next agonic fit inflight log.csv" in said


def test_components_of_the_earth_are_no_readings_of_a_sensor() -> None:
    made = ag.Samples(field=still(), frame="n", time=np.arange(N))
    fit = ag.fit_ellipsoid(made)
    names = [finding.name for finding in suit_advice(fit.findings, made)]
    assert names[0] == "axes of the Earth"
    assert not {"static", "plane"} & set(names)


def test_a_change_is_followed_by_the_stretch_without_it(capsys) -> None:
    samples = simulate("hand", n=3000, noise=50.0, seed=2).samples
    field = samples.field + np.where(np.arange(3000) < 1000, 9000.0, 0.0)[:, None]
    said = say(samples.with_columns(field=field), capsys)
    command = said.split("Next ")[1].split()
    start, stop = map(float, command[command.index("--between") + 1].split(","))
    assert samples.time is not None
    assert start == pytest.approx(samples.time[1000], abs=1.0)
    assert stop == pytest.approx(samples.time[-1], rel=1e-3)
    assert run([*command[1:], "-o", "again"]) == 0


def test_raw_readings_of_the_earth_s_size_are_asked_about(capsys) -> None:
    samples = simulate("hand", n=500, seed=2).samples
    raw = ag.Samples(field=samples.field / 100, unit="raw")
    assert "Next agonic calibrate log.csv --unit mG" in say(raw, capsys)
    counts = raw.with_columns(field=raw.field * 0.37e-3)
    assert "--unit" not in say(counts, capsys)


def test_every_file_is_listed_with_what_it_is_for(capsys, monkeypatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda page: not opened.append(page))
    said = say(simulate("hand", n=800, seed=2).samples, capsys, "--field", "50000", "--open")
    listed = said.split("Written to out: ")[1].split(" Next ")[0]
    for path in Path("out").iterdir():
        assert f"{path.name} " in listed
    assert "mag.h for firmware" in listed
    assert "report.html the report" in listed
    assert "Next agonic heading out/setup.toml log.csv -o headings.csv" in said
    assert opened == [Path("out/report.html").resolve().as_uri()]
