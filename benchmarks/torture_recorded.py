"""The faults of `torture` laid on real recordings: python -m benchmarks.torture_recorded [--quick].

Noise, motion and surroundings are those that somebody recorded; the fault is ours, so that the
truth is known. Only stretches that are good as recorded are taken: their calibration is the truth.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

import agonic as ag
from agonic.field.place import choose_reference
from benchmarks import tables
from benchmarks.faults import KINDS, MAGNITUDE, RATE_HZ, Draft, Fault
from benchmarks.faults import Recording as TrueRecording
from benchmarks.real import BROAD, NO_FOLDER, Recording, read_recording, thin
from benchmarks.torture import HEAD, Run, judge, row

INTRODUCTION = """# Torture of real recordings

The faults of {kinds} kinds of the table above, laid on {stretches} stretches of real recordings,
each of which is good as it was recorded; its calibration is the truth, and the standard error of
that is counted in the stated one. Field scaled to 50 000 nT. Shown are the kinds with a run that
was wrong, and the sums of all."""


class Stretch(NamedTuple):
    """Rows of a recording that are good as they are, and the dip of their place, °."""

    recording: Recording
    first: int
    last: int
    dip_deg: float


FLIGHT, FLIGHT_DIP = "vehicle/ardupilot/log171.bin", -66.0
HAND, COMPASS = f"{BROAD}02_undisturbed_slow_rotation_B.mat", "imu/hmc5883l_compass.mat"
STRETCHES = (
    Stretch(Recording("pointclouds/aleksandrbazhin_mag_out.txt", "points"), 0, 347, 60.0),
    Stretch(Recording(COMPASS, "turned by hand", unit="G"), 0, 4095, 60.0),
    Stretch(Recording(COMPASS, "turned by hand", unit="G"), 2072, 3882, 60.0),
    Stretch(Recording(HAND, "hand-held"), 2771, 5009, 60.0),
    Stretch(Recording(HAND, "hand-held"), 3426, 4996, 60.0),
    Stretch(Recording(FLIGHT, "flight", "MAG2", between=(84, 236)), 323, 1103, FLIGHT_DIP),
    Stretch(Recording(FLIGHT, "flight", "MAG3", between=(84, 236)), 14, 797, FLIGHT_DIP),
)


class Base(NamedTuple):
    """A stretch as recorded: readings and reference scaled to `MAGNITUDE`, and what is true."""

    samples: ag.Samples
    reference: ag.Reference | None
    settings: dict[str, float]
    calibration: ag.Affine
    heading_sd_deg: float


def list_faults() -> list[tuple[str, tuple[Fault, ...]]]:
    """Faults by the names of their kinds, each once."""
    named: dict[tuple[Fault, ...], str] = {}
    for kind in KINDS:
        if kind.faults and not kind.good:
            named.setdefault(kind.faults, kind.name)
    return [(name, faults) for faults, name in named.items()]


def load(folder: Path, stretch: Stretch) -> Base:
    """The stretch, its reference, and its calibration."""
    samples = thin(read_recording(folder / stretch.recording.path, stretch.recording))
    samples = samples.select(np.arange(stretch.first, min(stretch.last, len(samples))))
    samples = samples.with_columns(heading_deg=None)
    reference, settings = choose_reference(samples)
    fitted = ag.calibrate(samples, reference, **settings)
    if fitted.verdict != "good":
        tables.progress(f"torture_recorded: {stretch.recording.name} is {fitted.verdict}")
    calibration = fitted.fit.calibration
    if isinstance(calibration, ag.Interference):
        calibration = calibration.at(calibration.typical)
    sd = float(fitted.fit.coverage.heading_sd_deg)
    return Base(samples, reference, settings, calibration, sd)


def lay(base: Base, faults: tuple[Fault, ...], seed: int) -> TrueRecording:
    """The recording with faults; those that need a true attitude raise AttributeError."""
    samples, calibration = base.samples, base.calibration
    field = calibration.correct(samples.field)
    unit = float(np.median(np.linalg.norm(field, axis=1))) / MAGNITUDE
    distortion = np.linalg.inv(calibration.matrix)
    time = np.arange(len(field)) / RATE_HZ if samples.time is None else samples.time
    draft = Draft(
        rng=np.random.default_rng(seed),
        rot_nm=None,  # type: ignore[arg-type]  # nobody knows it
        time=time - time[0],
        bias=calibration.bias / unit,
        distortion=distortion,
        field=field / unit,
        raw=samples.field / unit,
        reads=lambda field_m: field_m @ distortion.T + calibration.bias / unit,
        columns={},
    )
    for fault in faults:
        fault(draft)
    if draft.n != len(samples) or len(draft.raw) != len(samples):
        raise AttributeError("rows are added: nothing is known of the other sensors there")
    changed = {"time": draft.time} if samples.time is not None else {}
    laid = samples.with_columns(field=unit * draft.raw, **changed, **draft.columns)
    return TrueRecording(laid, lambda field_m: unit * draft.reads(field_m))


def run_stretch(work: tuple[Path, Stretch]) -> dict[str, Run]:
    """Every fault on one stretch, by its kind; none where the recording is not there."""
    folder, stretch = work
    if not (folder / stretch.recording.path).exists():
        return {}
    base, runs = load(folder, stretch), {}
    for number, (name, faults) in enumerate(list_faults()):
        try:
            recording = lay(base, faults, number)
        except (AttributeError, TypeError):
            continue
        told = judge(recording, base.reference, stretch.dip_deg, **base.settings)
        stated = float(np.hypot(told.stated_deg, base.heading_sd_deg))
        runs[name] = replace(told, stated_deg=stated)
    tables.progress(f"torture_recorded: {stretch.recording.name}, {len(runs)} kinds")
    return runs


def main() -> int:
    """Print the table; status 1 where a run crashed."""
    asked = tables.arguments("faults laid on real recordings", draws=1)
    folder = Path(os.environ.get("AGONIC_RECORDINGS", "../shared/recordings"))
    if not folder.is_dir():
        print(f"# Torture of real recordings\n\n{NO_FOLDER}")
        return 0
    chosen = STRETCHES[:1] if asked.quick else STRETCHES
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        found = [runs for runs in pool.map(run_stretch, [(folder, one) for one in chosen]) if runs]
    kinds = list(dict.fromkeys(name for runs in found for name in runs))
    of_kind = {name: [runs[name] for runs in found if name in runs] for name in kinds}
    everything = [one for runs in of_kind.values() for one in runs]
    verdicts = Counter(one.verdict for one in everything)
    print(INTRODUCTION.format(kinds=len(kinds), stretches=len(found)))
    print()
    shown = [row(name, runs) for name, runs in of_kind.items() if any(one.wrong for one in runs)]
    print(tables.markdown(HEAD, shown))
    counted = ", ".join(f"{verdicts[word]} {word}" for word in ("good", "check", "refused"))
    print(
        f"\nConfidently wrong: {sum(one.wrong for one in everything)} of {len(everything)} runs "
        f"({counted}); crashed: {verdicts['crash']}."
    )
    return 1 if verdicts["crash"] else 0


if __name__ == "__main__":
    sys.exit(main())
