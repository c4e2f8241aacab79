"""Recordings that break assumptions, through `calibrate`: verdict, error, stated error, cause.

python -m benchmarks.torture [--draws 3] [--quick] [--kind TEXT]

A run is *confidently wrong* where the verdict is good, the heading is off by more than three stated
standard errors and by more than 0.2°. The heading's error is that of a level sensor, rms over all
headings, after the truth of the sensor itself (fault included) has been put through the
calibration.
"""

from __future__ import annotations

import argparse
import os
import sys
import warnings
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import agonic as ag
from benchmarks import tables
from benchmarks.faults import DIP_DEG, KINDS, MAGNITUDE, Kind, Recording

WRONG_SD, WRONG_DEG = 3.0, 0.2
RIGHT_DEG = 0.5
HEAD = ("kind", "good check refused", "error, °", "stated, °", "wrong", "causes")

INTRODUCTION = """# Torture

{kinds} kinds of recordings, {draws} draws each, through `ag.calibrate` with its defaults. The error
is that of a level heading, rms over all headings, at a dip of 60°; the stated one its standard
error; both are medians over the draws. *Wrong* counts runs with the verdict good, an error above
three stated standard errors, and above 0.2°. Field 50 000 nT; iron 15 µT and 6 % where nothing else
is said; noise 150 nT. The recordings are made with NumPy alone (`benchmarks/faults.py`). Of a
disturbance that changes during a recording the mean over it counts as true: that is what one
calibration of the recording can be of. *Useful* are answers right within {right_deg}° that are
called good."""


@dataclass(frozen=True)
class Run:
    """One recording: what was said of it, and what was true."""

    verdict: str
    error_deg: float
    stated_deg: float
    causes: tuple[str, ...]

    @property
    def wrong(self) -> bool:
        """Confidently wrong."""
        far = self.error_deg > max(WRONG_DEG, WRONG_SD * self.stated_deg)
        return self.verdict == "good" and bool(far)

    @property
    def right(self) -> bool:
        """Right within what users of a compass ask for."""
        return bool(self.error_deg < RIGHT_DEG)


def heading_error_deg(
    calibration: ag.Affine, recording: Recording, dip_deg: float = DIP_DEG
) -> float:
    """Error of a level heading, rms over all headings, its mean (a turn of the axes) included."""
    psi = np.radians(np.arange(0, 360, 5))
    dip = np.radians(dip_deg)
    level = np.column_stack(
        [np.cos(dip) * np.cos(psi), -np.cos(dip) * np.sin(psi), np.full_like(psi, np.sin(dip))]
    )
    raw = recording.reads(MAGNITUDE * level)
    if isinstance(calibration, ag.Interference):
        calibration = calibration.at(calibration.typical)
    found = calibration.correct(raw)
    wrong = np.arctan2(-found[:, 1], found[:, 0]) - psi
    return float(np.degrees(np.sqrt(np.mean(np.angle(np.exp(1j * wrong)) ** 2))))


def run(kind: Kind, seed: int) -> Run:
    """One draw of a kind through `calibrate`."""
    recording = kind.recording(seed)
    return judge(recording, kind.reference(recording))


def judge(
    recording: Recording,
    reference: ag.Reference | None,
    dip_deg: float = DIP_DEG,
    **settings: float,
) -> Run:
    """What `calibrate` says of a recording, beside its truth."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            result = ag.calibrate(recording.samples, reference, **settings)
        except ag.AgonicError as error:
            return Run("refused", np.nan, np.nan, (type(error).__name__,))
        except Exception as error:
            return Run("crash", np.nan, np.nan, (repr(error)[:60],))
    causes = tuple(f.name for f in result.fit.findings if f.severity != "note")
    error = heading_error_deg(result.fit.calibration, recording, dip_deg)
    stated = float(result.fit.coverage.heading_sd_deg)
    failed = tuple(c.name for c in result.verification.checks if not c.passed)
    return Run(result.verdict, error, stated, causes or failed)


def of_kind(work: tuple[int, int]) -> list[Run]:
    """All draws of a kind, by its number."""
    number, draws = work
    return [run(KINDS[number], 1000 * number + seed) for seed in range(draws)]


def row(name: str, runs: list[Run]) -> list[str]:
    """A line of the table: a kind by its name, and its runs."""
    verdicts = Counter(one.verdict for one in runs)
    causes = Counter(cause for one in runs for cause in one.causes).most_common(2)
    kept = [one for one in runs if one.verdict in ("good", "check")]
    errors: NDArray[np.float64] = np.array([one.error_deg for one in kept])
    stated: NDArray[np.float64] = np.array([one.stated_deg for one in kept])
    return [
        name,
        " ".join(f"{verdicts[word]}" for word in ("good", "check", "refused")),
        f"{np.median(errors):.2f}" if len(kept) else "–",
        f"{np.median(stated):.2f}" if len(kept) else "–",
        f"{sum(one.wrong for one in runs) or ''}",
        ", ".join(f"{name} {count}" for name, count in causes),
    ]


def count_useful(runs: list[Run]) -> str:
    """Of the answers that are right, how many are called good."""
    right = [run for run in runs if run.right]
    useful = sum(run.verdict == "good" for run in right)
    share = 100 * useful / max(len(right), 1)
    return f"Right within {RIGHT_DEG}° and called good: {useful} of {len(right)} ({share:.0f} %)."


def main() -> int:
    """Print the table; status 1 where a run was confidently wrong or crashed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="one draw")
    parser.add_argument("--kind", default="", help="only kinds whose name holds this text")
    asked = parser.parse_args()
    draws = 1 if asked.quick else asked.draws
    chosen = [k for k, kind in enumerate(KINDS) if asked.kind in kind.name]
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        results = list(pool.map(of_kind, [(k, draws) for k in chosen]))
    names = [KINDS[k].name + (" *" if KINDS[k].good else "") for k in chosen]
    rows = [row(name, runs) for name, runs in zip(names, results, strict=True)]
    everything = [one for runs in results for one in runs]
    wrong, crashed = sum(one.wrong for one in everything), 0
    crashed = sum(one.verdict == "crash" for one in everything)
    good = [one for k, runs in zip(chosen, results, strict=True) if KINDS[k].good for one in runs]
    alarmed = sum(one.verdict != "good" for one in good)
    print(INTRODUCTION.format(kinds=len(chosen), draws=draws, right_deg=RIGHT_DEG))
    print()
    print(tables.markdown(HEAD, rows))
    print(
        f"\nConfidently wrong: {wrong} of {len(everything)} runs; crashed: {crashed}; "
        f"good recordings (*) not called good: {alarmed} of {len(good)}. "
        f"{count_useful(everything)}"
    )
    return 1 if wrong or crashed else 0


if __name__ == "__main__":
    sys.exit(main())
