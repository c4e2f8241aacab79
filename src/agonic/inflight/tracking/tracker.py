"""`Tracker`: a calibration that follows its sensor, from log to log."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.base import select_columns
from agonic.calibration.interference import Interference
from agonic.calibration.thermal import Thermal
from agonic.calibration.tracking import Jump, TrackerParams, TrackerState
from agonic.errors import AgonicError, FrameError, UnitError
from agonic.health import Finding, Judged, figure
from agonic.health.turning import MIN_ROWS, check_turning, explains_change
from agonic.inflight.tracking.evidence import list_findings
from agonic.inflight.tracking.files import load_track, save_track
from agonic.inflight.tracking.filter import start, update
from agonic.inflight.tracking.result import Coefficients, Followed
from agonic.reference import Reference
from agonic.samples import Samples


class Tracker(Followed, Judged):
    """A calibration followed in time by the magnitude of a known field, or by how a gyro turns it.

    Holds the settings, the state and the history; `update` moves the state on. In flight or in
    orbit the geomagnetic model is the known field, or an absolute scalar instrument. Readings with
    the rates of a gyro need no known field (`params.gyro`).

    Parameters
    ----------
    calibration : the prior at the start: an `Affine`; a `Thermal`, whose constants then move; or
        an `Interference`, whose bias and matrix move and whose disturbers are taken out. Without
        covariance it is but a guess. `None`: nothing, for readings in nT.
    params : how it is followed; `None`: the defaults, a bias that does not move.

    Examples
    --------
    >>> from agonic.simulation import simulate
    >>> made = simulate("tumble", n=1500, noise=50.0)
    >>> tracker = Tracker(params=TrackerParams(noise=50.0))
    >>> seen = tracker.update(made.samples, Reference.constant(50_000))
    >>> tracker.n, len(seen.residual), tracker.ok
    (1500, 1500, True)
    """

    def __init__(
        self,
        calibration: Affine | Thermal | Interference | None = None,
        params: TrackerParams | None = None,
    ) -> None:
        self.params = params or TrackerParams()
        self.state: TrackerState = start(calibration, self.params)
        self.history: Array = np.empty((0, 7))
        """Time (s), bias x y z and its standard error x y z, at steps of `params.history_s`."""
        self._given = calibration is not None

    def update(self, samples: Samples, reference: Reference | None = None) -> Coefficients:
        """Move on by the readings of a log or of a moment; one or many come to the same.

        Parameters: samples with times later than all before, in the unit and frame of the
        calibration; reference, the magnitude of the field at each, `None` where that is not known,
        beside a gyro. Rows that are flagged are passed over.

        Returns what was found; its `residual` is how far each reading used was from its prediction.

        Raises `LogError` without times, `UnitError` and `FrameError` where the samples are not
        those of the calibration, `AgonicError` where they are not later than what was seen, and
        without gyro and reference.
        """
        known = 0.0 if reference is None else reference.magnitudes(len(samples))
        magnitude = np.broadcast_to(known, len(samples))
        if self.state.n == 0:
            self.state = self._prepare(
                samples, magnitude, 0.0 if reference is None else reference.sd
            )
        base = self.state.base
        if samples.unit != base.unit_in:
            raise UnitError(
                f"the tracker follows readings in {base.unit_in} and these are in {samples.unit}; "
                "give a calibration to start from, or readings in nT"
            )
        if samples.frame != base.frame_in:
            raise FrameError(
                "the tracker follows readings in other axes",
                left=samples.frame,
                right=base.frame_in,
            )
        rate = samples.rotation_rate if self.state.turn is not None else None
        if self.state.turn is None and reference is None:
            raise AgonicError(
                "without a gyro that turns as the magnetometer does, the magnitude of the field "
                "must be known; give a reference"
            )
        if self.state.turn is not None and rate is None:
            raise AgonicError(
                "the tracker was begun beside a gyro, and these samples hold no rates"
            )
        if samples.flagged is not None:
            usable = samples.flagged == 0
            if not usable.any():
                none = np.empty(0)
                return Coefficients(
                    state=self.state, residual=none, residual_sd=none, used=none > 0, jumps=()
                )
            samples, magnitude = samples.select(usable), magnitude[usable]
            rate = None if rate is None else rate[usable]
        first = self.state.ground or self.state.aboard  # readings as at its middle temperature
        columns = {} if first is None else select_columns(first, samples)
        raw, time = self.state.at_middle(samples.field, **columns), self.seconds(samples)
        self.state, found = update(self.state, self.params, time, raw, magnitude, rate=rate)
        self.history = np.concatenate([self.history, found.history])
        return found

    def seconds(self, samples: Samples) -> Array:
        """The times of samples as the tracker counts them, from its own epoch."""
        return samples.seconds_since(self.state.epoch, known=self.n > 0)

    def _prepare(self, samples: Samples, magnitude: Array, stated: float) -> TrackerState:
        """Before the first reading: beside a gyro or not, and what the reference states."""
        rate = samples.rotation_rate
        if rate is not None:  # to the axes of the readings, but for a symmetric matrix
            rate = rate @ self.state.turned.rotation
        own = samples.with_columns(rotation_rate=rate)
        gyro, unused = choose_gyro(own, magnitude, self.params.gyro)
        begun = start(
            self.state.ground or self.state.aboard or self.state.base, self.params, gyro=gyro
        )
        base = begun.base
        if not self._given:
            frame = samples.frame
            base = replace(base, sensor=samples.name, frame_in=frame, frame_out=frame)
            base = replace(base, device_id=samples.device_id)
        return replace(
            begun,
            base=base,
            epoch=samples.epoch,
            external_sd=stated if self.params.external_sd is None else 0.0,
            external_time_s=self.params.external_time_s,
            gyro_unused=unused,
        )

    @property
    def n(self) -> int:
        """How many readings were seen."""
        return self.state.n

    @property
    def refused(self) -> int:
        """How many of them were not used, because they did not fit their prediction."""
        return self.state.refused

    @property
    def jumps(self) -> tuple[Jump, ...]:
        """All jumps of the bias so far."""
        return self.state.jumps

    @property
    def findings(self) -> tuple[Finding, ...]:  # type: ignore[override]
        """What the user should know, by name."""
        return tuple(list_findings(self.state))

    @property
    def remarks(self) -> tuple[str, ...]:  # type: ignore[override]
        """How well the bias is known, where there is nothing to object."""
        if self.findings:
            return ()
        unit = self.state.base.unit_in
        return (f"standard error: bias {figure(float(max(self.state.bias_sd)))} {unit}",)

    def save(self, path: Path | str) -> Path:
        """Write everything that `resume` needs to go on, in one step."""
        return save_track(self.params, self.state, self.history, path)

    @classmethod
    def resume(cls, path: Path | str) -> Tracker:
        """The tracker that was saved, as if it had never stopped.

        Raises `LogError` where the file is missing, damaged or something else.
        """
        params, state, history = load_track(path)
        tracker = cls(state.ground or state.aboard or state.base, params)
        tracker.state, tracker.history = state, history
        return tracker


def choose_gyro(samples: Samples, magnitude: Array, wanted: bool | None) -> tuple[bool, str]:
    """Whether to use the gyro of the samples, and why not where it is left aside.

    Raises `AgonicError` where it is wanted and is not there, or does not turn as the magnetometer.
    """
    if wanted is False:
        return False, ""
    if samples.rotation_rate is None or samples.time is None:
        if wanted:
            raise AgonicError("a gyro was asked for and the samples hold no rotation_rate")
        return False, ""
    mistake = check_turning(samples)
    if mistake is not None:
        if wanted:
            raise AgonicError(f"{mistake.what}; {mistake.move}, or leave the gyro out")
        return False, mistake.what
    known = magnitude[magnitude > 0]
    if wanted or not len(known):
        return True, ""
    # then its direction changes too, and no gyro sees that
    if np.ptp(known) > 0.05 * float(np.mean(known)):
        return False, "the field itself changes along the track, which a gyro does not measure"
    if len(samples) >= MIN_ROWS and explains_change(samples):
        return True, ""
    return False, "the gyro explains less than half of how the readings change"
