"""`agonic live` in the terminal, its mistakes, and the memory of a long session."""

import json
import signal
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest

import agonic as ag
from agonic.cli import run
from agonic.live.fit import LiveFit
from agonic.live.streams import Chunk
from agonic.live.web.plan import Plan
from agonic.live.web.watch import WatchedSensor
from tests.live.rover import AT, ON, drive, stand, turn


@pytest.mark.slow
def test_in_the_terminal_with_the_same_words(tmp_path, capsys):
    assert run(["live", "sim?seed=2", "--speed", "8", "--text", "-o", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "% covered" in said
    assert "enough: accept the result" in said
    assert "✓ mag: good" in said
    assert (tmp_path / "mag.json").is_file()


def test_without_a_source_the_ports_are_listed(monkeypatch, capsys):
    found = [("/dev/ttyUSB0", "CP2102"), ("/dev/ttyUSB1", "")]
    monkeypatch.setattr("agonic.live.streams.links.list_ports", lambda: found)
    assert run(["live"]) == 2
    said = capsys.readouterr().out
    assert "/dev/ttyUSB0  CP2102\n" in said
    assert said.endswith("Next      agonic live /dev/ttyUSB0\n")
    monkeypatch.setattr("agonic.live.streams.links.list_ports", list)
    assert run(["live"]) == 2
    assert "No serial port was found." in capsys.readouterr().out


@pytest.mark.slow
def test_a_second_session_replaces_what_the_first_wrote(tmp_path, capsys):
    command = ["live", "sim", "--speed", "0", "--text", "--fresh", "-o", str(tmp_path)]
    biases = []
    for seed in (1, 2):
        command[1] = f"sim?seed={seed}"
        assert run(command) == 0, capsys.readouterr().err
        biases.append(ag.load(tmp_path / "mag.json").bias)
    assert np.abs(biases[0] - biases[1]).max() > 1000.0


def test_one_object_for_programs(tmp_path, capsys):
    made = ag.simulate("tumble", n=1500, rate_Hz=50.0, seed=4)
    log = ag.write_csv(made.samples, tmp_path / "log.csv")
    out = tmp_path / "out"
    status = run(["live", str(log), "--speed", "0", "--field", "50000", "--json", "-o", str(out)])
    told = json.loads(capsys.readouterr().out)
    assert status == 0
    assert told["schema"] == "agonic/live@1"
    of_mag = told["sensors"][0]
    error = np.abs(np.array(of_mag["bias_nT"]) - made.truth.bias)
    assert (error < 5 * np.array(of_mag["bias_sd_nT"])).all()
    # the readings that were kept lie beside the result, and give it again
    again = ag.calibrate(ag.read(out / "mag-readings.csv"), ag.Reference.constant(50_000.0))
    np.testing.assert_allclose(again.fit.calibration.bias, of_mag["bias_nT"], rtol=1e-6)
    assert ag.load(out / "mag.json").provenance.inputs[0].name == "mag-readings.csv"


@pytest.mark.slow
def test_a_rover_is_told_what_to_drive_and_accepted_as_calibrate_would(tmp_path, capsys):
    samples = drive(turn(0, 720), stand(0), stand(0, 5.0), stand(0, 0.0, -5.0))
    log, out = ag.write_csv(samples, tmp_path / "rover.csv"), tmp_path / "out"
    place = ["--at", AT, "--date", ON]
    status = run(["live", str(log), "--speed", "0", *place, "--json", "-o", str(out)])
    told = json.loads(capsys.readouterr().out)
    (of_mag,), (guided,) = told["sensors"], told["guidance"]
    assert status == 0
    assert of_mag["method"] == guided["method"] == "inertial"
    assert min(guided["rose"]["counts"]) > 0
    assert max(guided["rose"]["tilts_deg"]) > 4
    readings, again = str(out / "mag-readings.csv"), str(tmp_path / "again")
    assert run(["calibrate", readings, *place, "--json", "-o", again]) == 0
    (again,) = json.loads(capsys.readouterr().out)["sensors"]
    np.testing.assert_allclose(again["bias_nT"], of_mag["bias_nT"], rtol=1e-4)
    assert again["verdict"] == of_mag["verdict"] == "good"


@pytest.mark.slow
def test_ctrl_c_in_the_terminal_says_what_is_saved(sensor, tmp_path):
    out = tmp_path / "out"
    source = f"tcp://127.0.0.1:{sensor.port}"
    command = [sys.executable, "-m", "agonic", "live", source, "--text", "--target", "0.001"]
    process = subprocess.Popen([*command, "-o", str(out)], stdout=subprocess.PIPE, text=True)
    while "covered" not in (line := process.stdout.readline()):
        assert line
    process.send_signal(signal.SIGINT)
    said, _ = process.communicate(timeout=20)
    assert process.returncode == 130
    told = said.splitlines()[-1]
    assert told.startswith("Stopped; ")
    assert f"saved in {out}: the same command goes on from there" in told
    assert f"Stopped; {LiveFit.resume(out / 'mag.live').n:,} readings" in told


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["gopher://x"], "names no source"),
        (["nothing.csv"], "there is no such file"),
        (["sim", "--at", "north"], "--at"),
        (["sim", "--listen", "192.0.2.1"], "cannot listen"),
        (["sim", "--target", "0"], "--target"),
        (["sim", "--speed", "-1"], "speed -1 is not possible"),
        (["sim?sensors=0"], "sensors=0: it must be above zero"),
        (["udp://:5005", "--unit", "furlong"], "'furlong' is not known"),
        (["sim", "-o", "/proc/nowhere"], "cannot write to /proc/nowhere"),
        (["sim", "-o", __file__], "Not a directory"),
    ],
)
def test_mistakes_are_one_line(arguments, why, tmp_path, capsys):
    assert run(["live", "-o", str(tmp_path), "--port", "0", *arguments]) == 2
    complaint = capsys.readouterr().err
    assert why in complaint
    assert complaint.count("\n") == 1


@pytest.mark.slow
def test_an_hour_of_turning_takes_no_more_memory_than_a_part_of_it(tmp_path):
    made = ag.simulate("hand", n=30_000, rate_Hz=50.0, noise=150.0).samples
    first = Chunk("mag", made.time[:1], made.field[:1], "nT")
    plan = Plan(folder=tmp_path, reference=ag.Reference.constant(50_000.0))
    watched = WatchedSensor(first, plan.params(first), None)
    held = []
    tracemalloc.start()
    for k in range(60):  # an hour at 50 readings a second
        rows = slice(3000 * (k % 10), 3000 * (k % 10 + 1))
        watched.take(Chunk("mag", 60.0 * k + np.arange(3000) / 50, made.field[rows], "nT"))
        watched.digest()
        if k % 3 == 2:
            watched.status()
            held.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert watched.live.n == 180_000
    assert held[-1] - held[6] < 0.5e6  # bytes, over the last forty minutes
