"""Readings that were made before: a log replayed, and a simulation."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from threading import Event as Flag
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.live.streams.events import Chunk, Event, Notice
from agonic.logs.read import open_log
from agonic.samples import Samples

RATE_HZ = 50.0
"""Of readings that were logged without times."""

SLOWDOWN = 2.0
"""How many times slower than in a simulated log a sensor is turned, so that the guidance can be
watched."""


FIELD_N = (25_000.0, 0.0, 50_000 * 0.75**0.5)
"""Where the simulation is, nT: 50 000, dipping 60°."""


class Replay:
    """Recorded sensors, played at `speed` times their own pace; as fast as possible at 0."""

    lasting = False

    def __init__(
        self, sensors: Sequence[Samples], name: str, speed: float = 1.0, stack: str = ""
    ) -> None:
        self.sensors, self.name, self.speed, self.stack = tuple(sensors), name, speed, stack

    @property
    def device(self) -> None:
        """Nothing can be written to what was recorded."""
        return None

    def events(self, stop: Flag) -> Iterator[Event]:
        """The readings, each when its time has come."""
        yield Notice(True, f"playing {self.name}")
        times = [_get_times(samples) for samples in self.sensors]
        motions = [_get_motion(samples) for samples in self.sensors]
        first = min(t[0] for t in times)
        last = max(t[-1] for t in times)
        done = [0] * len(times)
        began = time.monotonic()
        played = first
        while played <= last and not stop.is_set():
            if self.speed > 0:
                stop.wait(0.02)
                played = first + self.speed * (time.monotonic() - began)
            else:
                played += 1.0
            left = [t[k] for t, k in zip(times, done, strict=True) if k < len(t)]
            pause = min(left, default=played) - played
            if pause > (10.0 if self.speed > 0 else 0.0):
                first, played = first + pause, played + pause
            for k, samples in enumerate(self.sensors):
                until = int(np.searchsorted(times[k], played, side="right"))
                if until > done[k]:
                    rows, motion, dated = slice(done[k], until), motions[k], samples.epoch
                    yield Chunk(
                        samples.name,
                        times[k][rows],
                        samples.field[rows],
                        samples.unit,
                        samples.frame,
                        samples.device_id,
                        None if motion is None else motion[rows],
                        None if dated is None else times[k][rows] + dated.timestamp(),
                    )
                    done[k] = until
        yield Notice(False, f"{self.name} has ended", ended=True)


def replay_log(path: Path, speed: float, unit: str | None) -> Replay:
    """A log at a speed; `LogError` where it cannot be read."""
    log = open_log(path, unit=unit)
    return Replay(log.sensors, log.path.name, speed, log.stack)


def make_simulated(
    *,
    kind: str = "hand",
    rate_Hz: float = 50.0,
    sensors: int = 1,
    seed: int = 0,
    minutes: float = 10.0,
    speed: float = 1.0,
) -> Replay:
    """Sensors that are turned together, in a field of 50 000 nT dipping 60°."""
    from agonic.simulation import random_calibration, simulate, with_inertial_unit  # takes a second

    rng = np.random.default_rng(seed)
    rover = kind == "rover"
    settings: dict[str, Any] = {"tilt_deg": 5.0} if rover else {}
    made = [
        _slow_down(
            simulate(
                "circle" if rover else kind,
                n=int(minutes * 60 * rate_Hz),
                rate_Hz=SLOWDOWN * rate_Hz,
                seed=seed,
                noise=150.0,
                calibration=replace(random_calibration(rng), sensor=f"mag{k or ''}"),
                **settings,
            ).samples
        )
        for k in range(sensors)
    ]
    if rover:
        made = [with_inertial_unit(seed=seed)(samples) for samples in made]
    return Replay(made, "the simulation", speed)


def _slow_down(samples: Samples) -> Samples:
    """The same readings, made in `SLOWDOWN` times the time."""
    rate = samples.rotation_rate
    turning = {} if rate is None else {"rotation_rate": rate / SLOWDOWN}
    return samples.with_columns(time=SLOWDOWN * _get_times(samples), **turning)


def _get_motion(samples: Samples) -> Array | None:
    """Acceleration and rotation rate (n, 6) of a sensor, NaN where there is none."""
    force, rate = samples.acceleration, samples.rotation_rate
    if force is None:
        return None
    return np.column_stack([force, np.full_like(force, np.nan) if rate is None else rate])


def _get_times(samples: Samples) -> np.ndarray:
    return np.arange(len(samples)) / RATE_HZ if samples.time is None else samples.time
