"""Recordings that break what a fit assumes, each with its truth: what a sensor, a vehicle or a
person can do to a log. Motions and faults are written here with NumPy alone, so that the program is
not judged by its own simulator.

A recording is made in three steps: attitudes over time (a motion), what the sensor reads there
(hard and soft iron, noise), and a fault on the way. `KINDS` lists all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

import agonic as ag

Array = NDArray[np.float64]
Rng = np.random.Generator

MAGNITUDE = 50_000.0
DIP_DEG = 60.0
FIELD_N = MAGNITUDE * np.array([np.cos(np.radians(DIP_DEG)), 0.0, np.sin(np.radians(DIP_DEG))])
NOISE = 150.0
RATE_HZ = 10.0


@dataclass(frozen=True)
class Recording:
    """Readings, and what the same sensor would read without noise in any field, for the truth.

    `reads(field_m)` (n, 3) → (n, 3), nT, as at the end of the recording, its fault included where
    that belongs to the sensor.
    """

    samples: ag.Samples
    reads: Callable[[Array], Array]
    attitude: bool = False


# --- motions: rotations from the sensor to north-east-down, one a row -------------------------


def tumble(n: int, rng: Rng) -> Rotation:
    """Turned by hand, smoothly, all ways."""
    rate = lfilter([1], [1, -0.97], rng.normal(size=(n, 3)) * 0.035, axis=0)
    turned = [Rotation.random(random_state=int(rng.integers(2**31)))]
    for step in Rotation.from_rotvec(rate[1:]):
        turned.append(turned[-1] * step)
    return Rotation.concatenate(turned)


def _euler(yaw: Array, pitch: Array, roll: Array) -> Rotation:
    return Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, roll]))


def _smooth(n: int, rng: Rng, size: float, memory: float = 0.98) -> Array:
    """A wandering angle of this rms."""
    x = np.asarray(lfilter([1], [1, -memory], rng.normal(size=n + 200)))[200:]
    return size * x / max(x.std(), 1e-12)


def tilts(limit_deg: float) -> Callable[[int, Rng], Rotation]:
    """All headings, tilts of this size."""

    def motion(n: int, rng: Rng) -> Rotation:
        yaw = np.cumsum(np.abs(0.06 + 0.03 * _smooth(n, rng, 1.0)))
        size = np.radians(limit_deg) / 1.7
        pitch = np.clip(_smooth(n, rng, size), -1.7 * size, 1.7 * size)
        return _euler(yaw, pitch, np.clip(_smooth(n, rng, size), -1.7 * size, 1.7 * size))

    return motion


def circles(n: int, rng: Rng) -> Rotation:
    """Exact turns: level about the vertical, then about the nose, then about the wing."""
    a = np.linspace(0, 6 * np.pi, n // 3)
    zero = np.zeros_like(a)
    parts = [_euler(a, zero, zero), _euler(zero, zero, a), _euler(zero, a, zero)]
    return Rotation.concatenate(parts)


def two_circles(n: int, rng: Rng) -> Rotation:
    """Exact turns about two axes: level about the vertical, then about the wing."""
    a = np.linspace(0, 6 * np.pi, n // 2)
    zero = np.zeros_like(a)
    return Rotation.concatenate([_euler(a, zero, zero), _euler(zero, a, zero)])


def poses(count: int, hold: int) -> Callable[[int, Rng], Rotation]:
    """Held still in a few poses, as by hand on a table."""

    def motion(n: int, rng: Rng) -> Rotation:
        each = Rotation.random(count, random_state=int(rng.integers(2**31)))
        return each[np.repeat(np.arange(count), hold)]

    return motion


def still_then(
    share: float, then: Callable[[int, Rng], Rotation]
) -> Callable[[int, Rng], Rotation]:
    """At rest on the bench for most of the log, then turned."""

    def motion(n: int, rng: Rng) -> Rotation:
        moving = then(max(int(n * (1 - share)), 30), rng)
        rest = moving[np.zeros(n - len(moving), dtype=int)]
        return Rotation.concatenate([rest, moving])

    return motion


def swell(n: int, rng: Rng) -> Rotation:
    """A boat that turns slowly while the sea rolls and pitches it."""
    t, at = np.arange(n) / RATE_HZ, rng.uniform(0, 2 * np.pi, 2)
    pitch = 0.25 * np.sin(2 * np.pi * t / 6.1 + at[0])
    roll = 0.5 * np.sin(2 * np.pi * t / 9.7 + at[1])
    return _euler(0.05 * t + 0.3 * np.sin(0.1 * t), pitch, roll)


def cap(limit_deg: float) -> Callable[[int, Rng], Rotation]:
    """Directions within a cone only: never upside down, never all headings."""

    def motion(n: int, rng: Rng) -> Rotation:
        size = np.radians(limit_deg) / 1.7
        angles = [np.clip(_smooth(n, rng, size), -1.7 * size, 1.7 * size) for _ in range(3)]
        return _euler(*angles)

    return motion


# --- the sensor ------------------------------------------------------------------------------


def _sensor(rng: Rng, iron: float = 15_000.0, soft: float = 0.06) -> tuple[Array, Array]:
    """A bias of this size and a symmetric distortion of this size."""
    bias = rng.normal(size=3)
    bias *= iron / np.linalg.norm(bias)
    half = rng.normal(size=(3, 3)) * soft / 2
    return bias, np.eye(3) + half + half.T


Fault = Callable[["Draft"], None]


@dataclass
class Draft:
    """A recording that is being made; faults change it in place."""

    rng: Rng
    rot_nm: Rotation
    time: Array
    bias: Array
    distortion: Array
    field: Array
    raw: Array
    reads: Callable[[Array], Array]
    columns: dict[str, Any]

    @property
    def n(self) -> int:
        """Rows."""
        return len(self.time)


def record(
    seed: int,
    motion: Callable[[int, Rng], Rotation],
    faults: tuple[Fault, ...] = (),
    *,
    n: int = 3000,
    noise: float = NOISE,
    attitude: bool = False,
    iron: float = 15_000.0,
    soft: float = 0.06,
) -> Recording:
    """A recording with these faults, applied in order; noise comes before them."""
    rng = np.random.default_rng(seed)
    rot_nm = motion(n, rng)
    n = len(rot_nm)
    bias, distortion = _sensor(rng, iron, soft)
    field = rot_nm.inv().apply(FIELD_N)

    def reads(field_m: Array) -> Array:
        return field_m @ distortion.T + bias

    raw = reads(field) + noise * rng.normal(size=(n, 3))
    draft = Draft(rng, rot_nm, np.arange(n) / RATE_HZ, bias, distortion, field, raw, reads, {})
    for fault in faults:
        fault(draft)
    if attitude:
        yaw, pitch, roll = draft.rot_nm.as_euler("ZYX", degrees=True).T
        angles = {"roll_deg": roll, "pitch_deg": pitch, "heading_deg": yaw % 360}
        draft.columns = {
            k: v + 0.3 * rng.normal(size=n) for k, v in angles.items() if k != "heading_deg"
        } | draft.columns
    samples = ag.Samples(time=draft.time, field=draft.raw, unit="nT", name="mag", **draft.columns)
    return Recording(samples, draft.reads, attitude)


def of_time(fault: Callable[..., Fault]) -> Callable[..., Fault]:
    """A fault that changes in time: the sensor is true as it was on the average over the log."""

    def make(*args: Any) -> Fault:
        inner = fault(*args)

        def made(d: Draft) -> None:
            clean, before = d.raw.copy(), d.reads
            inner(d)
            mean = (d.raw - clean).mean(axis=0)
            d.reads = lambda field: before(field) + mean

        return made

    return make


# --- faults: of the sensor -------------------------------------------------------------------


def _non_linear(law: Callable[[Array], Array]) -> Fault:
    def fault(d: Draft) -> None:
        before = d.reads
        noise = d.raw - before(d.field)
        d.reads = lambda field: law(before(field))
        d.raw = d.reads(d.field) + noise

    return fault


def soft_saturation(at: float) -> Fault:
    """Each axis compresses like tanh."""
    return _non_linear(lambda x: at * np.tanh(x / at))


def saturation_across(at: float) -> Fault:
    """The whole vector compresses by its length."""

    def law(x: Array) -> Array:
        size = np.linalg.norm(x, axis=1, keepdims=True)
        return np.asarray(x / np.sqrt(1 + (size / at) ** 2))

    return _non_linear(law)


def cubic(share: float) -> Fault:
    """A cubic error of this share at the magnitude of the field."""
    return _non_linear(lambda x: x + share * x**3 / MAGNITUDE**2)


def square(share: float) -> Fault:
    """A quadratic error of this share."""
    return _non_linear(lambda x: x + share * x * np.abs(x) / MAGNITUDE)


def cross_field(share: float) -> Fault:
    """The gain of each axis goes with the field across it, as of a magnetoresistor."""
    return _non_linear(lambda x: x * (1 + share * x[:, [1, 2, 0]] / MAGNITUDE))


def gains_by_sign(share: float) -> Fault:
    """Positive readings are larger by this share, negative ones smaller, as of an amplifier whose
    two halves differ."""
    return _non_linear(lambda x: x * (1 + share * np.sign(x)))


def square_across(share: float) -> Fault:
    """One axis holds this share of the square of another, at the magnitude of the field."""
    onto = np.array([1.0, 0.0, 0.0])
    return _non_linear(lambda x: x + share * x[:, 2:] ** 2 / MAGNITUDE * onto)


def gain_steps(share: float, up: float = 50_000.0, down: float = 42_000.0) -> Fault:
    """All gains step up where an axis reads more than `up`, and back where all read less than
    `down`, as of an amplifier that chooses its range."""

    def fault(d: Draft) -> None:
        largest, high = np.abs(d.raw).max(axis=1), np.zeros(d.n, dtype=bool)
        for row in range(d.n):
            high[row] = largest[row] > (down if row and high[row - 1] else up)
        d.raw = d.raw * (1 + share * high[:, None])

    return fault


def one_axis_saturates(at: float) -> Fault:
    """One axis compresses like tanh."""

    def law(x: Array) -> Array:
        return np.column_stack([at * np.tanh(x[:, 0] / at), x[:, 1:]])

    return _non_linear(law)


def clipped(at: float) -> Fault:
    """Hard limits."""
    return _non_linear(lambda x: np.clip(x, -at, at))


def ripple(size: float, period: float) -> Fault:
    """An error that comes again along the readings of each axis."""
    return _non_linear(lambda x: x + size * np.sin(2 * np.pi * x / period))


def dead_zone(size: float) -> Fault:
    """One axis reads zero wherever it should read less than this."""

    def fault(d: Draft) -> None:
        d.raw[np.abs(d.raw[:, 1]) < size, 1] = 0.0
        before = d.reads

        def reads(field_m: Array) -> Array:
            raw = before(field_m)
            raw[np.abs(raw[:, 1]) < size, 1] = 0.0
            return raw

        d.reads = reads

    return fault


def errs_between(low: float, high: float, size: float) -> Fault:
    """One axis is off by this much where it should read so much."""

    def law(x: Array) -> Array:
        wrong = (x[:, 1:2] > low) & (x[:, 1:2] < high)
        return np.asarray(x + size * wrong * np.array([0.0, 1.0, 0.0]))

    return _non_linear(law)


def stuck_bit(step: float, bit: int) -> Fault:
    """One bit of the converter is always zero."""
    return _non_linear(lambda x: (np.round(x / step).astype(int) & ~(1 << bit)) * step)


def missing_codes(step: float, period: int, missing: int) -> Fault:
    """Of every so many codes of the converter some never come."""

    def law(x: Array) -> Array:
        codes = np.round(x / step)
        return np.asarray(step * (codes + np.maximum(missing - codes % period, 0)))

    return _non_linear(law)


def gain_switches(share: float, at: float = 40_000.0) -> Fault:
    """Each axis takes another range, whose gain differs, for readings beyond this."""
    return _non_linear(lambda x: np.where(np.abs(x) > at, x * (1 + share), x))


def wraps(at: float) -> Fault:
    """One axis begins again at the other end of its range."""
    other = np.array([False, True, False])
    return _non_linear(lambda x: np.where(other, (x + at) % (2 * at) - at, x))


def axes_apart(rows: float) -> Fault:
    """The axes of a row are sampled one after the other, so many rows apart."""

    def fault(d: Draft) -> None:
        clean, i = d.reads(d.field), np.arange(d.n)
        late = [np.interp(i - k * rows, i, clean[:, k]) for k in range(3)]
        d.raw = d.raw - clean + np.column_stack(late)

    return fault


def one_axis_held(rows: int) -> Fault:
    """One axis is read only once in so many rows."""

    def fault(d: Draft) -> None:
        d.raw[:, 1] = d.raw[np.arange(d.n) // rows * rows, 1]

    return fault


def filter_begins(rows: float) -> Fault:
    """Half-way a first-order filter is switched on."""

    def fault(d: Draft) -> None:
        half, a = d.n // 2, np.exp(-1 / rows)
        last = d.raw[half - 1]
        d.raw[half:] = np.asarray(lfilter([1 - a], [1, -a], d.raw[half:] - last, axis=0)) + last

    return fault


def hysteresis(share: float) -> Fault:
    """Lags behind by a share of the field, by an old field that fades."""

    def fault(d: Draft) -> None:
        old = lfilter([0.02], [1, -0.98], d.raw, axis=0)
        d.raw = d.raw + share * (old - d.raw) * 0.5

    return fault


def lag(rows: float) -> Fault:
    """A slow sensor: a first-order filter."""

    def fault(d: Draft) -> None:
        a = np.exp(-1 / rows)
        d.raw = np.asarray(lfilter([1 - a], [1, -a], d.raw - d.raw[0], axis=0)) + d.raw[0]

    return fault


def quantised(step: float) -> Fault:
    """Steps of this size."""

    def fault(d: Draft) -> None:
        d.raw = step * np.round(d.raw / step)

    return fault


def gain_changes(axis: int, share: float) -> Fault:
    """One axis changes its gain half-way; the sensor is true as it was on the average."""

    def fault(d: Draft) -> None:
        before, mean = d.reads, np.ones(3)
        mean[axis] += share / 2
        d.raw[d.n // 2 :, axis] *= 1 + share
        d.reads = lambda field: before(field) * mean

    return fault


def axis_dies(axis: int) -> Fault:
    """One axis keeps its last value from 60 % on."""

    def fault(d: Draft) -> None:
        d.raw[int(0.6 * d.n) :, axis] = d.raw[int(0.6 * d.n), axis]

    return fault


@of_time
def second_sensor(size: float, every: int = 2) -> Fault:
    """Another sensor in alternate rows, a little apart."""

    def fault(d: Draft) -> None:
        away = d.rng.normal(size=3)
        d.raw[::every] += size * away / np.linalg.norm(away)

    return fault


def mixed_sensors(size: float, share: float, gain: float) -> Fault:
    """Rows at random of another sensor, with another bias and other gains; true is their mean."""

    def fault(d: Draft) -> None:
        away, other = d.rng.normal(size=3), d.rng.random(d.n) < share
        gains, before = 1 + gain * d.rng.normal(size=3), d.reads
        shift = size * away / np.linalg.norm(away)
        d.raw[other] = d.raw[other] * gains + shift
        d.reads = lambda field: before(field) * (1 + share * (gains - 1)) + share * shift

    return fault


def axis_dead(d: Draft) -> None:
    """One axis never moves."""
    d.raw[:, 2] = d.raw[0, 2]


def axis_copied(d: Draft) -> None:
    """One axis reads what another does."""
    d.raw[:, 1] = d.raw[:, 0] + NOISE * d.rng.normal(size=d.n)


def unequal_noise(*sizes: float) -> Fault:
    """Axes of different noise."""

    def fault(d: Draft) -> None:
        d.raw = d.reads(d.field) + np.array(sizes) * d.rng.normal(size=(d.n, 3))

    return fault


def coloured(memory: float, size: float) -> Fault:
    """Noise with memory (AR 1) of this rms."""

    def fault(d: Draft) -> None:
        x = np.asarray(lfilter([1], [1, -memory], d.rng.normal(size=(d.n + 5000, 3)), axis=0))
        d.raw = d.reads(d.field) + size * np.sqrt(1 - memory**2) * x[5000:]

    return fault


@of_time
def set_and_reset(size: float, rows: int) -> Fault:
    """What set and reset leave of the bias changes its sign every so many rows."""

    def fault(d: Draft) -> None:
        sign, way = np.where(np.arange(d.n) // rows % 2, 1.0, -1.0), d.rng.normal(size=3)
        d.raw = d.raw + sign[:, None] * size * way / np.linalg.norm(way)

    return fault


@of_time
def random_walk(size: float) -> Fault:
    """A bias that walks, ending this far (rms an axis)."""

    def fault(d: Draft) -> None:
        steps = d.rng.normal(size=(d.n, 3)) * size / np.sqrt(d.n)
        d.raw = d.raw + np.cumsum(steps, axis=0)

    return fault


# --- faults: of the surroundings -------------------------------------------------------------


@of_time
def slow_step(share: float) -> Fault:
    """The bias moves over a tenth of the log, by this share of the field."""

    def fault(d: Draft) -> None:
        ramp = np.clip((np.arange(d.n) / d.n - 0.45) * 10, 0, 1)
        way = d.rng.normal(size=3)
        d.raw = d.raw + ramp[:, None] * share * MAGNITUDE * way / np.linalg.norm(way)

    return fault


@of_time
def warm_up(size: float) -> Fault:
    """A bias of the first minutes that dies away."""

    def fault(d: Draft) -> None:
        left, way = np.exp(-np.arange(d.n) / (0.15 * d.n)), d.rng.normal(size=3)
        d.raw = d.raw + left[:, None] * size * way / np.linalg.norm(way)

    return fault


@of_time
def load_levels(size: float, rows: int = 50) -> Fault:
    """A current whose load is another every so many rows."""

    def fault(d: Draft) -> None:
        load, way = d.rng.random(d.n // rows + 1)[np.arange(d.n) // rows], d.rng.normal(size=3)
        d.raw = d.raw + load[:, None] * size * way / np.linalg.norm(way)

    return fault


def two_places(size: float) -> Fault:
    """Half of the log where the field is another by this much."""

    def fault(d: Draft) -> None:
        later, way = (np.arange(d.n) >= d.n // 2)[:, None], d.rng.normal(size=3)
        change_n = later * size * way / np.linalg.norm(way)
        d.raw = d.raw + d.rot_nm.inv().apply(change_n) @ d.distortion.T

    return fault


def parked_beside_iron(size: float, share: float = 0.3) -> Fault:
    """The field is another by this much for the first part of the log."""

    def fault(d: Draft) -> None:
        parked, way = (np.arange(d.n) < share * d.n)[:, None], d.rng.normal(size=3)
        change_n = parked * size * way / np.linalg.norm(way)
        d.raw = d.raw + d.rot_nm.inv().apply(change_n) @ d.distortion.T

    return fault


def pendulum(size: float, rows: float = 15.0) -> Fault:
    """A load that swings follows the bank late, by this much at a right angle."""

    def fault(d: Draft) -> None:
        across, a = d.rot_nm.inv().apply([0.0, 0.0, 1.0])[:, 1], np.exp(-1 / rows)
        way = d.rng.normal(size=3)
        late = np.asarray(lfilter([1 - a], [1, -a], across))
        d.raw = d.raw + late[:, None] * size * way / np.linalg.norm(way)

    return fault


def raised(size: float) -> Fault:
    """The field differs by height, and the sensor rises and sinks on its arm as it is turned."""

    def fault(d: Draft) -> None:
        height, way = -d.rot_nm.apply([0.6, 0.2, -0.3])[:, 2:], d.rng.normal(size=3)
        change_n = height * size * way / np.linalg.norm(way)
        d.raw = d.raw + d.rot_nm.inv().apply(change_n) @ d.distortion.T

    return fault


@of_time
def steady_drift(size: float) -> Fault:
    """The bias moves steadily, ending this far."""

    def fault(d: Draft) -> None:
        way = d.rng.normal(size=3)
        d.raw = d.raw + (np.arange(d.n) / d.n)[:, None] * size * way / np.linalg.norm(way)

    return fault


@of_time
def switching(size: float, mean_rows: float = 40.0) -> Fault:
    """A current that goes on and off at random."""

    def fault(d: Draft) -> None:
        on = np.cumsum(d.rng.random(d.n) < 1 / mean_rows) % 2
        way = d.rng.normal(size=3)
        d.raw = d.raw + on[:, None] * size * way / np.linalg.norm(way)

    return fault


@of_time
def bursts(size: float, rows: float = 40.0, on: float = 0.3) -> Fault:
    """A current that is on for a share of every so many rows."""

    def fault(d: Draft) -> None:
        way = d.rng.normal(size=3)
        now = (np.arange(d.n) / rows) % 1 < on
        d.raw = d.raw + now[:, None] * size * way / np.linalg.norm(way)

    return fault


def follows_pitch(size: float) -> Fault:
    """A current that goes with the pitch, nose up as nose down, as of motors that work harder."""

    def fault(d: Draft) -> None:
        down = d.rot_nm.inv().apply([0.0, 0.0, 1.0])
        way = d.rng.normal(size=3)
        d.raw = d.raw + np.abs(down[:, :1]) * size * way / np.linalg.norm(way)

    return fault


def steel_below(size: float) -> Fault:
    """Nose down the sensor comes near a floor with steel in it: the field there is another."""

    def fault(d: Draft) -> None:
        down = d.rot_nm.inv().apply([0.0, 0.0, 1.0])
        change_n = np.clip(down[:, :1], 0.0, 1.0) ** 2 * size * np.array([0.4, -0.5, 0.77])
        d.raw = d.raw + d.rot_nm.inv().apply(change_n) @ d.distortion.T

    return fault


def follows_attitude(size: float) -> Fault:
    """A disturbance that goes with the bank, as of something that swings."""

    def fault(d: Draft) -> None:
        down = d.rot_nm.inv().apply([0.0, 0.0, 1.0])
        way = d.rng.normal(size=3)
        d.raw = d.raw + (down[:, 1:2] ** 2) * size * way / np.linalg.norm(way)

    return fault


def carried(gradient: float, arm: float = 0.5) -> Fault:
    """The sensor goes around on an arm (m) as the vehicle turns, in a field that differs by so many
    nT a metre."""

    def fault(d: Draft) -> None:
        place = arm * d.rot_nm.apply([1.0, 0.0, 0.0])
        by_place = d.rng.normal(size=(3, 3))
        by_place += by_place.T
        by_place -= np.eye(3) * np.trace(by_place) / 3
        change_n = place @ (1.5 * gradient * by_place / np.linalg.norm(by_place)).T
        d.raw = d.raw + d.rot_nm.inv().apply(change_n) @ d.distortion.T

    return fault


def follows_turns(size: float) -> Fault:
    """A current that goes with how fast the vehicle turns, by so much for the rates' scatter."""

    def fault(d: Draft) -> None:
        steps = (d.rot_nm[:-1].inv() * d.rot_nm[1:]).as_rotvec()
        rate = np.r_[0.0, np.linalg.norm(steps, axis=1)]
        way = d.rng.normal(size=3)
        d.raw = d.raw + (rate / rate.std())[:, None] * size * way / np.linalg.norm(way)

    return fault


def one_sided_outliers(size: float) -> Fault:
    """Disturbed whenever the sensor looks one way, as near a steel table."""

    def fault(d: Draft) -> None:
        way = d.rng.normal(size=3)
        near = d.field @ way / np.linalg.norm(way) / MAGNITUDE > 0.8
        d.raw[near] += size * d.rng.normal(size=3)

    return fault


def outliers(share: float, size: float) -> Fault:
    """Gross readings here and there."""

    def fault(d: Draft) -> None:
        bad = d.rng.random(d.n) < share
        d.raw[bad] += size * d.rng.normal(size=(int(bad.sum()), 3))

    return fault


def magnet_passes(size: float) -> Fault:
    """A magnet is passed for a twenty-fifth of the log."""

    def fault(d: Draft) -> None:
        at = d.rng.uniform(0.2, 0.8)
        near = np.exp(-(((np.arange(d.n) / d.n - at) / 0.02) ** 2))
        way = d.rng.normal(size=3)
        d.raw = d.raw + near[:, None] * size * way / np.linalg.norm(way)

    return fault


@of_time
def magnet_added(size: float) -> Fault:
    """Something magnetic is added at 60 % of the log."""

    def fault(d: Draft) -> None:
        way = d.rng.normal(size=3)
        d.raw[int(0.6 * d.n) :] += size * way / np.linalg.norm(way)

    return fault


def gradient(size: float) -> Fault:
    """The field is not the same everywhere: the sensor is moved while it is turned."""

    def fault(d: Draft) -> None:
        place = np.asarray(lfilter([1], [1, -0.99], d.rng.normal(size=d.n)))
        place /= place.std()
        change_n = place[:, None] * size * np.array([0.6, 0.3, -0.7])
        d.raw = d.raw + d.rot_nm.inv().apply(change_n) @ d.distortion.T

    return fault


# --- faults: of the log ----------------------------------------------------------------------


def unit_changes(factor: float) -> Fault:
    """The last twentieth of the rows in another unit."""

    def fault(d: Draft) -> None:
        d.raw[int(0.95 * d.n) :] *= factor

    return fault


def repeated(times: int) -> Fault:
    """Each reading stands there several times."""

    def fault(d: Draft) -> None:
        d.raw = d.raw[(np.arange(d.n) // times) * times]

    return fault


def without_time(d: Draft) -> None:
    """Rows that carry no clock."""
    d.time = None  # type: ignore[assignment]


def wrong_magnitude(share: float) -> Fault:
    """Nothing in the readings; the reference is wrong (see `Kind.magnitude`)."""
    return lambda d: None


# --- faults: of the attitude beside ----------------------------------------------------------


def _angles(d: Draft) -> dict[str, Array]:
    yaw, pitch, roll = d.rot_nm.as_euler("ZYX", degrees=True).T
    return {"roll_deg": roll, "pitch_deg": pitch, "heading_deg": yaw % 360}


def with_attitude(
    sd_deg: float = 0.5, *, heading: bool = False, biased_deg: float = 0.0, memory: float = 0.0
) -> Fault:
    """Roll and pitch (and heading) with errors of this size, perhaps lasting, perhaps biased."""

    def fault(d: Draft) -> None:
        for name, angle in _angles(d).items():
            if name == "heading_deg" and not heading:
                continue
            error = d.rng.normal(size=d.n)
            if memory:
                error = np.asarray(lfilter([1], [1, -memory], error)) * np.sqrt(1 - memory**2)
            d.columns[name] = angle + sd_deg * error + biased_deg * (name == "roll_deg")
        if heading:
            d.columns["heading_deg"] %= 360

    return fault


def heading_is(law: Callable[[Array], Array]) -> Fault:
    """A heading column that means something else."""

    def fault(d: Draft) -> None:
        with_attitude(heading=True)(d)
        d.columns["heading_deg"] = law(d.columns["heading_deg"]) % 360

    return fault


def misaligned(deg: float) -> Fault:
    """The sensor sits turned in the body that the attitude is of; the truth is the body's."""

    def fault(d: Draft) -> None:
        turn = Rotation.from_rotvec(np.radians(deg) * np.array([0.6, 0.0, 0.8]))
        _, pitch, roll = (d.rot_nm * turn).as_euler("ZYX", degrees=True).T
        d.columns |= {"roll_deg": roll, "pitch_deg": pitch}
        before = d.reads
        d.reads = lambda field_b: before(turn.apply(field_b))

    return fault


def another_vehicle(d: Draft) -> None:
    """Roll and pitch that belong to something else."""
    other = tilts(40)(d.n, d.rng)
    _, pitch, roll = other.as_euler("ZYX", degrees=True).T
    d.columns |= {"roll_deg": roll, "pitch_deg": pitch}


def mirrored(name: str) -> Fault:
    """Roll or pitch counted the wrong way round."""

    def fault(d: Draft) -> None:
        with_attitude(0.3)(d)
        d.columns[name] = -d.columns[name]

    return fault


def held_attitude(rows: int) -> Fault:
    """Attitude and heading of a slow unit, each held for so many rows."""

    def fault(d: Draft) -> None:
        with_attitude(0.3, heading=True, memory=0.9)(d)
        held = np.arange(d.n) // rows * rows
        d.columns |= {name: angle[held] for name, angle in d.columns.items()}

    return fault


def late_attitude(seconds: float) -> Fault:
    """Attitude and heading that a slow link delivers late."""

    def fault(d: Draft) -> None:
        with_attitude(0.3, heading=True, memory=0.9)(d)
        for name, angle in d.columns.items():
            turning = np.unwrap(angle, period=360.0)
            d.columns[name] = np.interp(d.time - seconds, d.time, turning)
        d.columns["heading_deg"] %= 360

    return fault


def smoothed_attitude(rows: float) -> Fault:
    """Roll and pitch of a filter that follows slowly."""

    def fault(d: Draft) -> None:
        with_attitude(0.3)(d)
        a = np.exp(-1 / rows)
        for name, angle in d.columns.items():
            turning = np.unwrap(angle, period=360.0)
            slow = lfilter([1 - a], [1, -a], turning - turning[0])
            d.columns[name] = np.asarray(slow) + turning[0]

    return fault


def leans_in_turns(deg: float) -> Fault:
    """Roll is off by up to this much while the vehicle turns, as of an accelerometer's level."""

    def fault(d: Draft) -> None:
        with_attitude(0.3)(d)
        rate = np.gradient(np.unwrap(d.rot_nm.as_euler("ZYX")[:, 0]))
        slow = np.asarray(lfilter([0.05], [1, -0.95], rate))
        d.columns["roll_deg"] = d.columns["roll_deg"] + deg * slow / np.abs(slow).max()

    return fault


def near_rebar(depth: float, strength: float = 2500.0) -> Fault:
    """Carried on an arm, by hand, over four pieces of magnetised iron in the ground so many metres
    below (dipoles; `strength`, nT at a metre)."""

    def fault(d: Draft) -> None:
        wander = [_smooth(d.n, d.rng, 0.15, 0.995) for _ in range(3)]
        place = 0.25 * d.rot_nm.apply([1.0, 0.0, 0.0]) + np.stack(wander, axis=1)
        change_n = np.zeros((d.n, 3))
        for _ in range(4):
            at, moment = np.array([*d.rng.normal(size=2) * 0.6, depth]), d.rng.normal(size=3)
            moment /= np.linalg.norm(moment)
            away = place - at
            far = np.linalg.norm(away, axis=1, keepdims=True)
            along = (away / far) @ moment
            change_n += strength * (3 * away / far * along[:, None] - moment) / far**3
        d.raw = d.raw + d.rot_nm.inv().apply(change_n) @ d.distortion.T

    return fault


# --- the kinds -------------------------------------------------------------------------------


@dataclass(frozen=True)
class Kind:
    """A kind of recording: how it is made, and whether anything is wrong with it.

    `good`: nothing is wrong, the verdict should be good. `magnitude` is what the reference says,
    0 for none.
    """

    name: str
    motion: Callable[[int, Rng], Rotation]
    faults: tuple[Fault, ...] = ()
    good: bool = False
    n: int = 3000
    noise: float = NOISE
    magnitude: float = MAGNITUDE
    iron: float = 15_000.0
    soft: float = 0.06

    def reference(self, recording: Recording) -> ag.Reference | None:
        """The field of the place where roll and pitch can make use of it, else its magnitude."""
        if not self.magnitude:
            return None
        if recording.samples.roll_deg is None:
            return ag.Reference.constant(self.magnitude)
        return ag.Reference.vector(FIELD_N, frame="n")

    def recording(self, seed: int) -> Recording:
        """The recording of a seed."""
        return record(
            seed,
            self.motion,
            self.faults,
            n=self.n,
            noise=self.noise,
            iron=self.iron,
            soft=self.soft,
        )


def _good() -> list[Kind]:
    return [
        Kind("clean, tumbled", tumble, good=True),
        Kind("clean, tumbled, 500 rows", tumble, n=500, good=True),
        Kind("clean, tumbled, 30 000 rows", tumble, n=30_000, good=True),
        Kind("clean, no reference", tumble, magnitude=0.0, good=True),
        Kind("clean, no clock", tumble, (without_time,), good=True),
        Kind("clean, tilts of 60°", tilts(60), good=True),
        Kind("clean, quiet sensor", tumble, noise=20.0, good=True),
        Kind("clean, noisy sensor", tumble, noise=500.0, good=True),
        Kind("clean, resolution of 100 nT", tumble, (quantised(100.0),), good=True),
        Kind("clean, large iron", tumble, iron=60_000.0, soft=0.15, good=True),
        Kind("clean, no iron", tumble, iron=1.0, soft=0.0, good=True),
        Kind("clean, 1 % gross outliers", tumble, (outliers(0.01, 20_000),), good=True),
        Kind("clean, with roll and pitch", tilts(45), (with_attitude(),), good=True),
        Kind("clean, still for 50 %, then tumbled", still_then(0.5, tumble), good=True),
        Kind("clean, still for 80 %, then tumbled", still_then(0.8, tumble), good=True),
        Kind("clean, still for 90 %, then tumbled", still_then(0.9, tumble), good=True),
        Kind("clean, still for 95 %, then tumbled", still_then(0.95, tumble), n=6000, good=True),
        Kind("clean, still for 99 %, then tumbled", still_then(0.99, tumble), n=30_000, good=True),
    ]


def _of_the_sensor() -> list[Kind]:
    return [
        *(
            Kind(f"soft saturation at {a / 1e3:.0f} µT", tumble, (soft_saturation(a),))
            for a in (70_000.0, 90_000.0, 150_000.0, 300_000.0)
        ),
        Kind("soft saturation at 90 µT, tilts of 60°", tilts(60), (soft_saturation(9e4),)),
        *(
            Kind(f"saturation across axes at {a / 1e3:.0f} µT", tumble, (saturation_across(a),))
            for a in (100_000.0, 200_000.0)
        ),
        *(
            Kind(f"cubic non-linearity {100 * s:g} %", tumble, (cubic(s),))
            for s in (0.002, 0.005, 0.01, 0.02, 0.05, 0.1)
        ),
        Kind("cubic non-linearity 0.5 %, tilts of 30°", tilts(30), (cubic(0.005),)),
        Kind("cubic non-linearity 2 %, tilts of 30°", tilts(30), (cubic(0.02),)),
        *(
            Kind(f"quadratic non-linearity {100 * s:g} %", tumble, (square(s),))
            for s in (0.01, 0.03)
        ),
        Kind("clipped at 45 µT", tumble, (clipped(45_000.0),)),
        *(Kind(f"hysteresis {100 * s:g} %", tumble, (hysteresis(s),)) for s in (0.01, 0.03, 0.1)),
        *(Kind(f"slow sensor, {r:g} rows", tumble, (lag(r),)) for r in (0.5, 2.0, 8.0)),
        *(
            Kind(f"steps of {s / 1e3:g} µT", tumble, (quantised(s),))
            for s in (1000.0, 5000.0, 20_000.0, 45_000.0, 70_000.0)
        ),
        Kind("steps of 20 µT, quiet", tumble, (quantised(20_000.0),), noise=10.0),
        *(
            Kind(f"one axis changes its gain by {100 * s:g} %", tumble, (gain_changes(1, s),))
            for s in (0.01, 0.03, 0.1)
        ),
        Kind("one axis stops", tumble, (axis_dies(2),)),
        *(
            Kind(
                f"second sensor {s / 1e3:g} µT apart in alternate rows", tumble, (second_sensor(s),)
            )
            for s in (1000.0, 3000.0, 10_000.0)
        ),
        Kind("second sensor 3 µT apart in every third row", tumble, (second_sensor(3000.0, 3),)),
        *(
            Kind(f"two of five rows from a sensor {s / 1e3:g} µT and 2 % apart", tumble, (mixed,))
            for s in (1000.0, 3000.0)
            for mixed in [mixed_sensors(s, 0.4, 0.02)]
        ),
        Kind("one axis reads what another does", tumble, (axis_copied,)),
        Kind("noise 100, 200, 600 nT by axis", tumble, (unequal_noise(100, 200, 600),)),
        Kind(
            "noise 100, 200, 600 nT by axis, tilts of 30°",
            tilts(30),
            (unequal_noise(100, 200, 600),),
        ),
        *(
            Kind(f"noise with memory, AR {m:g}", tumble, (coloured(m, 200.0),))
            for m in (0.9, 0.99, 0.999)
        ),
        Kind("noise with memory, AR 0.99, tilts of 45°", tilts(45), (coloured(0.99, 200.0),)),
        *(
            Kind(f"bias walks {s / 1e3:g} µT", tumble, (random_walk(s),))
            for s in (300.0, 1000.0, 3000.0)
        ),
    ]


def _of_the_place() -> list[Kind]:
    return [
        *(
            Kind(f"bias moves by {100 * s:g} % over a tenth", tumble, (slow_step(s),))
            for s in (0.005, 0.01, 0.03, 0.1)
        ),
        *(
            Kind(f"bias drifts by {s / 1e3:g} µT, tilts of 30°", tilts(30), (steady_drift(s),))
            for s in (300.0, 1000.0)
        ),
        *(
            Kind(f"current of {s / 1e3:g} µT at random", tumble, (switching(s),))
            for s in (1000.0, 2500.0, 8000.0)
        ),
        *(
            Kind(f"current of {s / 1e3:g} µT in bursts, tilts of 60°", tilts(60), (bursts(s),))
            for s in (1000.0, 2500.0)
        ),
        *(
            Kind(f"{s / 1e3:g} µT with the pitch, tilts of 60°", tilts(60), (follows_pitch(s),))
            for s in (1000.0, 3000.0)
        ),
        Kind("3 µT near a floor of steel", tumble, (steel_below(3000.0),)),
        Kind("current of 2.5 µT at random, tilts of 45°", tilts(45), (switching(2500.0),)),
        *(
            Kind(f"{s / 1e3:g} µT that follow the bank", tumble, (follows_attitude(s),))
            for s in (1000.0, 3000.0, 8000.0)
        ),
        Kind("3 µT that follow the bank, tilts of 45°", tilts(45), (follows_attitude(3000.0),)),
        *(
            Kind(f"outliers of {s / 1e3:g} µT in one direction", tumble, (one_sided_outliers(s),))
            for s in (1000.0, 3000.0, 10_000.0)
        ),
        *(
            Kind(f"gross outliers {100 * s:g} %", tumble, (outliers(s, 20_000.0),))
            for s in (0.05, 0.2, 0.4)
        ),
        Kind("outliers 5 %, 100 rows, tilts of 30°", tilts(30), (outliers(0.05, 20_000.0),), n=100),
        *(
            Kind(f"a magnet of {s / 1e3:g} µT is passed", tumble, (magnet_passes(s),))
            for s in (3000.0, 10_000.0, 50_000.0)
        ),
        *(
            Kind(f"a magnet of {s / 1e3:g} µT is added", tumble, (magnet_added(s),))
            for s in (500.0, 2000.0, 10_000.0, 40_000.0)
        ),
        *(
            Kind(f"field uneven by {s / 1e3:g} µT", tumble, (gradient(s),))
            for s in (500.0, 1500.0, 5000.0)
        ),
        *(
            Kind(f"field uneven by {s / 1e3:g} µT, tilts of 45°", tilts(45), (gradient(s),))
            for s in (500.0, 1500.0)
        ),
    ]


def _of_the_log() -> list[Kind]:
    return [
        *(Kind(f"{c} poses held still", poses(c, 3000 // c)) for c in (6, 9, 12, 14, 24)),
        Kind("12 poses held still, quiet", poses(12, 250), noise=10.0),
        Kind("exact circles", circles),
        Kind("exact circles, quiet", circles, noise=20.0),
        *(
            Kind(f"still for {100 * s:g} %, then tilts of 30°", still_then(s, tilts(30)))
            for s in (0.8, 0.95)
        ),
        *(Kind(f"directions within {a}°", cap(a)) for a in (15, 30, 45, 60)),
        *(Kind(f"tilts of {a}°", tilts(a)) for a in (5, 10, 20, 30)),
        *(Kind(f"tilts of {a}°, 100 rows", tilts(a), n=100) for a in (20, 30, 45)),
        Kind("50 rows", tumble, n=50),
        Kind("15 rows", tumble, n=15),
        Kind("last rows in another unit, × 0.1", tumble, (unit_changes(0.1),)),
        Kind("last rows in another unit, × 1.05", tumble, (unit_changes(1.05),)),
        Kind("each reading ten times", tumble, (repeated(10),)),
        *(
            Kind(f"magnitude wrong by {100 * s:g} %", tumble, magnitude=MAGNITUDE * (1 + s))
            for s in (0.01, 0.05, 0.3)
        ),
    ]


def _of_the_attitude() -> list[Kind]:
    return [
        *(
            Kind(f"roll and pitch, tilts of {a}°", tilts(a), (with_attitude(),))
            for a in (5, 15, 30)
        ),
        *(
            Kind(f"roll biased by {b:g}°, tilts of {a}°", tilts(a), (with_attitude(biased_deg=b),))
            for b, a in ((1.0, 15), (3.0, 15), (3.0, 45))
        ),
        Kind("attitude errors of 1° with memory", tilts(20), (with_attitude(1.0, memory=0.99),)),
        *(
            Kind(f"sensor turned by {b:g}°, tilts of {a}°", tilts(a), (misaligned(b),))
            for b, a in ((2.0, 30), (5.0, 30), (5.0, 60))
        ),
        Kind("roll and pitch of another vehicle", tilts(40), (another_vehicle,)),
        *(
            Kind(f"heading {name}", tilts(30), (heading_is(law),))
            for name, law in (
                ("negated", lambda h: -h),
                ("from east", lambda h: 90 - h),
                ("off by 180°", lambda h: h + 180),
                ("in radians", lambda h: np.radians(h)),
                ("magnetic", lambda h: h - 12.0),
            )
        ),
        Kind("levelled, cubic non-linearity 2 %", tilts(30), (cubic(0.02), with_attitude())),
        *(
            Kind(
                f"levelled, saturation across axes at {s / 1e3:.0f} µT",
                tilts(30),
                (saturation_across(s), with_attitude()),
            )
            for s in (200_000.0, 400_000.0)
        ),
        Kind("levelled, 2 µT with the pitch", tilts(30), (follows_pitch(2000.0), with_attitude())),
        *(
            Kind(f"with heading, {name}", tilts(45), (fault, with_attitude(heading=True)))
            for name, fault in (
                ("one axis reads what another does", axis_copied),
                ("one axis never moves", axis_dead),
            )
        ),
        Kind("levelled, current at random", tilts(30), (switching(2500.0), with_attitude())),
        Kind(
            "levelled, 3 µT that follow the bank",
            tilts(30),
            (follows_attitude(3000.0), with_attitude()),
        ),
        Kind("levelled, bias drifts by 1 µT", tilts(30), (steady_drift(1000.0), with_attitude())),
        Kind("levelled, field uneven by 1.5 µT", tilts(30), (gradient(1500.0), with_attitude())),
    ]


def _later() -> list[Kind]:
    """Kinds that came later: a kind's number seeds its draws."""
    return [
        Kind("exact circles about two axes", two_circles),
        Kind("clean, 12 000 noisy rows, tilts of 30°", tilts(30), good=True, n=12_000, noise=400.0),
        Kind("35 rows, noise AR 0.9", tumble, (coloured(0.9, 150.0),), n=35, noise=0.0),
        *(
            Kind(f"{name}, {motions}", motion, faults)
            for motions, motion, aided in (
                ("tumbled", tumble, ()),
                ("tilts of 45°", tilts(45), ()),
                ("levelled, tilts of 45°", tilts(45), (with_attitude(),)),
            )
            for name, faults in (
                ("ripple of 0.3 µT every 10 µT", (ripple(300.0, 10_000.0), *aided)),
                ("a bit of 1.6 µT is stuck", (stuck_bit(100.0, 4), *aided)),
                ("a quarter of the codes is missing", (missing_codes(100.0, 64, 16), *aided)),
                ("0.5 µT that follow the turns", (follows_turns(500.0), *aided)),
                ("carried about at 2 µT a metre", (carried(2000.0), *aided)),
                ("carried about at 6 µT a metre", (carried(6000.0), *aided)),
                (
                    "saturation across axes at 300 µT and 1.5 µT that follow the bank",
                    (saturation_across(300_000.0), follows_attitude(1500.0), *aided),
                ),
            )
        ),
        *(
            Kind(f"readings of y within {s / 1e3:g} µT are zero", tumble, (dead_zone(s),))
            for s in (500.0, 2000.0)
        ),
        Kind("y off by 8 µT between 10 and 11 µT", tumble, (errs_between(10e3, 11e3, 8e3),)),
        *(
            Kind(f"{name}, {motions}", motion, faults)
            for motions, motion, aided in (
                ("tilts of 45°", tilts(45), ()),
                ("levelled, tilts of 45°", tilts(45), (with_attitude(),)),
            )
            for name, faults in (
                ("raised on an arm by 3 µT", (raised(3000.0), *aided)),
                ("a load of 1 µT at levels", (load_levels(1000.0), *aided)),
                ("warm-up of 1 µT", (warm_up(1000.0), *aided)),
                ("two places, 1 µT apart", (two_places(1000.0), *aided)),
            )
        ),
        Kind("gain switches by 1 % at 40 µT", tumble, (gain_switches(0.01),)),
        Kind("y wraps at 50 µT", tumble, (wraps(50_000.0),)),
        Kind("axes sampled 0.2 rows apart", tumble, (axes_apart(0.2),)),
        Kind("pitch negated, tilts of 8°", tilts(8), (mirrored("pitch_deg"),)),
        Kind("roll negated, tilts of 8°", tilts(8), (mirrored("roll_deg"),)),
        Kind("attitude held for five rows", tilts(30), (held_attitude(5),)),
        Kind("attitude 0.3 s late", tilts(30), (late_attitude(0.3),)),
        *(Kind(f"tumbled {h:g} m above rebar", tumble, (near_rebar(h),)) for h in (1.0, 1.8)),
        Kind("clean, in a swell", swell, good=True),
        Kind("clean, in a swell, with roll and pitch", swell, (with_attitude(),), good=True),
        Kind("saturation across axes at 300 µT, in a swell", swell, (saturation_across(3e5),)),
        Kind(
            "saturation across axes at 200 µT, tilts of 45°", tilts(45), (saturation_across(2e5),)
        ),
        Kind("gains go with the field across by 1 %, tumbled", tumble, (cross_field(0.01),)),
        Kind(
            "gains go with the field across by 1 %, levelled, tilts of 40°",
            tilts(40),
            (cross_field(0.01), with_attitude()),
            n=1000,
        ),
        Kind("x saturates at 150 µT, tilts of 50°", tilts(50), (one_axis_saturates(15e4),), n=1000),
        Kind(
            "levelled, 1.5 µT that follow the bank, in a swell",
            swell,
            (follows_attitude(1500.0), with_attitude()),
        ),
        *(
            Kind(f"{name}, {motions}", motion, faults)
            for motions, motion, aided in (
                ("tumbled", tumble, ()),
                ("levelled, tilts of 45°", tilts(45), (with_attitude(),)),
            )
            for name, faults in (
                ("gains differ by 1.4 % by sign", (gains_by_sign(0.007), *aided)),
                ("x holds 0.7 % of the square of z", (square_across(0.007), *aided)),
                ("y is read every fourth row", (one_axis_held(4), *aided)),
                ("gains step by 1.5 %", (gain_steps(0.015), *aided)),
                ("a filter begins half-way", (filter_begins(3.0), *aided)),
                ("set and reset leave 0.6 µT", (set_and_reset(600.0, 64), *aided)),
                ("parked beside iron of 3 µT", (parked_beside_iron(3000.0), *aided)),
                ("a load of 1.5 µT swings late", (pendulum(1500.0), *aided)),
            )
        ),
        Kind("roll and pitch 1 s behind, smoothed", tilts(30), (smoothed_attitude(10.0),)),
        Kind("roll leans by 3° in turns", tilts(30), (leans_in_turns(3.0),)),
    ]


KINDS = [
    *_good(),
    *_of_the_sensor(),
    *_of_the_place(),
    *_of_the_log(),
    *_of_the_attitude(),
    *_later(),
]
"""Every kind of recording, the good ones first."""
