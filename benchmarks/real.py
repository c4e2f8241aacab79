"""What agonic makes of real recordings, beside others: python -m benchmarks.real [--quick].

The recordings lie in ../shared/recordings, or in the folder that AGONIC_RECORDINGS names.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import agonic as ag
from agonic.errors import AgonicError
from agonic.field.place import choose_reference
from agonic.logs.read import open_log
from agonic.recording.calibrated import Calibrated, calibrate
from agonic.recording.choice import choose
from benchmarks import tables
from benchmarks.peers import ESTIMATORS

Array = NDArray[np.float64]
Estimate = Callable[[ag.Samples, ag.Samples], tuple[Array, float | None]]
"""The field of the second samples by a fit to the first, and the error that it states."""

BLOCKS = 8
MOST_ROWS = 6000
SCIPY = "SciPy least squares"
RIVALS = {
    "magyc": "magyc ellipsoid",
    "magcal": "magcal",
}
INTRODUCTION = f"""Each recording is cut into {BLOCKS} blocks of time. The even blocks are judged
by a fit to the odd ones and the reverse, so every figure is of readings that the fit has not seen.
Where an optical system knows the heading, the figure is the error of a heading made level with its
roll and pitch, rms in degrees, after one constant turn; agonic is not shown that heading. Elsewhere
it is the scatter of the magnitude over what it should have been, in percent. `as flown` is what the
device or vehicle had made of the readings; `stated` is what the fit said such an error should be; a
figure in brackets is of a calibration that agonic refuses to give. Where the field itself was
disturbed, or the sensor hardly turned, the best verdict is one that says so: a steady magnitude
tells nothing of directions that were never visited."""
NO_FOLDER = "the recordings were not found: set AGONIC_RECORDINGS"


@dataclass(frozen=True)
class Recording:
    """A file, what is known of it, and how to read it; `between` are seconds from its start."""

    path: str
    known: str
    sensor: str | None = None
    unit: str | None = None
    between: tuple[float, float] | None = None

    @property
    def name(self) -> str:
        """The file and the sensor."""
        stem = Path(self.path).stem[:34]
        return f"{stem} {self.sensor}" if self.sensor else stem


BROAD = "vehicle/broad/"
RECORDINGS = (
    Recording(f"{BROAD}02_undisturbed_slow_rotation_B.mat", "hand-held, undisturbed"),
    Recording(f"{BROAD}05_undisturbed_slow_rotation_with_breaks_B.mat", "the same with breaks"),
    Recording(f"{BROAD}07_undisturbed_fast_rotation_B.mat", "fast; the field is late by 14 ms"),
    Recording(f"{BROAD}12_undisturbed_slow_translation_C.mat", "hardly turned: to be refused"),
    Recording(f"{BROAD}28_disturbed_stationary_magnet_A.mat", "disturbed: a magnet is passed"),
    Recording(f"{BROAD}32_disturbed_attached_magnet_1cm.mat", "disturbed: a magnet for half"),
    Recording("vehicle/ardupilot/log171.bin", "flight", "MAG", between=(84, 236)),
    Recording("vehicle/ardupilot/log171.bin", "flight, motor field", "MAG2", between=(84, 236)),
    Recording("vehicle/ardupilot/log171.bin", "never turned round", "MAG3", between=(84, 236)),
    Recording("vehicle/ardupilot/center_0003.bin", "carried about, level only"),
    Recording("vehicle/px4/sample.ulg", "flight, little turning"),
    Recording("vehicle/ardusub/small.BIN", "under water, badly calibrated as flown"),
    Recording("vehicle/fusion/sensor_data.csv", "hand-held, poor coverage"),
    Recording("pointclouds/aleksandrbazhin_mag_out.txt", "points, counts, no times"),
    Recording("imu/hmc5883l_compass.mat", "turned by hand over the sphere", unit="G"),
    Recording("ros/sparkfun_razor.bag", "turned by hand"),
    Recording("ros/phidgets_imu_upside_down.bag", "turned upside down"),
    Recording("ros/data_going_in_circles.csv", "a car: level, iron about it"),
    Recording(
        "orbit/iss_2021-04-16_all_photos_classified.csv", "space station", unit="uT",
        between=(480, 1e9),
    ),
)  # fmt: skip


class Figure(NamedTuple):
    """An error on readings that were not seen, the one that was stated, and if it was refused."""

    found: float
    stated: float | None = None
    refused: bool = False


def main() -> None:
    """Print the table."""
    asked = tables.arguments("real recordings", draws=1)
    folder = Path(os.environ.get("AGONIC_RECORDINGS", "../shared/recordings"))
    if not folder.is_dir():
        raise SystemExit(NO_FOLDER)
    chosen = RECORDINGS[:2] if asked.quick else RECORDINGS
    rows = [row for recording in chosen if (row := _judge(folder, recording)) is not None]
    header = ["recording", "known", "agonic says", "as flown", SCIPY, *RIVALS, "agonic", "stated"]
    print("\n\n".join([INTRODUCTION, tables.markdown(header, rows)]))


def _judge(folder: Path, recording: Recording) -> list[str] | None:
    """A row of the table; `None` where the file is not there."""
    path = folder / recording.path
    if not path.exists():
        return None
    tables.progress(f"real: {recording.name}")
    samples = _thin(_read(path, recording))
    estimates: dict[str, Estimate] = {
        "as flown": _as_flown,
        SCIPY: _fit_by_scipy,
        **{name: _make_rival(name) for name in RIVALS},
        "agonic": _estimate,
    }
    figures = {name: _measure(samples, estimate) for name, estimate in estimates.items()}
    sign = "°" if _knows_heading(samples) else "%"
    says, own = _say(samples), figures["agonic"]
    if isinstance(own, Figure):
        figures["agonic"] = own = own._replace(refused=says.startswith("refused"))
    shown = [_show(figures[name], sign) for name in estimates]
    stated = _show(Figure(own.stated), sign) if isinstance(own, Figure) and own.stated else "–"
    return [recording.name, recording.known, says, *shown, stated]


def _read(path: Path, recording: Recording) -> ag.Samples:
    log = open_log(path, unit=recording.unit)
    samples = log.sensor(0 if recording.sensor is None else recording.sensor)
    if recording.between is None or samples.time is None:
        return samples
    since = samples.time - samples.time[0]
    return samples.select((since >= recording.between[0]) & (since <= recording.between[1]))


def _thin(samples: ag.Samples) -> ag.Samples:
    """At most so many rows, evenly, so that the table takes minutes."""
    step = -(-len(samples) // MOST_ROWS)
    return samples if step == 1 else samples.select(np.arange(0, len(samples), step))


def _knows_heading(samples: ag.Samples) -> bool:
    known = samples.heading_deg is not None and samples.roll_deg is not None
    return known and not samples.heading_estimated


def _say(samples: ag.Samples) -> str:
    """The verdict of the main job on the whole recording, without the true heading."""
    blind = samples.with_columns(heading_deg=None)
    try:
        reference, settings = choose_reference(blind)
        found: Calibrated = calibrate(blind, reference, **settings)
    except AgonicError:
        return "refused"
    first = next((f.name for f in found.fit.findings if f.severity != "note"), "")
    return f"{found.verdict}: {first}" if first and found.verdict != "good" else found.verdict


def _folds(count: int) -> Iterator[tuple[Array, Array]]:
    """Rows of the odd blocks and of the even ones, and the reverse."""
    odd = (np.arange(count) * BLOCKS // count) % 2 == 1
    for taught in (odd, ~odd):
        yield np.flatnonzero(taught), np.flatnonzero(~taught)


def _measure(samples: ag.Samples, estimate: Estimate) -> Figure | str:
    """The error on the rows of each fold that the fit did not see."""
    errors, stated = [], []
    for taught, judged in _folds(len(samples)):
        test = samples.select(judged)
        try:
            field, sd = estimate(samples.select(taught), test)
        except ImportError:
            return tables.NOT_INSTALLED
        except (AgonicError, ValueError, np.linalg.LinAlgError):
            return "failed"
        errors.append(_find_errors(field, test))
        if sd is not None:
            stated.append(sd)
    whole = float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
    return Figure(whole, float(np.sqrt(np.mean(np.square(stated)))) if stated else None)


def _find_errors(field: Array, samples: ag.Samples) -> Array:
    """Heading minus truth, degrees, about its mean; else the magnitude about its mean, percent."""
    if not _knows_heading(samples):
        size = np.linalg.norm(field, axis=1) / _find_magnitude(samples)
        return np.asarray(100.0 * (size / size.mean() - 1.0))
    level = _level(field, samples)
    error = np.degrees(np.arctan2(-level[:, 1], level[:, 0])) - samples.heading_deg
    middle = np.degrees(np.angle(np.mean(np.exp(1j * np.radians(error)))))
    return np.asarray((error - middle + 180.0) % 360.0 - 180.0)


def _find_magnitude(samples: ag.Samples) -> Array:
    """What the magnitude should have been (n,), by the place of each row; else the same in all."""
    reference, _ = choose_reference(samples.with_columns(heading_deg=None))
    if reference is None or samples.unit == "raw":
        return np.ones(len(samples))
    values = np.asarray(reference.values, dtype=np.float64)
    size = values if values.ndim < 2 else np.linalg.norm(values, axis=1)
    return np.broadcast_to(size, len(samples))


def _level(field: Array, samples: ag.Samples) -> Array:
    """The field turned level by roll and pitch."""
    roll, pitch = np.radians(samples.roll_deg), np.radians(samples.pitch_deg)
    x, y, z = field.T
    across = y * np.sin(roll) + z * np.cos(roll)
    return np.stack(
        [
            x * np.cos(pitch) + across * np.sin(pitch),
            y * np.cos(roll) - z * np.sin(roll),
            across * np.cos(pitch) - x * np.sin(pitch),
        ],
        axis=1,
    )


def _as_flown(_: ag.Samples, test: ag.Samples) -> tuple[Array, float | None]:
    """The readings as the device or the vehicle had them."""
    if test.logged is None:
        return test.field, None
    return (test.field - test.logged.bias) @ test.logged.matrix.T, None


def _make_rival(name: str) -> Estimate:
    """A fit of the magnitude by another library."""

    def fit(train: ag.Samples, test: ag.Samples) -> tuple[Array, float | None]:
        size = float(np.median(np.linalg.norm(train.field - train.field.mean(axis=0), axis=1)))
        bias, matrix = ESTIMATORS[RIVALS[name]](train.field, size, 0.01 * size)
        return (test.field - bias) @ matrix.T, None

    return fit


def _fit_by_scipy(train: ag.Samples, test: ag.Samples) -> tuple[Array, float | None]:
    """Least squares of |W (raw − bias)| − F with SciPy's defaults, W symmetric, from a sphere."""
    from scipy.optimize import least_squares

    known = _find_magnitude(train)
    magnitude = known / known.mean()
    centre = train.field.mean(axis=0)
    size = float(np.linalg.norm(train.field - centre, axis=1).mean())
    points = (train.field - centre) / size

    def unpack(params: Array) -> tuple[Array, Array]:
        xx, yy, zz, xy, xz, yz = params[3:]
        return params[:3], np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def residuals(params: Array) -> Array:
        bias, matrix = unpack(params)
        return np.asarray(np.linalg.norm((points - bias) @ matrix, axis=1) - magnitude)

    found = least_squares(residuals, [0, 0, 0, 1, 1, 1, 0, 0, 0], max_nfev=200)
    bias, matrix = unpack(found.x)
    return ((test.field - centre) / size - bias) @ matrix, None


def _estimate(train: ag.Samples, test: ag.Samples) -> tuple[Array, float | None]:
    """Ours, by the method that the log allows, and the error that it states."""
    blind = train.with_columns(heading_deg=None)
    reference, settings = choose_reference(blind)
    chosen = choose(blind, reference, "auto", settings)
    field = ag.apply(chosen.fit.calibration, test).field
    size = float(np.linalg.norm(field, axis=1).mean())
    noise = float(chosen.fit.noise)
    if not _knows_heading(test):
        return field, 100.0 * noise / size
    horizontal = float(np.median(np.hypot(*_level(field, test)[:, :2].T)))
    coverage = getattr(chosen.fit, "coverage", None)
    own = 0.0 if coverage is None else float(coverage.heading_sd_deg)
    return field, float(np.hypot(own, np.degrees(noise / horizontal)))


def _show(figure: Figure | str, sign: str) -> str:
    """A figure; one of a fit that was refused in brackets."""
    if isinstance(figure, str):
        return figure
    text = f"{figure.found:.3g} {sign}" if sign == "%" else f"{figure.found:.2g}{sign}"
    return f"({text})" if figure.refused else text


if __name__ == "__main__":
    main()
