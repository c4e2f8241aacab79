"""`WatchedSensor`: one sensor of a live session, and what is said of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.calibration.affine import PARAMETERS, Affine
from agonic.health import Finding
from agonic.live.fit import LiveFit
from agonic.live.guidance import find_held_out
from agonic.live.level import Level, Plan
from agonic.live.quarantine import find_plausible
from agonic.live.state import LiveParams
from agonic.live.streams import Chunk
from agonic.live.web.messages import Number, Problem, Rose, Sensor
from agonic.maths.equation.symmetric import pack_symmetric
from agonic.report.digits import group_digits
from agonic.samples import Samples
from agonic.units import nanotesla_per

MOST_NOTED = 200
"""Values of the heading's standard error that are remembered."""

RATE_OVER_S = 2.0
"""The rate is that of readings in so many seconds."""


MAX_POINTS = 50_000
"""Points of a sensor on the page."""


class RecentReadings:
    """The last `most` readings, and how many there were; `at` is when the latest came."""

    def __init__(self, most: int = MAX_POINTS) -> None:
        self._ring = np.zeros((most, 3), np.float32)
        self.total, self.at = 0, 0.0

    def add(self, rows: Array, at: float) -> None:
        """Put readings (n, 3) in."""
        rows = rows[np.isfinite(rows).all(axis=1)]
        total = self.total + len(rows)
        latest = rows[-len(self._ring) :]
        places = (total - len(latest) + np.arange(len(latest))) % len(self._ring)
        with np.errstate(over="ignore"):
            self._ring[places] = latest
        self.total, self.at = total, at

    def since(self, seen: int, most: int) -> NDArray[np.float32]:
        """The readings after the first `seen`, at most the latest `most` of them."""
        count = min(self.total - seen, most, len(self._ring))
        places = (self.total - count + np.arange(count)) % len(self._ring)
        return np.asarray(self._ring[places])


class WatchedSensor:
    """A sensor that is being turned: its fit, its points, the calibration it had before."""

    def __init__(self, first: Chunk, params: LiveParams, before: Affine | None) -> None:
        self.name, self.frame = first.sensor, first.frame
        self.params, self.before = params, before
        self.restart()

    def restart(self) -> None:
        """Forget all readings."""
        self._begin(LiveFit(self.params))

    def go_on(self, live: LiveFit) -> None:
        """Go on from a live fit that was saved, with times after its own."""
        readings = live.samples
        assert readings.time is not None
        self._begin(live, float(readings.time[-1]))
        self.shown.add(readings.field, time.time())

    def _begin(self, live: LiveFit, last_s: float | None = None) -> None:
        self.live, self.shown = live, RecentReadings()
        live.aside = True
        self._waiting: list[Chunk] = []
        self._arrived: list[tuple[float, int]] = []
        self._last_s, self._later_s = last_s, 0.0
        self._began = time.monotonic()
        self._course: list[tuple[float, float]] = []

    def take(self, chunk: Chunk) -> None:
        """Show readings at once; the fit has them at the next `digest`."""
        field = chunk.field * nanotesla_per(chunk.unit)
        self.shown.add(field[find_plausible(field, chunk.unit)], time.time())
        self._waiting.append(chunk)
        now = time.monotonic()
        self._arrived.append((now, len(chunk.time)))
        while now - self._arrived[0][0] > RATE_OVER_S:
            self._arrived.pop(0)

    def digest(self) -> None:
        """Fit what has come."""
        waiting, self._waiting = self._waiting, []
        if not waiting:
            return
        times = np.concatenate([chunk.time for chunk in waiting])
        first = times[np.isfinite(times)][:1]
        if self._last_s is not None and len(first):  # this machine's clock may have begun anew
            self._later_s, self._last_s = self._last_s + 10.0 - float(first[0]), None
        field = np.concatenate([chunk.field for chunk in waiting])
        self.live.add(times + self._later_s, field, _join_motion(waiting))

    def consider(self, growth: float) -> str:
        """Make the fit beside accelerometer and gyro, and say what went wrong."""
        try:
            self.live.consider(growth)
        except Exception as error:
            what = f"{type(error).__name__}: {error}"
            return f"{self.name}: the fit beside accelerometer and gyro stopped ({what})"
        return ""

    def proceed(self) -> tuple[Sensor, str]:
        """Fit what has come; the status, and what went wrong, in words. Where the fit stops, the
        readings that had come are left out, and it begins anew only where it cannot go on from
        those before."""
        before = self.live.state
        try:
            self.digest()
            return self.status(), ""
        except Exception as error:
            trouble = f"{self.name}: the fit stopped ({type(error).__name__}: {error})"
        try:
            self.live.state = before
            return self.status(), f"{trouble}; the last readings are left out"
        except Exception:
            self.restart()
            return self.status(), f"{trouble} and was started again"

    def _describe_left_out(self) -> str:
        """How many readings were left out, in words; "" where none was."""
        count = self.live.left_out
        word = "reading was" if count == 1 else "readings were"
        reason = "impossible for a sensor, or far from all others"
        return f"{self.name}: {group_digits(count)} {word} left out: {reason}" if count else ""

    @property
    def rate_Hz(self) -> float:
        """Readings a second, lately."""
        now = time.monotonic()
        return sum(n for at, n in self._arrived if now - at <= RATE_OVER_S) / RATE_OVER_S

    @property
    def seen(self) -> tuple[Samples, Sequence[Finding]]:
        """The readings to calibrate from, and what to say of those that were kept out of them."""
        live, note = self.live, ("kept of a live session",)
        whole_way = live.aided is not None and live.aided.chosen
        doubts = () if whole_way else tuple(find_held_out(live.state))
        return live.samples.with_columns(frame=self.frame, notes=note), doubts

    def status(self) -> Sensor:
        """All that a page shows of it."""
        live, guidance, aided = self.live, self.live.guidance, self.live.aided
        self._note()
        centre, shape = self._sphere()
        calibration, coverage = live.fitted or (None, None)
        progress = 0.0 if coverage is None else coverage.filled  # of a level vehicle: of headings
        if guidance.level is not None:
            progress = float(guidance.level.seen.mean())
        return Sensor(
            name=self.name,
            n=live.n,
            unit=live.unit,
            rate_Hz=round(self.rate_Hz, 1),
            say=guidance.say,
            done=guidance.done,
            progress=progress,
            target_deg=self.params.target_deg,
            centre=centre.tolist(),
            shape=shape.ravel().tolist(),
            cells=[] if coverage is None else coverage.cells.tolist(),
            heading_sd_deg=_make_finite(None if coverage is None else coverage.heading_sd_deg),
            magnitude=None if calibration is None else calibration.magnitude,
            present=None if guidance.present is None else guidance.present.tolist(),
            wanted=None if guidance.wanted is None else guidance.wanted.tolist(),
            problems=[Problem(f.name, f.sentence) for f in guidance.findings],
            numbers=[] if calibration is None else self._numbers(calibration),
            before=self._describe_before(),
            course=list(self._course),
            left_out=self._describe_left_out(),
            method="ellipsoid" if aided is None else aided.method,
            vehicle_sd_deg=_make_finite(aided.vehicle_sd_deg) if aided and aided.chosen else None,
            rose=None if guidance.level is None else _draw_rose(guidance.level, guidance.plan),
        )

    def _describe_before(self) -> str:
        if self.before is None:
            return ""
        created = str(getattr(self.before.provenance, "created", "") or "")
        return f"the calibration before{f', of {created[:10]}' if created else ''}"

    def _note(self) -> None:
        """Note the heading's standard error, ever more seldom."""
        fitted, course = self.live.fitted, self._course
        now = time.monotonic() - self._began
        step = 2 * now / MOST_NOTED
        if fitted is None or (course and now - course[-1][0] < max(step, 0.2)):
            return
        error = fitted[1].heading_sd_deg
        if np.isfinite(error) and error > 0:
            course.append((round(now, 1), float(f"{error:.4g}")))
        if len(course) > MOST_NOTED:
            del course[1::2]

    def _sphere(self) -> tuple[Array, Array]:
        """What brings the readings onto the unit sphere: the fit, or at first their midst."""
        fitted = self.live.fitted
        if fitted is not None:
            calibration = fitted[0]
            return calibration.bias, calibration.matrix / (calibration.magnitude or 1.0)
        boxes = self.live.boxes
        points = np.zeros((1, 3)) if boxes is None else boxes.middles
        low, high = points.min(axis=0), points.max(axis=0)
        reach = max(float((high - low).max()) / 2, 0.1 * float(np.abs(points).max()), 1e-9)
        return (low + high) / 2, np.eye(3) / reach

    def _numbers(self, calibration: Affine) -> list[Number]:
        now = [*calibration.bias, *pack_symmetric(calibration.matrix)]
        sd = [None] * 9 if calibration.sd is None else calibration.sd[:9].tolist()
        before = self.before
        if before is not None and before.unit_in != calibration.unit_in:
            before = None
        old = [None] * 9 if before is None else [*before.bias, *pack_symmetric(before.matrix)]
        units = [calibration.unit_in] * 3 + [""] * 6
        rows = zip(PARAMETERS, units, now, sd, old, strict=True)
        old_spread = None if before is None else self._spread(before.correct)
        return [
            Number("spread of |field|", "%", self._spread(calibration.correct), None, old_spread),
            Number("uncorrected", "%", self._spread(lambda raw: raw)),
            *(
                Number(name.replace("_", " "), unit, *map(_make_finite, values))
                for name, unit, *values in rows
            ),
        ]

    def _spread(self, correct: Callable[[Array], Array]) -> float | None:
        """Standard deviation over mean of the magnitude, percent, each box counted alike."""
        boxes = self.live.boxes
        if boxes is None:
            return None
        sizes = np.linalg.norm(correct(boxes.middles), axis=1)
        return _make_finite(100 * float(sizes.std() / sizes.mean()))


def _draw_rose(level: Level, plan: Plan | None) -> Rose:
    counts, tilts = level.counts.tolist(), level.tilts_deg.round(1).tolist()
    rose = Rose(counts, tilts, level.heading_deg, level.pitch_deg, level.roll_deg)
    if plan is None:
        return rose
    step, after_deg = plan.step, _make_finite(plan.after_deg)
    return replace(rose, wanted=list(step.sectors), slope_deg=step.slope_deg, after_deg=after_deg)


def _join_motion(chunks: Sequence[Chunk]) -> Array | None:
    """What an inertial unit told with the readings of chunks, (n, 6), NaN where nothing."""
    if all(chunk.motion is None for chunk in chunks):
        return None
    parts = [np.full((len(c.time), 6), np.nan) if c.motion is None else c.motion for c in chunks]
    return np.concatenate(parts)


def find_calibration_before(folder: Path, name: str, given: dict[str, Affine]) -> Affine | None:
    """The calibration of a sensor that was given, or was written to the folder before."""
    from agonic.atomic import allow_replacing
    from agonic.errors import AgonicError
    from agonic.files.calibration import load
    from agonic.files.names import file_stem

    if name in given:
        return given[name]
    path = folder / f"{file_stem(name)}.json"
    if not path.is_file():
        return None
    try:
        found = load(path)
    except AgonicError:
        return None
    allow_replacing(path)
    return found if isinstance(found, Affine) else None


def _make_finite(value: float | None) -> float | None:
    return float(value) if value is not None and np.isfinite(value) else None
