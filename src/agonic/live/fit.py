"""`LiveFit`: a calibration that grows with every reading, and says how to go on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from agonic.calibration.affine import Affine
from agonic.calibration.base import Validity
from agonic.coverage import Coverage, compute_coverage
from agonic.ellipsoid.problem import Scale, make_calibration
from agonic.ellipsoid.solve import Found as Solved
from agonic.errors import AgonicError, CoverageError
from agonic.health import Finding
from agonic.live.aided import (
    MIN_ROWS,
    Aided,
    find_objections,
    fit_aided,
    get_samples,
    plan_drive,
)
from agonic.live.files import load_state, save_state
from agonic.live.guidance import Guidance, make_guidance
from agonic.live.level import Level, find_down, see_level
from agonic.live.maths.voxels import Voxels
from agonic.live.state import OF_FIT, LiveParams, LiveState
from agonic.live.update import collect_boxes, update_state
from agonic.maths.equation import coverage as cells
from agonic.samples import Samples
from agonic.units import RAW, nanotesla_per

_OF_THE_SENSOR = ("unit", "every", "soft_iron_sd", "name", "device_id")
"""Settings that a state cannot be gone on with when they change."""

REFIT_GROWTH = 1.2
"""The fit beside accelerometer and gyro is made anew when there are so many times the readings."""


class LiveFit:
    """A running calibration of one sensor, in bounded memory.

    Readings are summed up in boxes of equal size, each of which weighs little more after its
    first 25, so that a sensor at rest does not drown the rest; the fit minimises the magnitude
    residual over their moments with a prior on soft iron (`equation.moment_fit`). Readings wait a
    moment before they are let in, and those made near iron are not (`live.quarantine`). Two calls
    of `add` with the halves of a recording give what one call with all of it gives.

    Where acceleration and rotation rate come with the readings and the field of the place is known,
    the fit beside them that `agonic calibrate` would choose takes its place (`live.aided`).

    Parameters: `LiveParams`, or its fields as keywords.

    Source: moments and adjusted least squares (Markovsky, Kukush & Van Huffel 2004).

    Examples
    --------
    >>> u = np.random.default_rng(0).normal(size=(2000, 3))
    >>> field = 50_000 * u / np.linalg.norm(u, axis=1, keepdims=True) + [3000.0, 0, 0]
    >>> live = LiveFit(magnitude=50_000.0)
    >>> live.add(np.arange(2000) / 50, field)
    >>> live.calibration.bias.round() + 0.0, live.guidance.done
    (array([3000.,    0.,    0.]), True)
    """

    def __init__(self, params: LiveParams | None = None, **settings: Any) -> None:
        self.params = replace(params or LiveParams(), **settings)
        self.state = LiveState()
        self._nanotesla = nanotesla_per(self.params.unit)
        self._fitted: tuple[int, tuple[Affine, Coverage]] | None = None
        self._collected: tuple[int, Voxels | None] | None = None
        self._examined: tuple[int, tuple[Finding, ...]] | None = None
        self._aided: tuple[int, Aided | None] = (0, None)
        self.aside = False

    def add(self, time: ArrayLike, field: ArrayLike, motion: ArrayLike | None = None) -> None:
        """Take readings `field` (n, 3), in the unit of the parameters, made at `time` (n,), s.

        `motion` (n, 6) are acceleration, m/s², and rotation rate, rad/s, in the same axes, NaN
        where not known.
        """
        rows = np.asarray(field, dtype=np.float64)
        moments = np.asarray(time, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != 3 or moments.shape != (len(rows),):
            raise AgonicError(
                f"a live fit takes times (n,) and readings (n, 3), not {moments.shape} and "
                f"{rows.shape}"
            )
        stacked = np.column_stack([moments, rows * self._nanotesla])
        moved = None if motion is None else np.asarray(motion, dtype=np.float64)
        if moved is not None and moved.shape != (len(rows), 6):
            raise AgonicError(
                f"motion is acceleration and rotation rate of each reading, ({len(rows)}, 6), not "
                f"{moved.shape}"
            )
        self.state = update_state(self.params, self.state, stacked, moved)

    @property
    def n(self) -> int:
        """How many readings were taken."""
        return self.state.n

    @property
    def left_out(self) -> int:
        """How many readings do not count: impossible for a sensor, or far from all others."""
        found = self.state.found
        return self.state.rejected + (0 if found is None else found.left_out)

    @property
    def unit(self) -> str:
        """The unit in which readings are kept."""
        return RAW if self.params.unit == RAW else "nT"

    @property
    def calibration(self) -> Affine:
        """The calibration so far, with its covariance; raises `CoverageError` before the first."""
        return self._require()[0]

    @property
    def coverage(self) -> Coverage:
        """The directions so far, and the standard errors there."""
        return self._require()[1]

    @property
    def fitted(self) -> tuple[Affine, Coverage] | None:
        """Calibration and coverage, `None` before there is any."""
        aided, found = self.aided, self.state.found
        if aided is not None and aided.chosen:
            return aided.calibration, aided.coverage
        if found is None:
            return None
        if self._fitted is None or self._fitted[0] != found.n:
            self._fitted = (found.n, self._make_result())
        return self._fitted[1]

    @property
    def guidance(self) -> Guidance:
        """What to do next, and what is wrong."""
        params, state = self.params, self.state
        return make_guidance(params, state, self.fitted, self._examine, self.level, self.aided)

    @property
    def aided(self) -> Aided | None:
        """The fit that `calibrate` would choose where an accelerometer came with the readings;
        `None` where there was none, or too little. It is made anew once a fifth has been added, or
        with `aside` set only when `consider` is called, for it may take seconds."""
        if not self.aside:
            self.consider(REFIT_GROWTH)
        return self._aided[1]

    def consider(self, growth: float = 1.0) -> None:
        """Make the fit beside accelerometer and gyro, of all readings so far, where there are more
        than `growth` times those of the last one."""
        state = self.state
        if state.n > growth * self._aided[0]:
            before, aided = self._aided[1], fit_aided(self.params, state.track)
            self._aided = (state.n, aided)
            if aided is not None:  # the plan takes longer: until there is a new one the old stands
                kept = None if before is None else before.plan
                self._aided = (state.n, aided._replace(plan=kept))
                plan = plan_drive(self.params, state.track, aided)
                self._aided = (state.n, aided._replace(plan=plan))

    @property
    def level(self) -> Level | None:
        """The headings and tilts so far, where the vehicle stays level and its fit tells them."""
        aided = self.aided
        return None if aided is None else see_level(self.state.track, aided.calibration)

    @property
    def boxes(self) -> Voxels | None:
        """The readings summed up by where they lie; `None` before there are enough."""
        if self._collected is None or self._collected[0] != self.n:
            self._collected = (self.n, collect_boxes(self.params, self.state))
        return self._collected[1]

    @property
    def samples(self) -> Samples:
        """The readings for the final calibration, in the order of their times: the first of every
        direction, or the way that was driven, with acceleration and rates, where these tell more or
        the vehicle stays level."""
        track, aided = self.state.track, self.aided
        told = aided is not None and aided.chosen
        if track is not None:
            level = len(track.slots) >= MIN_ROWS and find_down(track) is not None
            if told or level:
                return get_samples(self.params, track)
        kept = np.concatenate([self.state.kept, self.state.waiting])
        kept = kept[np.argsort(kept[:, 0], kind="stable")]
        return Samples(
            time=kept[:, 0],
            field=kept[:, 1:],
            unit=self.unit,
            name=self.params.name,
            device_id=self.params.device_id,
        )

    def save(self, path: Path | str, *, origin: str = "") -> Path:
        """Write all that `resume` needs to go on, in one step; `origin` says where readings are
        from."""
        return save_state(self.params, self.state, path, origin)

    @classmethod
    def resume(
        cls, path: Path | str, params: LiveParams | None = None, *, origin: str = ""
    ) -> LiveFit:
        """The live fit that was saved, as if it had never stopped.

        `params` may tell another magnitude or target. Raises `LogError` where the file is missing,
        damaged or of another version, and `AgonicError` where it is of another sensor or origin.
        """
        saved, state, saved_origin = load_state(path)
        params = params or saved
        for name in _OF_THE_SENSOR:
            before, now = getattr(saved, name), getattr(params, name)
            if before != now:
                raise AgonicError(f"{path} is of {name} {before!r}, not {now!r}")
        if origin and saved_origin != origin:
            raise AgonicError(f"{path} holds readings of {saved_origin or 'elsewhere'}")
        live = cls(params)
        live.state = state
        return live

    def _require(self) -> tuple[Affine, Coverage]:
        fitted = self.fitted
        if fitted is None:
            raise CoverageError(
                f"{self.n} readings in too few directions do not determine a calibration yet",
                turns="turn the sensor slowly about all three axes",
            )
        return fitted

    def _examine(self) -> tuple[Finding, ...]:
        """What `agonic calibrate` would object to; looked at again once a tenth has been added."""
        aided = self.aided
        if aided is not None and aided.chosen:
            return aided.objections
        if self._examined is None or not self._examined[0] <= self.n < 1.1 * self._examined[0]:
            found = find_objections(self.params, self.samples, kind="ellipsoid")
            self._examined = (self.n, found)
        return self._examined[1]

    def _make_result(self) -> tuple[Affine, Coverage]:
        """The last fit in the unit of the readings, and its coverage."""
        found, boxes, reference = self.state.found, self.boxes, self.params.reference
        assert found is not None
        assert boxes is not None
        known = None if reference is None else float(reference.magnitudes(1)[0])
        solved = Solved("full", **{name: getattr(found, name) for name in OF_FIT})
        scale = Scale(found.centre, found.size, known, self.params.magnitude_sd)
        made = replace(
            make_calibration(solved, scale, self.unit, "symmetric"),
            sensor=self.params.name,
            device_id=self.params.device_id,
            validity=Validity(largest_reading=float(np.abs(boxes.middles).max())),
        )
        where = cells.find_cells(made.correct(boxes.middles))
        counts = np.bincount(where, weights=boxes.counts, minlength=80).astype(np.int64)
        return made, compute_coverage(made, counts, self.params.inclination_deg)
