"""What a record is, known before the fit: python -m benchmarks.records [--draws 20] [--quick].

Each kind of damage of the README's list is written to a file as a logger with that fault writes it,
and calibrated as `agonic calibrate` does. A draw has its own sensor, motion and calibration.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import polar

from agonic.console.options import Place
from agonic.errors import AgonicError
from agonic.recording.each_sensor import calibrate_each
from agonic.simulation import simulate
from benchmarks import tables

Array = np.ndarray
COUNTS_PER_NT = (1 / 150, 0.0109, 0.016, 0.0684, 0.075, 0.1638)
"""Of AK8963, HMC5883L, BMM150, LIS3MDL, RM3100 and MMC5983MA, as their makers state them."""
WRONG_SD = 3.0
SEAT_DEG = 0.5
"""Of a turn of a sensor, taken as one of its standard errors."""
OUTCOMES = ("right", "otherwise", "silent", "wrong")


class Record(NamedTuple):
    """A file's text, the true bias (3,) in its unit or None where nothing is to be calibrated,
    what is typed behind `agonic calibrate LOG`, and the turn (3, 3) from the sensor's axes to the
    vehicle's where that is to be found."""

    text: str
    bias: Array | None
    typed: Mapping[str, object] = MappingProxyType({})
    seat: Array | None = None


class Kind(NamedTuple):
    """A fault, its record by the seed, the words by which it is named rightly, and what judges the
    file where that is not `agonic calibrate`."""

    name: str
    make: Callable[[np.random.Generator, int], Record]
    right: str
    judge: Callable[[Path, Record], tuple[str, str]] | None = None


class Turned(NamedTuple):
    """Readings (n, 3) of a turned sensor, their true bias, and what was beside them."""

    field: Array
    bias: Array
    time: Array
    acceleration: Array
    rotation_rate: Array


def turn(g: np.random.Generator, seed: int, size: float = 1.0, most_bias: float = 0.5) -> Turned:
    """A sensor turned by hand; `size` is the unit of its readings in nT⁻¹."""
    pace = float(g.choice([2.0, 3.0, 5.0]))
    made = simulate(
        "tumble", n=int(g.choice([1500, 3000])), rate_Hz=float(g.choice([25.0, 50.0])),
        magnitude=float(g.uniform(30e3, 60e3)), noise=float(g.choice([100.0, 200.0])), seed=seed,
        pace_s=pace,
    )  # fmt: skip
    s = made.samples
    bias = made.truth.bias
    wanted = np.clip(bias, -most_bias * 50e3, most_bias * 50e3)
    field = s.field + (wanted - bias)
    return Turned(field * size, wanted * size, s.time, s.acceleration, s.rotation_rate)


def counts(g: np.random.Generator, seed: int, k: int | None = None) -> Turned:
    """The same in whole counts of one of the sensors."""
    made = turn(g, seed, COUNTS_PER_NT[seed % len(COUNTS_PER_NT) if k is None else k])
    return made._replace(field=np.round(made.field))


def write(head: str, *columns: Array, places: int = 0) -> str:
    """The text of a table."""
    table = np.column_stack(columns)
    rows = (",".join(f"{value:.{places}f}" for value in row) for row in table)
    return "\n".join([head, *rows]) + "\n"


def put(g: np.random.Generator, made: Turned, field: Array, places: int = 0) -> Record:
    """Readings alone, or beside a clock, in raw units."""
    if g.random() < 0.5:
        return Record(write("x,y,z", field, places=places), made.bias)
    text = write("time_ms,mx,my,mz", 1000 * made.time, field, places=places)
    return Record(text, made.bias)


def wrap(values: Array, period: float, low: float) -> Array:
    """Values as a register of that period holds them, from `low` on."""
    return (values - low) % period + low


def make_unsigned(g: np.random.Generator, seed: int) -> Record:
    made = counts(g, seed)
    return put(g, made, wrap(made.field, 65536, 0))


def make_wide_unsigned(g: np.random.Generator, seed: int) -> Record:
    """Of 12 to 24 bits."""
    bits = (12, 13, 14, 20, 24)[seed % 5]
    made = turn(g, seed, min(0.4 * 2.0**bits / 100e3, 0.0684))
    return put(g, made, wrap(np.round(made.field), 2.0**bits, 0))


def make_cut(g: np.random.Generator, seed: int) -> Record:
    made = turn(g, seed, float(g.uniform(0.8, 1.3)))
    low = 0 if seed % 2 else -32768
    return put(g, made, wrap(np.round(made.field), 65536, low))


def make_nanotesla(g: np.random.Generator, seed: int) -> Record:
    made = turn(g, seed)
    field = wrap(np.round(made.field), 65536, -32768)
    if seed % 2:
        return Record(write("time_s,x_nT,y_nT,z_nT", made.time, field, places=2), made.bias)
    text = write("time_s,mag_x_uT,mag_y_uT,mag_z_uT", made.time, field / 1000, places=3)
    return Record(text, made.bias)


def make_swapped(g: np.random.Generator, seed: int) -> Record:
    made = counts(g, seed)
    words = made.field.astype(np.int64) % 65536
    swapped = wrap((words & 255) * 256 + (words >> 8), 65536, -32768)
    axes = list(range(3)) if seed % 3 else [seed % 9 // 3]
    field = made.field.copy()
    field[:, axes] = swapped[:, axes]
    return put(g, made, field)


def make_signed_low(g: np.random.Generator, seed: int) -> Record:
    made = turn(g, seed, float(g.choice([*COUNTS_PER_NT[:5], 0.5])))
    field, axis = np.round(made.field), seed % 3
    low = field[:, axis] % 256
    field[:, axis] -= 256 * (low >= 128)
    scale = int(g.choice([1, 1, 2]))
    if seed % 4 == 3:  # the others with digits behind the point
        field[:, [k for k in range(3) if k != axis]] += 0.1 * g.integers(-4, 5, (len(field), 2))
    return put(g, made._replace(bias=made.bias * scale), field * scale, places=seed % 4 // 3)


def make_extended_low(g: np.random.Generator, seed: int) -> Record:
    made = counts(g, seed)
    field, axis = made.field.copy(), seed % 3
    low = field[:, axis] % 256
    field[low >= 128, axis] = low[low >= 128] - 256
    return put(g, made, field)


def make_low_before(g: np.random.Generator, seed: int) -> Record:
    made = counts(g, seed)
    low = made.field % 256
    field = made.field - low + np.vstack([low[:1], low[:-1]])
    return put(g, made, field)


def make_high_before(g: np.random.Generator, seed: int) -> Record:
    made = counts(g, seed)
    low = made.field % 256
    high = made.field - low
    return put(g, made, np.vstack([high[:1], high[:-1]]) + low)


def make_marker(g: np.random.Generator, seed: int) -> Record:
    made = counts(g, seed, k=seed % 5)
    rows = g.random(len(made.field)) < float(g.choice([0.003, 0.01, 0.04]))
    axes = list(range(3)) if seed % 2 else [seed % 3]
    field = made.field.copy()
    field[np.ix_(rows, axes)] = (-4096, -32768, 65535)[seed // 2 % 3]
    return put(g, made, field)


def make_sensor_wrap(g: np.random.Generator, seed: int) -> Record:
    made = turn(g, seed, float(g.choice([0.0109, 1 / 150, 0.0684])))
    reach = np.abs(made.field).max()
    period = 2.0 ** np.floor(np.log2(2 * reach))  # the largest that the readings do not fit into
    return put(g, made, wrap(np.round(made.field), period, -period / 2))


def make_tag(g: np.random.Generator, seed: int) -> Record:
    made = turn(g, seed, 0.01)
    felt = -made.acceleration / 9.80665 + g.normal(size=made.field.shape) * 0.01
    when = [f"A01,2025-06-01 10:{t // 60:02.0f}:{t % 60:06.3f}" for t in made.time]
    rows = write("", felt, made.field, places=4).splitlines()[1:]
    head = "TagID,Timestamp,X,Y,Z,compX,compY,compZ,Pressure"
    text = "\n".join([head, *(f"{w},{row},1013" for w, row in zip(when, rows, strict=True))])
    return Record(text + "\n", made.bias)


def make_accelerometer(g: np.random.Generator, seed: int) -> Record:
    made = turn(g, seed)
    size = (1.0, 9.80665)[seed % 2]
    felt = made.acceleration / 9.80665 + g.normal(size=made.field.shape) * 0.005
    moved = np.convolve(g.normal(size=len(felt)), np.ones(20) / 20, "same") > 0.3
    felt += 0.1 * moved[:, None] * g.normal(size=felt.shape)
    return Record(write("Time,X,Y,Z", made.time, size * felt, places=4), None)


def put_beside(made: Turned, field: Array) -> Record:
    head = "time_s,mag_x_uT,mag_y_uT,mag_z_uT,acc_x_m_s2,acc_y_m_s2,acc_z_m_s2,gyro_x_rad_s,"
    beside = (made.acceleration, made.rotation_rate)
    text = write(f"{head}gyro_y_rad_s,gyro_z_rad_s", made.time, field, *beside, places=4)
    return Record(text, None)


def make_zeros(g: np.random.Generator, seed: int) -> Record:
    made = turn(g, seed, 1e-3)
    field = np.zeros(made.field.shape)
    field[: seed % 4] = made.field[: seed % 4]
    return put_beside(made, field)


def make_frozen(g: np.random.Generator, seed: int) -> Record:
    made = turn(g, seed, 1e-3)
    field = np.tile(made.field[9], (len(made.field), 1))
    field[: seed % 10] = made.field[: seed % 10]
    return put_beside(made, field)


def make_elsewhere(g: np.random.Generator, seed: int) -> Record:
    made = simulate("car", n=2000, noise=100.0, seed=seed).samples
    place = np.array([52.1, 5.2]) + np.cumsum(g.normal(size=(2000, 2)) * 1e-6, axis=0)
    head = "time_s,mag_x_nT,mag_y_nT,mag_z_nT,acc_x_m_s2,acc_y_m_s2,acc_z_m_s2,latitude_deg,"
    columns = (made.time, made.field, made.acceleration, place)
    at = f"{52.1 - g.uniform(2, 60):.1f},{g.uniform(-20, 30):.1f}"
    text = write(head + "longitude_deg", *columns, places=6)
    return Record(text, None, {"at": at, "date": "2026-05-01"})


def make_fraction(g: np.random.Generator, seed: int) -> Record:
    made = counts(g, seed, k=1)
    whole, part = made.time // 1, 1000 * (made.time % 1)
    clock = [
        f"2025-06-01,10:{s // 60:02.0f}:{s % 60:02.0f},{ms:.0f}"
        for s, ms in zip(whole, part, strict=True)
    ]
    rows = write("", made.field).splitlines()[1:]
    head = "RTC Date,RTC Time,Millis,mx,my,mz"
    text = "\n".join([head, *(f"{w},{row}" for w, row in zip(clock, rows, strict=True))])
    return Record(text + "\n", made.bias)


JUMPS = r"signed|unsigned|wrap|16 bits"
KINDS = (
    Kind("int16 as uint16", make_unsigned, r"unsigned"),
    Kind("12 to 24 bits as unsigned", make_wide_unsigned, r"unsigned|wrap"),
    Kind("18 bits cut to 16", make_cut, r"wrap|unsigned"),
    Kind("nT wrapped in int16", make_nanotesla, r"wrap"),
    Kind("bytes exchanged", make_swapped, r"bytes .*exchanged|exchanged .*bytes"),
    Kind("low byte signed", make_signed_low, r"low byte .*signed"),
    Kind("low byte's sign extended", make_extended_low, r"sign of the low byte was extended"),
    Kind("low byte of the one before", make_low_before, r"low byte .*before"),
    Kind("high byte of the one before", make_high_before, r"high byte .*before"),
    Kind("marker among readings", make_marker, r"marker"),
    Kind("sensor wraps", make_sensor_wrap, r"wrap"),
    Kind("animal tag", make_tag, ""),
    Kind("accelerometer alone", make_accelerometer, r"accelerometer|gravity"),
    Kind("zeros beside a live unit", make_zeros, r"never change"),
    Kind("frozen beside a live unit", make_frozen, r"never change"),
    Kind("--at elsewhere", make_elsewhere, r"km from --at"),
    Kind("clock in seconds and millis", make_fraction, ""),
)


def judge(kind: Kind, record: Record, folder: Path) -> tuple[str, str]:
    """The outcome, and what was said."""
    path = folder / "log.csv"
    path.write_text(record.text, encoding="utf-8")
    if kind.judge is not None:
        return kind.judge(path, record)
    given: dict[str, Any] = dict(record.typed)
    place = Place(**{name: given.pop(name) for name in Place._fields if name in given})
    try:
        _, results, failures = calibrate_each(path, place=place, **given)
    except AgonicError as error:
        results, failures = [], [("", str(error))]
    said = " ".join([*(f"{r.verdict}: {r.status}" for r in results), *(t for _, t in failures)])
    if not results:
        return ("right" if kind.right and re.search(kind.right, said) else "otherwise"), said
    (made,) = results
    off = WRONG_SD + 1 if record.bias is None else measure(made, record.bias)
    if record.seat is not None:
        left = polar(made.fit.calibration.matrix)[0] @ record.seat.T
        turned = np.degrees(np.arccos(np.clip((np.trace(left) - 1) / 2, -1.0, 1.0)))
        off, said = max(off, turned / SEAT_DEG), f"{turned:.2f}° off: {said}"
    named = bool(kind.right) and re.search(kind.right, said) is not None
    if made.verdict == "good" and off > WRONG_SD:
        return "wrong", f"{off:.0f} sd {said}"
    if named or (not kind.right and made.verdict == "good"):
        return "right", said
    return ("silent" if made.verdict == "good" else "otherwise"), said


def measure(made: object, bias: Array) -> float:
    """Of the bias, the error over three times its stated one, as one of these; 1 % of the field."""
    fit = made.fit  # type: ignore[attr-defined]
    scale = 1000 if fit.calibration.unit_out == "nT" and np.abs(bias).max() < 100 else 1
    off = np.linalg.norm(fit.calibration.bias - bias * scale)
    return float(off / max(np.linalg.norm(fit.sd[:3]), 0.002 * made.fit.calibration.magnitude))


CLEAN = (
    ("tumble", {"pace_s": 2.0}), ("sphere", {}), ("belt", {}), ("hand", {}), ("circle", {}),
    ("flight", {}), ("boat", {}), ("car", {}), ("static", {}),
)  # fmt: skip
ALARM = re.compile(
    r"unsigned|wrap|exchanged|low byte|high byte|marker|never change|km from --at|"
    r"accelerometer's readings|gravity's behaviour"
)


def write_clean(g: np.random.Generator, motion: str, settings: dict, seed: int) -> str:
    """A log without damage, at one of the sensors' resolutions or all digits."""
    made = simulate(motion, n=int(g.choice([60, 300, 2000])), seed=seed, **settings).samples
    places = int(g.choice([0, 1, 3]))
    size = float(g.choice([*COUNTS_PER_NT, 1.0, 0.001, 0.002]))
    field = made.field * size
    if places == 0:
        field = np.round(field) + float(g.choice([0, 0, 32768, 131072]))
    return write("time_s,mx,my,mz", made.time, field, places=max(places, 2))


def count_alarms(draws: int, folder: Path) -> Iterable[tuple[str, int, int]]:
    """Of each motion how many clean logs were alarmed, of how many."""
    for motion, settings in CLEAN:
        alarms = 0
        for seed in range(draws):
            text = write_clean(np.random.default_rng(seed), motion, settings, seed)
            _, said = judge(Kind(motion, make_tag, "-"), Record(text, None), folder)
            if ALARM.search(said):
                alarms += 1
                tables.progress(f"alarm: {motion} {seed}: {said[:300]}")
        yield motion, alarms, draws


def main() -> None:
    from benchmarks import records_forms  # stands on this module

    asked = tables.arguments(__doc__ or "", 20)
    draws = 2 if asked.quick else asked.draws
    rows, clean = [], []
    with TemporaryDirectory() as name:
        folder = Path(name)
        for kind in (*KINDS, *records_forms.KINDS):
            found: Counter[str] = Counter()
            for seed in range(draws):
                outcome, said = judge(kind, kind.make(np.random.default_rng(seed), seed), folder)
                found[outcome] += 1
                if outcome != "right":
                    tables.progress(f"{kind.name} {seed}: {outcome}: {said[:300]}")
            rows.append((kind.name, *(f"{found[o]}" for o in OUTCOMES)))
        for motion, alarms, total in count_alarms(draws, folder):
            clean.append((motion, f"{alarms}", f"{total}"))
    header = (f"of {draws} draws", "named right", "otherwise", "silent", "good and wrong")
    print(tables.markdown(header, rows))
    print("\nLogs without damage, at resolutions from 150 nT to all digits:\n")
    print(tables.markdown(("motion", "alarmed", "logs"), clean))


if __name__ == "__main__":
    main()
