"""What agonic makes of real recordings, beside others: python -m benchmarks.real [--quick].

The recordings lie in ../shared/recordings, or in the folder that AGONIC_RECORDINGS names. A
recording is a line of `RECORDINGS`; it is judged as `agonic evaluate` judges a log.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import agonic as ag
from agonic.errors import AgonicError
from agonic.field.place import choose_reference
from agonic.health import figure as write
from agonic.logs.read import open_log
from agonic.recording.evaluation.cross_validation import (
    Predict,
    Prediction,
    cross_validate,
    predict_as_recorded,
    predict_by_choice,
)
from agonic.recording.evaluation.errors import UNITS, Known, find_known
from benchmarks import tables
from benchmarks.peers import ESTIMATORS

Array = NDArray[np.float64]

MOST_ROWS = 6000
SCIPY = "SciPy least squares"
RIVALS = {
    "magyc": "magyc ellipsoid",
    "magcal": "magcal",
}
INTRODUCTION = """Each recording is cut into eight blocks of time that tell as much each. The even
blocks are judged by a fit to the odd ones and the reverse, so every figure is of readings that the
fit has not seen, as `agonic evaluate` has them. Where an optical system knows the heading, the
figure is the error of a heading made level with its roll and pitch, rms in degrees, after one
constant turn; agonic is not shown that heading. Elsewhere it is the scatter of the magnitude over
what it should have been, in percent; where roll, pitch and place are known, a second line has the
error of the dip, which tells a field that is steady because it hardly varies from one that is
right. `as flown` is what the device or vehicle had made of the readings; `stated` is what the fit
said such an error should be; a figure in brackets is of a calibration that agonic refuses to give.
Where the field itself was disturbed, or the sensor hardly turned, the best verdict is one that says
so: a steady magnitude tells nothing of directions that were never visited."""
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
    stated: float
    refused: bool = False


def main() -> None:
    """Print the table."""
    asked = tables.arguments("real recordings", draws=1)
    folder = Path(os.environ.get("AGONIC_RECORDINGS", "../shared/recordings"))
    if not folder.is_dir():
        raise SystemExit(NO_FOLDER)
    chosen = RECORDINGS[:2] if asked.quick else RECORDINGS
    rows = [row for recording in chosen for row in _judge(folder, recording)]
    header = ["recording", "known", "agonic says", "as flown", SCIPY, *RIVALS, "agonic", "stated"]
    print("\n\n".join([INTRODUCTION, tables.markdown(header, rows)]))


def _judge(folder: Path, recording: Recording) -> list[list[str]]:
    """The rows of the table; none where the file is not there."""
    path = folder / recording.path
    if not path.exists():
        return []
    tables.progress(f"real: {recording.name}")
    samples = thin(read_recording(path, recording))
    blind = samples.with_columns(heading_deg=None)
    reference, settings = choose_reference(blind)
    known = find_known(samples, reference)
    predictions: dict[str, Predict] = {
        "as flown": predict_as_recorded(blind),
        SCIPY: _fit_by_scipy(blind, known),
        **{name: _fit_by_rival(name, blind) for name in RIVALS},
        "agonic": predict_by_choice(blind, reference, known, **settings),
    }
    figures = {name: _measure(blind, known, predict) for name, predict in predictions.items()}
    says = _say(blind, reference, settings)
    rows = []
    for kind in _list_kinds(known):
        own = figures["agonic"][kind]
        refused = says.startswith("refused") or (not isinstance(own, str) and own.refused)
        shown = [
            _show(found[kind], UNITS[kind], refused and name == "agonic")
            for name, found in figures.items()
        ]
        stated = own if isinstance(own, str) else _show(Figure(own.stated, 0.0), UNITS[kind])
        name = recording.name if kind != "dip" else f"{recording.name}, dip"
        rows.append([name, recording.known, says, *shown, stated])
    return rows


def _list_kinds(known: Known) -> list[str]:
    """The kinds of errors that are shown: the heading alone where it is known."""
    if known.heading_deg is not None:
        return ["heading"]
    return ["magnitude", "dip"] if known.dip_deg is not None else ["magnitude"]


def read_recording(path: Path, recording: Recording) -> ag.Samples:
    log = open_log(path, unit=recording.unit)
    samples = log.sensor(0 if recording.sensor is None else recording.sensor)
    if recording.between is None or samples.time is None:
        return samples
    first, last = recording.between
    return samples.select((samples.time >= first) & (samples.time <= last))


def thin(samples: ag.Samples) -> ag.Samples:
    """At most so many rows, evenly, so that the table takes minutes."""
    step = -(-len(samples) // MOST_ROWS)
    return samples if step == 1 else samples.select(np.arange(0, len(samples), step))


def _say(blind: ag.Samples, reference: ag.Reference | None, settings: dict[str, float]) -> str:
    """The verdict of the main job on the whole recording."""
    try:
        found = ag.calibrate(blind, reference, **settings)
    except AgonicError:
        return "refused"
    first = next((f.name for f in found.fit.findings if f.severity != "note"), "")
    return f"{found.verdict}: {first}" if first and found.verdict != "good" else found.verdict


def _measure(
    samples: ag.Samples, known: Known, predict: Predict
) -> dict[str, Figure] | dict[str, str]:
    """The error of each kind on the rows of each fold that the fit did not see."""
    kinds = _list_kinds(known)
    try:
        unseen = cross_validate(samples, known, predict)
    except ImportError:
        return dict.fromkeys(kinds, tables.NOT_INSTALLED)
    except (AgonicError, ValueError, np.linalg.LinAlgError):
        return dict.fromkeys(kinds, "failed")
    rows = np.arange(len(samples))
    refused = bool(unseen.refused.all())
    return {kind: Figure(*unseen.errors[kind].select(rows), refused) for kind in kinds}


def _predict_affine(
    samples: ag.Samples, fit: Callable[[NDArray[np.intp]], tuple[Array, Array]]
) -> Predict:
    """Predicts by bias and matrix."""

    def predict(taught: NDArray[np.intp], unseen: NDArray[np.intp]) -> Prediction:
        bias, matrix = fit(taught)
        field = (samples.field[unseen] - bias) @ matrix.T
        if not np.isfinite(field).all():
            raise ValueError("no fit")
        return Prediction(field)

    return predict


def _fit_by_rival(name: str, samples: ag.Samples) -> Predict:
    """A fit of the magnitude by another library."""

    def fit(taught: NDArray[np.intp]) -> tuple[Array, Array]:
        raw = samples.field[taught]
        size = float(np.median(np.linalg.norm(raw - raw.mean(axis=0), axis=1)))
        return ESTIMATORS[RIVALS[name]](raw, size, 0.01 * size)

    return _predict_affine(samples, fit)


def _fit_by_scipy(samples: ag.Samples, known: Known) -> Predict:
    """Least squares of |W (raw − bias)| − F with SciPy's defaults, W symmetric, from a sphere."""
    from scipy.optimize import least_squares

    def unpack(params: Array) -> tuple[Array, Array]:
        xx, yy, zz, xy, xz, yz = params[3:]
        return params[:3], np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def fit(taught: NDArray[np.intp]) -> tuple[Array, Array]:
        raw, magnitude = samples.field[taught], known.magnitude[taught]
        magnitude = magnitude / magnitude.mean()
        centre = raw.mean(axis=0)
        size = float(np.linalg.norm(raw - centre, axis=1).mean())
        points = (raw - centre) / size

        def residuals(params: Array) -> Array:
            bias, matrix = unpack(params)
            return np.asarray(np.linalg.norm((points - bias) @ matrix, axis=1) - magnitude)

        found = least_squares(residuals, [0, 0, 0, 1, 1, 1, 0, 0, 0], max_nfev=200)
        bias, matrix = unpack(found.x)
        return centre + size * bias, matrix / size

    return _predict_affine(samples, fit)


def _show(figure: Figure | str, sign: str, refused: bool = False) -> str:
    """A figure; one of a fit that was refused in brackets."""
    if isinstance(figure, str):
        return figure
    text = f"{figure.found:.3g} {sign}" if sign == "%" else f"{write(figure.found)}{sign}"
    return f"({text})" if refused else text


if __name__ == "__main__":
    main()
