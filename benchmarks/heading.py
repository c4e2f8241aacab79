"""How many headings a second on one core: python -m benchmarks.heading [--draws 5] [--quick]."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from agonic.calibration.affine import Affine
from agonic.calibration.deviation import Deviation
from agonic.calibration.interference import Interference
from agonic.calibration.setup import Compass, Setup
from agonic.headings.compute import heading
from agonic.maths.rotations import tilt
from agonic.samples import Samples
from agonic.simulation import simulate
from benchmarks import tables
from benchmarks.speed import median_s

PIECE = 8192
INTRODUCTION = """Processor time of one core, median of {draws} runs, a flight of {n} readings.
`heading()` is the whole of it: calibration, tilt, deviation, declination, flags, and the standard
error carried through a full covariance; only reading the log is left out."""


def flight(n: int) -> tuple[Samples, Affine]:
    """A flight of n readings (a short one over and over), and its calibration with covariance."""
    short = simulate("flight", n=4000, seed=2)
    times = -(-n // 4000)
    columns = {
        name: np.concatenate([values] * times)[:n]
        for name, values in short.samples.columns().items()
        if name != "time"
    }
    covariance = np.diag([400.0] * 3 + [1e-6] * 6)
    return Samples(time=np.arange(n) * 0.02, **columns), replace(short.truth, covariance=covariance)


def cases(samples: Samples, calibration: Affine) -> dict[str, Callable[[], object]]:
    """What is timed, by name."""
    own = {"bias": calibration.bias, "matrix": calibration.matrix, "noise": 200.0}
    motors = Interference(
        **own,
        sources=("current_A",),
        coefficients=[[50.0], [-30.0], [80.0]],
        covariance=np.diag([400.0] * 3 + [1e-6] * 6 + [4.0] * 3),
    )
    card = Deviation(coefficients=[1.0, 3.0, 2.0, 0.5, 0.2], covariance=0.01 * np.eye(9))
    compass = Compass(calibration=calibration)
    known = {"declination_deg": 2.0, "horizontal": 25_000.0, "vertical": 43_301.0}
    setups = {
        "heading(), one compass": Setup(compasses=(compass,), **known),
        "… with a term in the current": Setup(compasses=(Compass(calibration=motors),), **known),
        "… with a deviation card": Setup(
            compasses=(Compass(calibration=calibration, deviation=card),), **known
        ),
        "… tilt from the accelerometer": Setup(compasses=(compass,), tilt="accelerometer", **known),
        "… tilt by the gyro filter": Setup(compasses=(compass,), tilt="gyro", **known),
    }
    work: dict[str, Callable[[], object]] = {
        "roll, pitch and field into heading": partial(kernel, samples),
        "vector form, down and field into heading": partial(vectors, samples),
    }
    work |= {name: partial(heading, samples, setup, smooth=False) for name, setup in setups.items()}
    two = samples.with_columns(name="MAG2"), replace(calibration, sensor="MAG2")
    pair = Setup(compasses=(compass, Compass(calibration=two[1])), **known)
    work["… two compasses, compared"] = partial(heading, [samples, two[0]], pair, smooth=False)
    return work


def kernel(samples: Samples) -> None:
    """Tilt compensation alone, in pieces that stay in the cache."""
    roll, pitch = samples.roll_deg, samples.pitch_deg
    assert roll is not None
    assert pitch is not None
    for start in range(0, len(samples), PIECE):
        rows = slice(start, start + PIECE)
        tilt.heading_deg(samples.field[rows], tilt.tilt_from_angles(roll[rows], pitch[rows]))


def vectors(samples: Samples) -> None:
    """The same without angles."""
    force = samples.acceleration
    assert force is not None
    for start in range(0, len(samples), PIECE):
        rows = slice(start, start + PIECE)
        tilt.heading_by_vectors_deg(samples.field[rows], tilt.down_from_force(force[rows]))


def main() -> None:
    """Time everything and print the table."""
    asked = tables.arguments("headings a second", draws=5)
    n = 100_000 if asked.quick else 1_000_000
    rows = []
    for name, work in cases(*flight(n)).items():
        tables.progress(f"heading: {name}")
        rows.append((name, f"{n / median_s(work, asked.draws) / 1e6:.2g}"))
    print(INTRODUCTION.format(draws=asked.draws, n=n))
    print()
    print(tables.markdown(("work", "million headings a second"), rows))


if __name__ == "__main__":
    main()
