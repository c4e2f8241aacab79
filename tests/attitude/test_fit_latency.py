"""`agonic fit latency` as a person or a script would run it."""

import json

import pytest

import agonic as ag
from agonic.cli import run
from agonic.simulation import delayed, simulate

pytestmark = pytest.mark.usefixtures("empty_folder")


def write(kind: str = "hand", late_s: float = 0.025, **changed) -> None:
    late = delayed(late_s)(simulate(kind, n=2000, seed=1).samples)
    ag.write_csv(late.with_columns(**changed), "log.csv")


def test_a_latency_is_printed_with_what_to_do(capsys) -> None:
    write()
    assert run(["fit", "latency", "log.csv"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "25.0 ± " in said
    assert "ms late relative to the recorded attitude; take it out" in said


@pytest.mark.parametrize("method", ["attitude", "gyro"])
def test_json_holds_one_object(method: str, capsys) -> None:
    write(late_s=0.04)
    assert run(["fit", "latency", "log.csv", "--method", method, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["schema"] == "agonic/fit-latency@1"
    (sensor,) = said["sensors"]
    assert sensor["latency_ms"] == pytest.approx(40, abs=4 * sensor["latency_sd_ms"])
    assert sensor["latency_sd_ms"] < 0.2
    assert (sensor["significant"], sensor["method"]) == (True, method)
    assert sensor["residual_after"] < 0.5 * sensor["residual_before"]


def test_a_log_that_tells_nothing_is_a_failed_check(capsys) -> None:
    write("static")
    assert run(["fit", "latency", "log.csv", "--json"]) == 1
    (sensor,) = json.loads(capsys.readouterr().out)["sensors"]
    assert (sensor["known"], sensor["significant"]) == (False, False)
    assert "turn the sensor quickly back and forth" in sensor["status"]


@pytest.mark.parametrize(
    ("options", "changed", "said"),
    [
        ([], {"heading_deg": None, "rotation_rate": None}, "no columns of roll, pitch and heading"),
        ([], {"time": None}, "needs the times"),
        (["--method", "radio"], {}, "method 'radio' is not known"),
        (["--limit", "-5"], {}, "above zero"),
        (["--sensor", "MAG7"], {}, "MAG7"),
    ],
)
def test_bad_input_is_one_line_and_exit_two(options, changed, said: str, capsys) -> None:
    write(**changed)
    assert run(["fit", "latency", "log.csv", *options]) == 2
    seen = capsys.readouterr()
    assert said in seen.err
    assert seen.err.count("\n") == 1
    assert seen.out == ""
