"""Headings of all rows beside a gyro: python -m benchmarks.smoothing [--draws 4] [--quick].

Simulated vehicles with truth, and recordings of BROAD with optical truth, beside the offline filter
of the package vqf with the same calibrated field. The recordings lie in ../shared/recordings, or
in the folder that AGONIC_RECORDINGS names.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import agonic as ag
from agonic.calibration.affine import Affine
from agonic.calibration.setup import Compass, Setup
from agonic.headings.compute import heading
from agonic.headings.gyro import LONGEST_STEP_S
from agonic.samples import Samples
from agonic.simulation import simulate, with_inertial_unit
from benchmarks import tables
from benchmarks.tables import Array

FIELD, DIP_DEG, DECLINATION_DEG = 50_000.0, 65.0, 2.0
SECONDS, RATE_HZ = 180.0, 20.0
FIRST_SEED = 200
NOISE = 100.0
CALIBRATION_SD = np.array([150.0] * 3 + [3e-3] * 6)
STEEPEST_DEG = 75.0
"""Of pitch: beyond, a heading is next to none."""
STILL = {"stray_nT_A": (0.0, 0.0, 0.0)}
VEHICLES: dict[str, tuple[str, dict[str, Any]]] = {
    "hand": ("hand", {}),
    "car in town": ("car", {}),
    "boat in waves": ("boat", {}),
    "plane, banked turns": ("flight", STILL),
    "plane, cruise": ("flight", {"leg_s": 100.0, **STILL}),
    "quadrotor": ("flight", {"vehicle": "copter", **STILL}),
}
FOLDER = Path(os.environ.get("AGONIC_RECORDINGS", "../shared/recordings")) / "vehicle/broad"
TRIALS = ("02", "05", "07", "12", "28", "32", "34")
ROW, SMOOTHED, VQF, TUNED = "each row", "smoothed", "VQF", "VQF, tuned"
WAYS, STATED = (ROW, VQF, TUNED, SMOOTHED), (ROW, SMOOTHED)
HEADER = (*(f"{way}, °" for way in WAYS), *(f"{way}: error/sd" for way in STATED))
INTRODUCTION = """Rms of the heading's error, degrees, and of the error over the stated standard
error, where pitch is below {steepest:g}°; behind the stroke that of the worst draw. `{vqf}` is the
offline filter of nine axes of the package vqf, as it comes, with the same calibrated field;
`{tuned}` follows the accelerometer with the time constant that agonic gives it, {settling:g} s,
and rejects no disturbances. Neither states a standard error, or reckons with the acceleration of
turns. Where the gyro would not make the stated standard error smaller, `smoothed` is each row by
itself.

{draws} draws of each vehicle, {seconds:g} s at {rate:g} Hz, dip {dip:g}°, noise {noise:g} nT, no
roll and pitch and no track in the log; gyro off by 0.5°/s and 1 %, accelerometer by 0.05 m/s². The
calibration is off by 150 nT and 0.3 %, as it states."""
EXACT = "The same where the calibration is exactly known, and says so."
RECORDED = """Trials of BROAD, hand-held, by the calibration and the delay that are found from trial
02 without its optics; errors about their mean, as the direction of north in the room is not known.
A magnet is passed in 28 and carried along for a part of 32 and 34."""
NO_FOLDER = "The recordings were not found: set AGONIC_RECORDINGS."


class Scene(NamedTuple):
    """What is logged, how it is read, and the true heading (n,) and rows (n,) that are judged."""

    logged: Samples
    setup: Setup
    truth_deg: Array
    rows: Array
    about_mean: bool = False


class Score(NamedTuple):
    """Errors (m,), degrees, by each way, and over their standard errors where one is stated."""

    errors: dict[str, Array]
    ratios: dict[str, Array]


def drive(vehicle: str, seed: int, *, exact: bool) -> Scene:
    """A simulated vehicle with a common inertial unit, and a calibration off by what it states."""
    kind, settings = VEHICLES[vehicle]
    rng = np.random.default_rng([seed, 1])
    sd = np.zeros(9) if exact else CALIBRATION_SD
    off = sd * rng.standard_normal(9)
    xx, yy, zz, xy, xz, yz = off[3:]
    known = Affine(bias=np.zeros(3), matrix=np.eye(3), magnitude=FIELD, noise=NOISE)
    true = simulate(
        kind, n=round(SECONDS * RATE_HZ), rate_Hz=RATE_HZ, seed=seed, noise=NOISE,
        magnitude=FIELD, inclination_deg=DIP_DEG, declination_deg=DECLINATION_DEG,
        calibration=known, **settings,
    ).samples  # fmt: skip
    logged = with_inertial_unit(seed=int(rng.integers(2**31)))(true)
    logged = logged.with_columns(latitude_deg=None, longitude_deg=None, altitude_m=None)
    matrix = np.eye(3) + np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    used = replace(known, bias=off[:3], matrix=matrix, covariance=np.diag(sd**2))
    dip = np.radians(DIP_DEG)
    setup = Setup(
        compasses=(Compass(calibration=used),),
        tilt="gyro",
        declination_deg=DECLINATION_DEG,
        horizontal=FIELD * np.cos(dip),
        vertical=FIELD * np.sin(dip),
    )
    assert true.heading_deg is not None
    assert true.pitch_deg is not None
    return Scene(logged, setup, true.heading_deg, np.abs(true.pitch_deg) < STEEPEST_DEG)


def open_trials() -> Iterator[tuple[str, Scene]]:
    """The trials of BROAD with what trial 02 says of the sensor."""
    paths = [next(FOLDER.glob(f"{trial}_*.mat")) for trial in TRIALS]
    first = without_optics(ag.read(paths[0]))
    delay = ag.fit_latency(first).latency_s
    fit = ag.fit_inertial(ag.undelayed(first, delay))
    setup = Setup(
        compasses=(Compass(calibration=fit.calibration, latency_s=delay),),
        tilt="gyro",
        declination_deg=0.0,
    )
    for path in paths:
        samples = ag.read(path)
        assert samples.heading_deg is not None
        assert samples.pitch_deg is not None
        rows = np.abs(samples.pitch_deg) < STEEPEST_DEG
        bare = without_optics(samples)
        yield path.stem[:2], Scene(bare, setup, samples.heading_deg, rows, about_mean=True)


def without_optics(samples: Samples) -> Samples:
    """What the sensors alone have logged."""
    return samples.with_columns(roll_deg=None, pitch_deg=None, heading_deg=None)


def filter_nine_axes(scene: Scene, settings: dict[str, Any]) -> Array:
    """True heading (n,), degrees, by the offline filter of vqf."""
    from vqf import offlineVQF

    logged, (compass,) = scene.logged, scene.setup.compasses
    assert logged.time is not None
    assert logged.acceleration is not None
    assert logged.rotation_rate is not None
    field = compass.calibration.correct(logged.field)
    step = float(np.median(np.diff(logged.time)))
    step /= np.ceil(step / LONGEST_STEP_S)  # it holds a rate for the whole step
    even = np.arange(logged.time[0], logged.time[-1] + step, step)
    rate, force, field = (
        np.stack([np.interp(even + late, logged.time, axis) for axis in values.T], axis=1)
        for values, late in (
            (logged.rotation_rate, 0.0),
            (logged.acceleration, 0.0),
            (field, compass.latency_s),
        )
    )
    w, x, y, z = offlineVQF(rate, force, field, step, settings)["quat9D"].T
    ahead = np.arctan2(1.0 - 2.0 * (y**2 + z**2), 2.0 * (x * y + w * z))  # of x to east and north
    found = np.interp(logged.time, even, np.unwrap(ahead))
    return np.asarray(np.degrees(found) + (scene.setup.declination_deg or 0.0))


def judge(scene: Scene) -> Score:
    """Each way against the truth."""
    by_row, smoothed = (heading(scene.logged, scene.setup, smooth=way) for way in (False, True))
    found = {ROW: by_row.true_deg, SMOOTHED: smoothed.true_deg}
    if find_spec("vqf") is not None:
        found[VQF] = filter_nine_axes(scene, {})
        tuned = {"tauAcc": scene.setup.settling_s, "magDistRejectionEnabled": False}
        found[TUNED] = filter_nine_axes(scene, tuned)
    errors = {name: _find_errors(scene, values) for name, values in found.items()}
    sds = {ROW: by_row.sd_deg, SMOOTHED: smoothed.sd_deg}
    return Score(errors, {name: errors[name] / sd[scene.rows] for name, sd in sds.items()})


def _find_errors(scene: Scene, found: Array) -> Array:
    off = np.exp(1j * np.radians(found - scene.truth_deg))[scene.rows]
    if scene.about_mean:
        off = off * np.exp(-1j * np.angle(np.nanmean(off)))
    return np.asarray(np.degrees(np.angle(off)))


def rms(values: Array) -> float:
    """Over the rows that have a heading."""
    return float(np.sqrt(np.nanmean(np.square(values))))


def write_row(name: str, scores: list[Score]) -> list[str]:
    """A vehicle or trial: the rms of all draws, of the ratios also that of the worst."""
    cells = [name]
    for way in WAYS:
        every = [one.errors[way] for one in scores if way in one.errors]
        cells.append(f"{rms(np.concatenate(every)):.2g}" if every else tables.NOT_INSTALLED)
    for way in STATED:
        each = [rms(one.ratios[way]) for one in scores]
        worst = f" / {max(each):.2f}" if len(each) > 1 else ""
        cells.append(f"{rms(np.concatenate([one.ratios[way] for one in scores])):.2f}{worst}")
    return cells


def describe_vehicles(draws: int, *, exact: bool) -> str:
    """The table of simulated vehicles."""
    rows = []
    for vehicle in VEHICLES:
        tables.progress(f"smoothing: {vehicle}")
        seeds = range(FIRST_SEED, FIRST_SEED + draws)
        rows.append(write_row(vehicle, [judge(drive(vehicle, s, exact=exact)) for s in seeds]))
    return tables.markdown(("vehicle", *HEADER), rows)


def describe_trials() -> str:
    """The table of recordings."""
    rows = []
    for trial, scene in open_trials():
        tables.progress(f"smoothing: trial {trial}")
        rows.append(write_row(trial, [judge(scene)]))
    return tables.markdown(("trial", *HEADER), rows)


def main() -> None:
    """Everything, as three tables."""
    asked = tables.arguments("headings of all rows beside a gyro", draws=4)
    draws = 1 if asked.quick else asked.draws
    told = INTRODUCTION.format(
        steepest=STEEPEST_DEG, vqf=VQF, tuned=TUNED, settling=Setup.settling_s, draws=draws,
        seconds=SECONDS, rate=RATE_HZ, dip=DIP_DEG, noise=NOISE,
    )  # fmt: skip
    parts = [told, describe_vehicles(draws, exact=False)]
    parts += [EXACT, describe_vehicles(draws, exact=True)]
    parts += [RECORDED, describe_trials()] if FOLDER.is_dir() and not asked.quick else [NO_FOLDER]
    print("\n\n".join(parts))


if __name__ == "__main__":
    main()
