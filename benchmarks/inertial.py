"""What accelerometer and gyro add: python -m benchmarks.inertial [--draws 5] [--quick]."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.maths.rotations import tilt as kernel
from agonic.maths.rotations.tilt import heading_by_vectors_deg
from agonic.simulation import simulate, with_inertial_unit
from agonic.simulation.draws import random_calibration
from agonic.simulation.sensor import Simulated
from agonic.units import STANDARD_GRAVITY_M_S2
from benchmarks import inertial_published, inertial_recordings, shots, tables
from benchmarks.inertial_rivals import Found, by_kalman, by_scipy, by_vqf

TILTS = (1.0, 3.0, 5.0, 10.0, 20.0, 40.0)
BIASES = (0.05, 0.1)
MOTIONS = {"car": 4.0, "boat": 8.0, "flight": 25.0, "hand": 60.0}
NOISE_NT = 200.0
INTRODUCTION = """Two minutes at 25 Hz, 200 nT of noise, dip 65°, noise densities 0.02 m/s²/√Hz and
8.7e-4 rad/s/√Hz; {draws} draws, in which soft iron, the turn between the sensors, the gyro's bias
and scale scatter as the priors of the fit say. rms error of headings at all azimuths and tilts up
to that of the row, degrees: in the sensor's own axes and the true level, or as it is used, by the
tilt that the accelerometer reads and but for one constant angle, whichever is less. How many were
not refused; error of the bias over its standard error, rms.
The rivals: the magnitude alone by agonic and by SciPy, the levelled fit with the tilt of VQF, and
an error-state Kalman filter that starts where agonic's magnitude fit ends."""


class Tried(NamedTuple):
    """Heading errors (2,), in own axes and but for a constant; whether it was not refused, and
    errors of the bias over their sds (3,), where there are any."""

    errors: np.ndarray
    kept: bool
    z: np.ndarray | None


def heading_errors_deg(bias, matrix, made: Simulated, tilt_deg: float, unit) -> np.ndarray:
    """rms over headings and tilts up to `tilt_deg`: in the sensor's own axes, whatever its turn;
    and as it is used, by the tilt that the accelerometer of the `unit` reads, about the mean."""
    rng = np.random.default_rng(5)
    heading = np.repeat(np.arange(0.0, 360.0, 10.0), 10)
    side, tilt = rng.uniform(0, 1, (2, len(heading))) * [[2 * np.pi], [np.radians(tilt_deg)]]
    lean = np.stack([tilt * np.cos(side), tilt * np.sin(side), 0 * tilt], axis=1)
    turned = Rotation.from_euler("z", heading[:, None], degrees=True) * Rotation.from_rotvec(lean)
    truth = made.truth
    raw = turned.apply(made.field_n, inverse=True) @ np.linalg.inv(truth.matrix).T + truth.bias
    north, east, _ = turned.apply((raw - bias) @ polar(matrix)[1].T).T
    own = np.degrees(np.arctan2(east, north))
    still = turned.apply([0.0, 0.0, -STANDARD_GRAVITY_M_S2], inverse=True)
    columns = {"acceleration": still, "rotation_rate": np.zeros_like(still)}
    read = with_inertial_unit(**unit, accelerometer_noise=0.0)(
        ag.Samples(field=raw, time=np.arange(len(raw), dtype=float), **columns)
    )
    down = kernel.down_from_force(read.acceleration)
    compass = heading_by_vectors_deg((raw - bias) @ matrix.T, down)
    nose = turned.apply(Rotation.from_rotvec(unit["turn"], degrees=True).as_matrix()[0])
    off = np.radians(compass) - np.arctan2(nose[:, 1], nose[:, 0])
    used = np.degrees(np.angle(np.exp(1j * off) / np.exp(1j * off).mean()))
    return np.sqrt([np.mean(own**2), np.mean(used**2)])


def try_all(kind: str, tilt: float, bias: float, seed: int, **settings) -> list[Tried]:
    """All fits of one draw."""
    rng = np.random.default_rng((seed, 18))
    drawn = random_calibration(rng, soft_iron=0.17)
    made = simulate(
        kind, seed=seed, inclination_deg=65.0, noise=NOISE_NT, calibration=drawn, **settings
    )
    turn_deg = 2.0 * rng.standard_normal(3)
    unit = {"accelerometer_bias": bias, "gyro_bias_deg_s": 1.0, "gyro_scale": 0.02}
    unit |= {"turn": turn_deg, "seed": seed}
    logged = with_inertial_unit(**unit)(made.samples)
    place = ag.Reference.vector(made.field_n, frame="n")
    size = float(np.linalg.norm(made.field_n))
    alone = ag.fit_ellipsoid(logged, ag.Reference.constant(size))
    fits = (
        alone,
        by_scipy(logged, size),
        by_vqf(logged, place),
        by_kalman(logged, made.field_n, alone, NOISE_NT),
        ag.fit_inertial(logged, place),
    )
    return [_judge(fit, made, tilt, unit) for fit in fits]


def _judge(fit: ag.Fit | Found, made: Simulated, tilt: float, unit: dict) -> Tried:
    """What a fit is worth against the truth."""
    found, kept = (fit, True) if isinstance(fit, Found) else (fit.calibration, not refused(fit))
    sd = None if fit.sd is None else fit.sd[:3]
    return Tried(
        heading_errors_deg(found.bias, found.matrix, made, tilt, unit),
        kept,
        None if sd is None else (found.bias - made.truth.bias) / sd,
    )


def refused(fit: ag.Fit) -> bool:
    """Whether agonic refuses it."""
    return fit.verdict == "refused"


def row(name: str, draws: Iterable[list[Tried]]) -> list[str]:
    """A row of the table: error, then kept, then error over sd, of each fit that has them."""
    cells = [name]
    for (_, asked), tried in zip(FITS, zip(*draws, strict=True), strict=True):
        error = np.sqrt(np.mean([one.errors**2 for one in tried], axis=0)).min()
        cells.append(f"{error:.2f}")
        if "kept" in asked:
            cells.append(f"{sum(one.kept for one in tried)}/{len(tried)}")
        if "error/sd" in asked:
            cells.append(f"{np.sqrt(np.mean([one.z**2 for one in tried])):.2f}")
    return cells


FITS = (
    ("ellipsoid", ("error", "kept")),
    ("SciPy", ("error",)),
    ("VQF, levelled", ("error", "kept", "error/sd")),
    ("Kalman", ("error", "error/sd")),
    ("inertial", ("error", "kept", "error/sd")),
)


def simulated(draws: int, quick: bool) -> str:
    """The table of simulated vehicles."""
    rows, circles = [], []
    for bias in BIASES[: 1 if quick else None]:
        for tilt_deg in TILTS[::3] if quick else TILTS:
            name = f"tilt {tilt_deg:g}°, accelerometer {bias:g} m/s²"
            tables.progress(name)
            more = {"n": 3000, "rate_Hz": 25.0, "tilt_deg": tilt_deg}
            every = [try_all("circle", tilt_deg, bias, s, **more) for s in range(draws)]
            rows.append(row(name, every))
            circles += every
    rows.append(row("all of these", circles))
    for kind, tilt_deg in MOTIONS.items():
        tables.progress(kind)
        more = {"stray_nT_A": (0.0, 0.0, 0.0)} if kind == "flight" else {}
        every = [
            try_all(kind, tilt_deg, 0.05, s, n=3000, rate_Hz=25.0, **more) for s in range(draws)
        ]
        rows.append(row(kind, every))
    columns = [f"{fit}: {what}" for fit, whats in FITS for what in whats]
    return tables.markdown(["vehicle", *columns], rows)


def main() -> None:
    """The tables of simulated vehicles, of the published simulation, of shots, of recordings."""
    asked = tables.arguments("calibrations beside accelerometer and gyro", draws=5)
    draws = min(asked.draws, 2) if asked.quick else asked.draws
    parts = [
        "# Inertial",
        INTRODUCTION.format(draws=draws),
        simulated(draws, asked.quick),
        "## The published simulation",
        inertial_published.describe(2 if asked.quick else 20 * draws),
    ]
    if inertial_recordings.FOLDER.exists() and not asked.quick:
        parts += ["## Recordings", inertial_recordings.describe()]
        parts += [inertial_recordings.describe_flight()]
    parts += [shots.describe(4 if asked.quick else 5 * draws)]
    print("\n\n".join(parts))


if __name__ == "__main__":
    main()
