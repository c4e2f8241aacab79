"""What accelerometer and gyro add: python -m benchmarks.inertial [--draws 2] [--quick]."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.headings.acceleration import AT_REST
from agonic.headings.gyro import filter_down
from agonic.maths.rotations import tilt as kernel
from agonic.simulation import simulate, with_inertial_unit
from agonic.simulation.sensor import Simulated
from benchmarks import inertial_published, inertial_recordings, shots, tables

TILTS = (1.0, 3.0, 5.0, 10.0, 20.0, 40.0)
BIASES = (0.05, 0.1)
MOTIONS = {"car": 4.0, "boat": 8.0, "flight": 25.0, "hand": 60.0}
INTRODUCTION = """Two minutes at 50 Hz, 200 nT of noise, dip 65°, gyro off by 0.5°/s and 1 %, noise
densities 0.02 m/s²/√Hz and 8.7e-4 rad/s/√Hz; {draws} draws. rms error of headings at all azimuths
and tilts up to that of the row, in the sensor's own axes, degrees; how many were not refused; error
of the bias over its standard error, rms. The rivals: the magnitude alone, and the levelled fit with
the tilt of VQF."""


class Tried(NamedTuple):
    """Heading error, whether it was not refused, and errors of the bias over their sds (3,)."""

    error: float
    kept: bool
    z: np.ndarray


def heading_error_deg(fit: ag.Fit, made: Simulated, tilt_deg: float) -> float:
    """rms over headings and tilts up to `tilt_deg`, in the sensor's own axes."""
    rng = np.random.default_rng(5)
    heading = np.repeat(np.arange(0.0, 360.0, 10.0), 10)
    side, tilt = rng.uniform(0, 1, (2, len(heading))) * [[2 * np.pi], [np.radians(tilt_deg)]]
    lean = np.stack([tilt * np.cos(side), tilt * np.sin(side), 0 * tilt], axis=1)
    turned = Rotation.from_euler("z", heading[:, None], degrees=True) * Rotation.from_rotvec(lean)
    truth, found = made.truth, fit.calibration
    raw = turned.apply(made.field_n, inverse=True) @ np.linalg.inv(truth.matrix).T + truth.bias
    north, east, _ = turned.apply((raw - found.bias) @ polar(found.matrix)[1].T).T
    return float(np.sqrt(np.mean(np.degrees(np.arctan2(east, north)) ** 2)))


def by_vqf(samples: ag.Samples, place: ag.Reference) -> ag.Fit:
    """The levelled fit with the tilt of a filter."""
    found, _ = filter_down(samples.time, samples.acceleration, samples.rotation_rate, 3.0, AT_REST)
    roll, pitch = kernel.roll_pitch_deg(kernel.tilt_from_down(found.down))
    return ag.fit_levelled(samples.with_columns(roll_deg=roll, pitch_deg=pitch), place)


def try_all(kind: str, tilt: float, bias: float, seed: int, **settings) -> list[Tried]:
    """The three fits of one draw."""
    made = simulate(kind, seed=seed, inclination_deg=65.0, **settings)
    logged = with_inertial_unit(accelerometer_bias=bias, seed=seed)(made.samples)
    place = ag.Reference.vector(made.field_n, frame="n")
    fits = (
        ag.fit_ellipsoid(logged, ag.Reference.constant(50_000.0)),
        by_vqf(logged, place),
        ag.fit_inertial(logged, place),
    )
    return [
        Tried(
            heading_error_deg(fit, made, tilt),
            fit.verdict != "refused",
            (fit.calibration.bias - made.truth.bias) / fit.sd[:3],
        )
        for fit in fits
    ]


def row(name: str, draws: Iterable[list[Tried]]) -> list[str]:
    """A row of the table: error, kept, error over sd of each fit."""
    cells = [name]
    for tried in zip(*draws, strict=True):
        error = np.sqrt(np.mean([one.error**2 for one in tried]))
        z = np.sqrt(np.mean([one.z**2 for one in tried]))
        cells += [f"{error:.2f}", f"{sum(one.kept for one in tried)}/{len(tried)}", f"{z:.2f}"]
    return cells


def simulated(draws: int, quick: bool) -> str:
    """The table of simulated vehicles."""
    rows = []
    for bias in BIASES[: 1 if quick else None]:
        for tilt_deg in TILTS[::3] if quick else TILTS:
            name = f"tilt {tilt_deg:g}°, accelerometer {bias:g} m/s²"
            tables.progress(name)
            rows.append(
                row(
                    name,
                    [
                        try_all("circle", tilt_deg, bias, seed, n=6000, tilt_deg=tilt_deg)
                        for seed in range(draws)
                    ],
                )
            )
    for kind, tilt_deg in MOTIONS.items():
        tables.progress(kind)
        more = {"stray_nT_A": (0.0, 0.0, 0.0)} if kind == "flight" else {}
        every = [
            try_all(kind, tilt_deg, 0.05, s, n=4000, rate_Hz=25.0, **more) for s in range(draws)
        ]
        rows.append(row(kind, every))
    columns = [
        f"{fit}: {what}"
        for fit in ("ellipsoid", "VQF, levelled", "inertial")
        for what in ("error", "kept", "error/sd")
    ]
    return tables.markdown(["vehicle", *columns], rows)


def main() -> None:
    """The tables of simulated vehicles, and of shots."""
    asked = tables.arguments("calibrations beside accelerometer and gyro", draws=2)
    draws = min(asked.draws, 2) if asked.quick else asked.draws
    print(INTRODUCTION.format(draws=draws) + "\n\n" + simulated(draws, asked.quick))
    print("\n" + shots.describe(4 if asked.quick else 5 * draws))
    print("\n" + inertial_published.describe(2 if asked.quick else 20 * draws))
    if inertial_recordings.FOLDER.exists() and not asked.quick:
        print("\n" + inertial_recordings.describe())


if __name__ == "__main__":
    main()
