"""What the ground said of each number and what the flight says, and how far the two are apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.thermal import Thermal
from agonic.inflight.fit import InflightFit, prior
from agonic.inflight.tracking import Tracker
from agonic.maths.rotations.polar import split_rotation
from agonic.report.digits import group_digits

FIXED = 2 * prior.FIXED
"""Relative standard error below which a number was fixed."""
_AXES = ("x", "y", "z")
_ENTRIES = ("xx", "yy", "zz", "xy", "xz", "yz")


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """One number: on the ground (`None` where there was none) and in flight, each with its sd."""

    name: str
    ground: float | None
    ground_sd: float | None
    flight: float
    flight_sd: float

    @property
    def change(self) -> float | None:
        """Flight less ground."""
        return None if self.ground is None else self.flight - self.ground

    @property
    def change_sd(self) -> float:
        """√(ground² + flight²): the two were made from different readings."""
        return float(np.hypot(self.ground_sd or 0.0, self.flight_sd))

    @property
    def fixed(self) -> bool:
        """Whether the flight was not asked for it: a standard error that is as good as none."""
        return self.flight_sd <= FIXED * max(abs(self.flight), 1.0)

    @property
    def sigmas(self) -> float | None:
        """The change in units of its standard error; `None` where there is none to speak of."""
        return None if self.change is None or self.fixed else self.change / self.change_sd


@dataclass(frozen=True, kw_only=True)
class Numbers:
    """Numbers of one kind, which share a unit ("" for ratios), and what to know of them."""

    name: str
    unit: str
    rows: tuple[Comparison, ...]
    note: str = ""


def compare(before: Affine | None, after: Affine, note: str = "") -> tuple[Numbers, ...]:
    """Bias and symmetric matrix before and after: of the turn magnitudes say nothing.

    >>> made = Affine(bias=[100.0, 0, 0], matrix=np.eye(3), covariance=np.eye(9) * 0.25)
    >>> bias, _ = compare(made, made)
    >>> bias.rows[0].change, round(bias.rows[0].change_sd, 3)
    (0.0, 0.707)
    """
    flight, flight_sd = _nine(after)
    ground, ground_sd = (None, None) if before is None else _nine(before)

    def rows(names: tuple[str, ...], first: int) -> tuple[Comparison, ...]:
        return tuple(
            Comparison(
                name=name,
                ground=None if ground is None else float(ground[k]),
                ground_sd=None if ground_sd is None else float(ground_sd[k]),
                flight=float(flight[k]),
                flight_sd=0.0 if flight_sd is None else float(flight_sd[k]),
            )
            for k, name in enumerate(names, start=first)
        )

    return (
        Numbers(name="Bias", unit=after.unit_in, rows=rows(_AXES, 0), note=note),
        Numbers(name="Matrix", unit="", rows=rows(_ENTRIES, 3)),
    )


def _nine(calibration: Affine) -> tuple[Array, Array | None]:
    """Bias and the six entries of the symmetric matrix, and their standard errors."""
    six, rest = split_rotation(calibration.matrix, _plain(calibration), calibration.gauge)
    values = np.concatenate([calibration.bias, six])
    if calibration.covariance is None:
        return values, None
    return values, np.sqrt(np.maximum(np.diag(rest.covariance)[:9], 0.0))


def _plain(calibration: Affine) -> Array | None:
    """The covariance of bias and matrix, without what a calibration may know besides."""
    if calibration.covariance is None:
        return None
    size = 12 if calibration.gauge == "free" else 9
    return calibration.covariance[:size, :size]


def compare_fit(fit: InflightFit) -> tuple[Numbers, ...]:
    """The numbers of a fit in flight beside those of the ground at the same temperature."""
    ground = fit.ground
    if fit.before is None and ground is not None:
        # a ground calibration that is no bias and matrix: what the flight adds to its field
        none = Affine(bias=np.zeros(3), matrix=np.eye(3))
        note = "on top of the field by the ground calibration, which it would leave as it is with 0"
        return compare(none, fit.change, note)
    note = ""
    if isinstance(ground, Thermal) and fit.temperature is not None:
        note = f"both at {group_digits(float(fit.temperature.mean()), 1)} °C"
    return compare(fit.before, fit.after, note)


def compare_tracker(tracker: Tracker) -> tuple[Numbers, ...]:
    """The numbers of a tracker now beside those that it started from."""
    state = tracker.state
    base = state.base
    from_nothing = base.covariance is None and not base.bias.any()
    note = "" if state.ground is None else f"both at {group_digits(state.ground.centre_C, 1)} °C"
    return compare(None if from_nothing else base, tracker.calibration, note)
