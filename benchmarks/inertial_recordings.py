"""Recordings: hand-held ones cut to small tilts, and a flight. Alone:
python -m benchmarks.inertial_recordings.

Trials 02 and 07 of BROAD (Laidig et al. 2021), undisturbed: the fit sees the rows that are tilted
by less than so much, without place or attitude, and its headings are compared with the optical
ones. The rooms' own field leaves 2.8 to 3.9°.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

import agonic as ag
from agonic.attitude.known_heading import compute_mounted_heading
from agonic.attitude.undo_latency import undelayed
from agonic.console.place import find_reference
from agonic.maths.rotations import tilt as kernel
from agonic.maths.rotations.attitude import down_b
from benchmarks import tables

FOLDER = Path(os.environ.get("AGONIC_RECORDINGS", "../shared/recordings")) / "vehicle/broad"
TRIALS = ("02_undisturbed_slow_rotation_B.mat", "07_undisturbed_fast_rotation_B.mat")
TILTS = (60.0, 30.0, 10.0)
SMALLEST = 40
"""Rows of a stretch of small tilts that is kept."""
INTRODUCTION = """Trials 02 and 07 of BROAD, every second row, cut to tilts below so much, the delay
of the magnetometer found by the gyro and undone; rms of the heading about its mean, degrees: on
the rest of the trial that is tilted by less than 60° (beyond, where there is none), on the rows of
the fit, and within the tilt that it has seen on each half of these in time by the fit to the other;
verdict, and the heading's stated standard error, level."""


def cut(samples: ag.Samples, tilt_deg: float) -> tuple[ag.Samples, np.ndarray]:
    """The stretches of small tilt without their attitude, and which rows these are."""
    down = down_b(samples.roll_deg, samples.pitch_deg)
    within = np.degrees(np.arccos(np.clip(down[:, 2], -1.0, 1.0))) < tilt_deg
    edges = np.flatnonzero(np.diff(within.astype(int), prepend=0, append=0))
    kept = np.zeros(len(samples), dtype=bool)
    for start, stop in edges.reshape(-1, 2):
        kept[start:stop] = stop - start >= SMALLEST
    bare = samples.select(kept).with_columns(roll_deg=None, pitch_deg=None, heading_deg=None)
    return bare, kept


def scatter_deg(calibration, samples: ag.Samples, rows: np.ndarray) -> float:
    """rms of the heading about its mean, against the optical one."""
    some = samples.select(rows)
    down = down_b(some.roll_deg, some.pitch_deg)
    found = kernel.heading_by_vectors_deg(calibration.correct(some.field), down)
    off = np.exp(1j * np.radians(found - some.heading_deg))
    off *= np.exp(-1j * np.angle(off.mean()))
    return float(np.degrees(np.sqrt(np.mean(np.angle(off) ** 2))))


def judge_unseen(fit, bare: ag.Samples, samples: ag.Samples, kept: np.ndarray) -> float:
    """rms over both halves of the rows of a fit, each by the calibration of the other."""
    halves = np.array_split(np.arange(len(bare)), 2)
    found = []
    for seen, unseen in (halves, halves[::-1]):
        rows = np.flatnonzero(kept)[unseen]
        found.append(scatter_deg(fit(bare.select(seen)).calibration, samples, rows))
    return float(np.sqrt(np.mean(np.square(found))))


def describe() -> str:
    """The table of trials."""
    rows = []
    for trial in TRIALS:
        samples = ag.read(FOLDER / trial)
        bare = samples.with_columns(roll_deg=None, pitch_deg=None, heading_deg=None)
        samples = undelayed(samples, ag.fit_latency(bare).latency_s)
        samples = samples.select(np.arange(0, len(samples), 2))
        down = down_b(samples.roll_deg, samples.pitch_deg)
        usual = np.degrees(np.arccos(np.clip(down[:, 2], -1.0, 1.0))) < 60.0
        for tilt_deg in TILTS:
            tables.progress(f"{trial[:2]}, {tilt_deg:g}°")
            bare, kept = cut(samples, tilt_deg)
            rest = usual & ~kept if (usual & ~kept).sum() > 1000 else ~kept
            cells = [f"{trial[:2]}, tilt < {tilt_deg:g}°", f"{len(bare)}"]
            for fit in (ag.fit_ellipsoid, ag.fit_inertial):
                found = fit(bare)
                if fit is ag.fit_inertial:
                    own = compute_mounted_heading(found.calibration, found.coverage).own_sd_deg
                else:
                    own = found.coverage.heading_sd_deg
                cells += [
                    f"{scatter_deg(found.calibration, samples, rest):.1f}",
                    f"{scatter_deg(found.calibration, samples, kept):.1f}",
                    f"{judge_unseen(fit, bare, samples, kept):.1f}",
                    found.verdict,
                    f"{own:.2g}",
                ]
            rows.append(cells)
    whats = ("rest", "own", "unseen half", "verdict", "stated")
    columns = [f"{fit}: {what}" for fit in ("ellipsoid", "inertial") for what in whats]
    return INTRODUCTION + "\n\n" + tables.markdown(["trial", "n", *columns], rows)


FLIGHT = FOLDER.parent / "ardupilot/log171.bin"
FLOWN_S = (84.0, 236.0)
FLIGHT_INTRODUCTION = """A quadrotor's flight (log171): heading of its two internal compasses
against the external one as it was flown, all with the roll and pitch of the log, rms about the
mean, degrees; own standard error and verdict. The EKF's own yaw leaves 3 to 4°."""


def describe_flight() -> str:
    """The table of a flight: as flown, levelled, inertial, against the external compass."""
    outside = _flown("MAG")
    external = np.unwrap(np.radians(_headings_deg(outside.logged, outside)))
    place, _ = find_reference(outside, None, None, None)
    rows = []
    for name in ("MAG2", "MAG3"):
        tables.progress(f"log171, {name}")
        samples = _flown(name)
        bare = samples.with_columns(roll_deg=None, pitch_deg=None, heading_deg=None)
        known = place.select(np.minimum(np.arange(len(samples)), len(outside) - 1))
        fits = (ag.fit_levelled(samples, known), ag.fit_inertial(bare, known))
        cells = [name]
        for one in (samples.logged, *(fit.calibration for fit in fits)):
            own = np.radians(_headings_deg(one, samples))
            off = np.exp(1j * (own - np.interp(samples.time, outside.time, external)))
            off *= np.exp(-1j * np.angle(off.mean()))
            cells.append(f"{np.degrees(np.sqrt(np.mean(np.angle(off) ** 2))):.1f}")
        for fit in fits:
            own = compute_mounted_heading(fit.calibration, fit.coverage).own_sd_deg
            cells += [f"{own:.2g}", fit.verdict]
        rows.append(cells)
    whats = [f"{fit}: {what}" for fit in ("levelled", "inertial") for what in ("stated", "verdict")]
    head = ["compass", "as flown", "levelled", "inertial", *whats]
    return FLIGHT_INTRODUCTION + "\n\n" + tables.markdown(head, rows)


def _flown(sensor: str) -> ag.Samples:
    """The flight without what came before and after."""
    samples = ag.read(FLIGHT, sensor=sensor)
    return samples.select((samples.time > FLOWN_S[0]) & (samples.time < FLOWN_S[1]))


def _headings_deg(correction, samples: ag.Samples) -> np.ndarray:
    """Headings by a calibration, or a correction on board, and the roll and pitch of the log."""
    field = (samples.field - correction.bias) @ correction.matrix.T
    return kernel.heading_by_vectors_deg(field, down_b(samples.roll_deg, samples.pitch_deg))


if __name__ == "__main__":
    print(describe() + "\n\n" + describe_flight())
