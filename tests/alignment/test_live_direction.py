"""The direction of the field in real time: late, out-of-order and missing attitudes, nothing lost,
by a chain of elementary rotations of its own."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import erfa
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.alignment.direction.follow import Follower
from agonic.alignment.direction.result import FieldDirection
from agonic.alignment.session.earth import load_earth_rotation
from agonic.alignment.session.session import Site, StarReadings
from agonic.cli import run
from tests.command_line import complaint

Array = NDArray[np.float64]
START = 1_772_400_000.0  # 2026-03-01 21:20 UTC
RATE_HZ, STAR_HZ = 1000.0, 10.0
SITE = Site(latitude_deg=52.1, longitude_deg=5.2)
ARCSEC = np.radians(1 / 3600)
FIELD_N = np.array([18_900.0, 600.0, 45_800.0])
TURN_MC = erfa.rz(0.7, erfa.ry(1.1, erfa.rz(0.3, np.eye(3))))
"""Star sensor components into the magnetometer's."""


def rot_ci(unix_s: Array) -> Array:
    """A platform that turns evenly, 3° a second: in between, attitudes follow exactly."""
    turns = np.radians(3.0) * (unix_s - START)[:, None] * np.array([0.48, 0.6, 0.64])
    first = erfa.rz(2.0, erfa.ry(0.5, erfa.rz(-1.0, np.eye(3))))
    return Rotation.from_rotvec(turns).as_matrix() @ first


def rot_ei(unix_s: float) -> Array:
    """Celestial into Earth-fixed axes by ERFA's chain of IAU 2006/2000A, with the IERS's table."""
    ut1_tai, x, y = (float(one[0]) for one in load_earth_rotation().at(unix_s))
    utc1, utc2 = 2_440_587.5, unix_s / 86_400
    tai1, tai2 = erfa.utctai(utc1, utc2)
    tt1, tt2 = erfa.taitt(tai1, tai2)
    ut11, ut12 = erfa.taiut1(tai1, tai2, ut1_tai)
    return erfa.c2t06a(tt1, tt2, ut11, ut12, x, y)


def record(seconds: float) -> tuple[ag.Samples, StarReadings]:
    """Readings at 1 kHz of the field of one place, and attitudes at 10 Hz."""
    when = START + np.arange(round(seconds * RATE_HZ)) / RATE_HZ + 2.5e-4
    latitude, longitude = np.radians([SITE.latitude_deg, SITE.longitude_deg])
    down = erfa.ry(np.pi / 2 + latitude, np.eye(3))
    rot_en = erfa.rz(-longitude, down)
    middle = rot_ei(float(when.mean()))
    rate = 7.292115e-5
    earth = np.array([erfa.rz(rate * (t - when.mean()), middle) for t in when])
    field_i = np.einsum("nji,j->ni", earth, rot_en @ FIELD_N)
    field_c = np.einsum("nij,nj->ni", rot_ci(when), field_i)
    samples = ag.Samples(
        field=field_c @ TURN_MC.T,
        unit="nT",
        time=when - START,
        epoch=datetime.fromtimestamp(START, UTC),
    )
    t = START + np.arange(round(seconds * STAR_HZ) + 1) / STAR_HZ
    stars = StarReadings(
        time=t,
        orientation=np.zeros(len(t), dtype=np.int64),
        rot_ci=rot_ci(t),
        covariance=np.broadcast_to(np.eye(3) * (2 * ARCSEC) ** 2, (len(t), 3, 3)),
    )
    return samples, stars


def alignment() -> ag.alignment.Alignment:
    turn = Rotation.from_matrix(TURN_MC.T)
    return ag.alignment.Alignment(rotation=turn, covariance=np.eye(3) * ARCSEC**2, frame_out="c")


def check_chain(found: FieldDirection, samples: ag.Samples) -> None:
    """Every reading in all four systems of axes against the chain written out here, to 0.01″."""
    own = dict(zip((START + samples.time).round(5).tolist(), samples.field, strict=True))
    rot_ne = erfa.rz(-np.radians(5.2), erfa.ry(np.pi / 2 + np.radians(52.1), np.eye(3))).T
    for k in range(0, len(found), 97):
        raw = own[round(float(found.time[k]), 5)]
        celestial = rot_ci(found.time[k : k + 1])[0].T @ TURN_MC.T @ raw
        fixed = rot_ei(float(found.time[k])) @ celestial
        for vector, here in (
            (TURN_MC.T @ raw, found.field_c[k]),
            (celestial, found.field_i[k]),
            (fixed, found.field_e[k]),
            (rot_ne @ fixed, found.field_n[k]),
        ):
            off = np.linalg.norm(np.cross(vector, here)) / (vector @ vector)
            assert off < 0.01 * ARCSEC
            assert np.linalg.norm(here) == pytest.approx(np.linalg.norm(raw), rel=1e-10)


def stream(
    samples: ag.Samples, stars: StarReadings, arrival: Array
) -> Iterator[tuple[ag.Samples, StarReadings]]:
    """What comes within each hundredth of a second; attitudes at their `arrival`, inf for never."""
    for k in range(int(samples.time[-1] * 100) + 200):
        low, high = k / 100, (k + 1) / 100
        rows = np.flatnonzero((samples.time >= low) & (samples.time < high))
        came = np.flatnonzero((arrival - START >= low) & (arrival - START < high))
        order = came[np.argsort(arrival[came], kind="stable")]
        yield (samples.select(rows) if len(rows) else None), stars.select(order)


def follow(
    samples: ag.Samples, stars: StarReadings, arrival: Array, **settings: float
) -> tuple[FieldDirection | None, list[FieldDirection], Follower]:
    follower = Follower(alignment(), SITE, **settings)
    parts = []
    for readings, attitudes in stream(samples, stars, arrival):
        follower.add(*(one for one in (readings, attitudes) if one is not None))
        if (found := follower.take()) is not None:
            parts.append(found)
    if (found := follower.finish()) is not None:
        parts.append(found)
    return (parts[0] if parts else None), parts, follower


def times(parts: list[FieldDirection]) -> Array:
    return np.concatenate([part.time for part in parts])


def late(stars: StarReadings, seed: int) -> Array:
    """Arrivals 50 ms late, and of each fifth up to 0.35 s more, behind those after it."""
    delay = np.full(len(stars), 0.05)
    delay[::5] += np.random.default_rng(seed).uniform(0.15, 0.35, len(delay[::5]))
    return stars.time + delay


@pytest.mark.parametrize("seed", [0, 1])
def test_late_and_out_of_order_attitudes_lose_nothing(seed: int) -> None:
    samples, stars = record(6.0)
    _, parts, follower = follow(samples, stars, late(stars, seed))
    np.testing.assert_allclose(np.sort(times(parts)), START + samples.time, atol=1e-6)
    assert (follower.left_out, follower.waiting) == (0, 0)
    for part in parts:
        check_chain(part, samples)
    whole = ag.alignment.field_direction(alignment(), samples, stars, SITE)
    order = np.argsort(times(parts))
    for name in ("field_i", "covariance_i", "field_n"):
        live = np.concatenate([getattr(part, name) for part in parts])[order]
        np.testing.assert_allclose(live, getattr(whole, name), rtol=1e-9, atol=1e-6)


def test_readings_that_come_late_still_find_their_attitudes() -> None:
    samples, stars = record(4.0)
    follower = Follower(alignment(), SITE)
    follower.add(stars)
    odd = np.arange(len(samples)) % 2 == 1
    follower.add(samples.select(~odd))
    first = follower.take()
    follower.add(samples.select(odd))
    second = follower.take()
    assert (len(first), len(second), follower.left_out) == (2000, 2000, 0)
    check_chain(second, samples)


def test_missing_attitudes_are_bridged_up_to_the_gap_and_counted_beyond() -> None:
    samples, stars = record(6.0)
    arrival = stars.time.copy()
    t = stars.time - START
    arrival[(t > 0.95) & (t < 1.25)] = np.inf  # 3 missing: a gap of 0.4 s
    arrival[(t > 2.95) & (t < 3.85)] = np.inf  # 9 missing: a gap of 1 s
    _, parts, follower = follow(samples, stars, arrival)
    gone = (samples.time > 2.9) & (samples.time < 3.9)
    np.testing.assert_allclose(np.sort(times(parts)), START + samples.time[~gone], atol=1e-6)
    assert follower.left_out == int(gone.sum())
    for part in parts:
        check_chain(part, samples)
    _, parts, follower = follow(samples, stars, arrival, gap_s=1.5)
    assert (sum(map(len, parts)), follower.left_out) == (len(samples), 0)
    _, parts, follower = follow(samples, stars, np.full(len(stars), np.inf))
    assert (parts, follower.left_out, follower.waiting) == ([], len(samples), 0)


def test_standard_errors_are_those_of_noise_attitude_and_alignment() -> None:
    """Over many draws of attitudes: error over σ of the direction, 0 ± 1."""
    samples, stars = record(2.0)
    some = samples.select(np.arange(5, 2000, 83))
    truth = ag.alignment.field_direction(alignment(), some, stars, SITE)
    z = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        turns = Rotation.from_rotvec(2 * ARCSEC * rng.normal(size=(len(stars), 3)))
        noisy = replace(stars, rot_ci=turns.as_matrix() @ stars.rot_ci)
        turned = Rotation.from_rotvec(ARCSEC * rng.normal(size=3)) * alignment().rotation
        drawn = replace(alignment(), rotation=turned)
        follower = Follower(drawn, SITE, noise=0.5)
        raw = some.field + 0.5 * rng.normal(size=some.field.shape)
        follower.add(some.with_columns(field=raw), noisy)
        found = follower.take()
        assert len(found) == len(some)
        for name in ("declination", "inclination"):
            error = getattr(found, f"{name}_deg") - getattr(truth, f"{name}_deg")
            z.append(error / getattr(found, f"{name}_sd_deg"))
    assert np.sqrt(np.mean(np.square(z))) == pytest.approx(1.0, abs=0.12)
    assert abs(np.mean(z)) < 0.2


def test_a_thousand_readings_a_second_take_less_than_five_milliseconds_each() -> None:
    samples, stars = record(4.0)
    follower = Follower(alignment(), SITE, noise=0.1)
    spent, shown = [], 0
    for readings, attitudes in stream(samples, stars, stars.time):
        begun = time.process_time()
        follower.add(*(one for one in (readings, attitudes) if one is not None))
        found = follower.take()
        spent.append(time.process_time() - begun)
        shown += 0 if found is None else len([*found.records()])
    assert shown == len(samples)
    assert sum(spent) / shown < 1e-3  # what keeps up with 1 kHz
    assert np.median(spent) < 5e-3


# --- the command ---------------------------------------------------------------------------------


@pytest.fixture
def calibration(tmp_path: Path) -> str:
    return str(ag.save(alignment(), tmp_path / "cal.json"))


def star_line(stars: StarReadings, k: int) -> str:
    w, x, y, z = Rotation.from_matrix(stars.rot_ci[k]).as_quat(scalar_first=True)
    return f"star,{stars.time[k]:.6f},{w:.15f},{x:.15f},{y:.15f},{z:.15f},2,2"


def mag_line(samples: ag.Samples, k: int) -> str:
    x, y, z = samples.field[k]
    return f"{START + samples.time[k]:.6f},{x:.6f},{y:.6f},{z:.6f}"


HERE = ("--at", "52.1,5.2")
HEADER = "unix_s,mag_x_nT,mag_y_nT,mag_z_nT"


def as_found(lines: list[str]) -> FieldDirection:
    rows = [json.loads(line) for line in lines]
    assert {row["schema"] for row in rows} == {"agonic/live-direction@1"}
    fields = {
        f"field_{letter}": np.array([row[f"field_{letter}_nT"] for row in rows])
        for letter in "cien"
    }
    none = np.zeros((len(rows), 3, 3))
    unix = np.array([row["unix_s"] for row in rows])
    assert min(row["sd_arcsec"] for row in rows) > 1
    return FieldDirection(
        rows=np.arange(len(rows)), time=unix, **fields, covariance_i=none, random_covariance_i=none
    )


def test_standard_input_to_lines_of_json(calibration: str) -> None:
    """Beside a second magnetometer, which is left aside, and a line that is no attitude."""
    samples, stars = record(2.0)
    lines = [f"{HEADER},mag2_x_nT,mag2_y_nT,mag2_z_nT"]
    for k in range(len(samples)):
        if k % 100 == 0:
            lines.append(star_line(stars, k // 100))
        lines.append(f"{mag_line(samples, k)},1,2,3")
    lines += ["star,nonsense", star_line(stars, len(stars) - 1)]
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "agonic",
            "direction",
            calibration,
            "--live",
            "-",
            *HERE,
        ],
        input="\n".join(lines) + "\n",
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    shown = done.stdout.splitlines()
    assert len(shown) == len(samples)
    check_chain(as_found(shown), samples)
    assert "2000 readings with a direction, 0 without attitude" in done.stderr
    assert "an attitude was left out: 1 cells under unix_s, quat_w" in done.stderr


def test_udp_at_a_kilohertz_with_late_attitudes(calibration: str) -> None:
    samples, stars = record(3.0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "agonic", "direction", calibration]
    command += ["--live", f"udp://127.0.0.1:{port}", *HERE]
    arrival = late(stars, 3)
    came: dict[float, float] = {}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert "connected" in process.stderr.readline()
        lines: list[str] = []

        def listen() -> None:
            for line in process.stdout:
                came[round(json.loads(line)["unix_s"], 5)] = time.monotonic()
                lines.append(line)

        ear = threading.Thread(target=listen)
        ear.start()
        todo = [(START + t, mag_line(samples, k)) for k, t in enumerate(samples.time)]
        todo += [(t, star_line(stars, k)) for k, t in enumerate(arrival)]
        wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        wire.sendto(f"{HEADER}\n".encode(), ("127.0.0.1", port))
        begun = time.monotonic() + 0.3
        for when, text in sorted(todo):
            time.sleep(max(0.0, begun + when - START - time.monotonic()))
            wire.sendto(text.encode(), ("127.0.0.1", port))
        wire.close()
        time.sleep(1.5)
        process.terminate()
        ear.join()
    assert len(lines) == len(samples)
    check_chain(as_found(lines), samples)
    ready = np.array([_find_ready(t, stars.time, arrival) for t in START + samples.time])
    out = np.array([came[round(START + t, 5)] for t in samples.time])
    waited = out - (begun + ready - START)
    print("waited, ms:", 1e3 * np.percentile(waited, [5, 50, 95, 99]))
    assert np.median(waited) < 0.2  # with what else this machine does; alone 0.008


def _find_ready(t: float, star: Array, arrival: Array) -> float:
    """When both attitudes around a moment have come."""
    after = int(np.searchsorted(star, t))
    return float(max(t, arrival[after - 1], arrival[after]))


def test_what_does_not_go_together_is_said(calibration: str, capsys, tmp_path: Path) -> None:
    assert "leave LOG, -o and --report out" in complaint(
        capsys, "direction", calibration, "log.csv", "--live", "-"
    )
    assert "--live SOURCE" in complaint(capsys, "direction", calibration)
    assert "names no source" in complaint(capsys, "direction", calibration, "--live", "x://y")


def test_a_log_is_replayed_beside_a_table_of_attitudes(
    calibration: str, tmp_path: Path, capsys
) -> None:
    samples, stars = record(1.0)
    log = tmp_path / "log.csv"
    log.write_text("\n".join([HEADER, *(mag_line(samples, k) for k in range(len(samples)))]) + "\n")
    table = tmp_path / "stars.csv"
    names = "unix_s,quat_w,quat_x,quat_y,quat_z,across_sd_arcsec,about_sd_arcsec"
    own = [star_line(stars, k).removeprefix("star,") for k in range(len(stars))]
    table.write_text("\n".join([names, *own]) + "\n")
    options = ["--live", str(log), "--stars", str(table), *HERE]
    assert run(["direction", calibration, *options]) == 0
    check_chain(as_found(capsys.readouterr().out.splitlines()), samples)
