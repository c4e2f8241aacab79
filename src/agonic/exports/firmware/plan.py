"""`Plan`: a setup as the numbers that the generated C holds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.deviation import Deviation
from agonic.calibration.setup import Setup
from agonic.calibration.sources import SOURCES, list_columns, signals
from agonic.calibration.steps import compose
from agonic.exports.firmware.c_text import find_time_constants
from agonic.exports.firmware.grid import DeclinationGrid
from agonic.exports.temperature import (
    RATE,
    Polynomials,
    changes_with_temperature,
    find_range_C,
    fit_polynomials,
    list_sources,
    make_constant,
)
from agonic.maths.rotations.tilt import Order
from agonic.units import RAW

TiltInput = Literal["angles", "acceleration", "level"]

TILT_INPUT: dict[str, TiltInput] = {
    "auto": "angles",
    "log": "angles",
    "gyro": "angles",
    "accelerometer": "acceleration",
    "level": "level",
}
"""What the controller is given for each `tilt` of a setup."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """The setup and its declination."""

    setup: Setup
    declination: float | DeclinationGrid

    @cached_property
    def calibrations(self) -> tuple[Affine, ...]:
        """The calibration of each compass as one step, in the middle of its temperatures."""
        each = [compass.calibration for compass in self.setup.compasses]
        return tuple(
            compose(one.at(float(np.mean(find_range_C(one)))))  # type: ignore[attr-defined]
            if changes_with_temperature(one)
            else compose(one)
            for one in each
        )

    @cached_property
    def warm(self) -> bool:
        """Whether any calibration changes with temperature, so that the controller is given it."""
        return any(
            changes_with_temperature(compass.calibration) for compass in self.setup.compasses
        )

    @cached_property
    def polynomials(self) -> tuple[Polynomials, ...]:
        """Those of each compass over temperature; of order 0 where it does not change."""
        return tuple(
            fit_polynomials(compass.calibration)
            if changes_with_temperature(compass.calibration)
            else make_constant(calibration)
            for compass, calibration in zip(self.setup.compasses, self.calibrations, strict=True)
        )

    @property
    def powers(self) -> Array:
        """(k, p, 12 + 3 s): bias, matrix and the coefficients of s signals, a row a power of x."""
        names = signals(self.sources)
        p = max(len(found.bias) for found in self.polynomials)
        table = np.zeros((len(self.polynomials), p, 12 + 3 * len(names)))
        for rows, found in zip(table, self.polynomials, strict=True):
            q = len(found.bias)
            rows[:q, :12] = found.table[:, :12]
            added = rows[:, 12:].reshape(p, 3, len(names))
            for j, name in enumerate(found.signals):
                added[:q, :, names.index(name)] = found.coefficients[:, :, j]
        return table

    @property
    def temperatures(self) -> Array:
        """(k, 4): centre and half range of x, and the temperatures that are followed, °C."""
        return np.array([(p.centre_C, p.half_range_C, *p.clamp_C) for p in self.polynomials])

    @property
    def tilt(self) -> TiltInput:
        """What tells the controller its tilt."""
        return TILT_INPUT[self.setup.tilt]

    @property
    def accelerometer(self) -> Affine | None:
        """The calibration of the accelerometer, where the controller is given its readings."""
        return self.setup.accelerometer if self.tilt == "acceleration" else None

    @property
    def order(self) -> Order:
        """The order of roll and pitch; down from an accelerometer has the nose's heading."""
        return self.setup.tilt_order if self.tilt == "angles" else "roll-pitch"

    @property
    def steepest(self) -> float:
        """The cosine of the largest tilt."""
        return float(np.cos(np.radians(self.setup.tilt_limit_deg)))

    @property
    def cards(self) -> tuple[Deviation | None, ...]:
        """The deviation of each compass."""
        return tuple(compass.deviation for compass in self.setup.compasses)

    @cached_property
    def sources(self) -> tuple[str, ...]:
        """What any of the compasses takes beside its readings, each in its form. Those of `SOURCES`
        come first, the rate of the temperature last."""
        compasses = self.setup.compasses
        taken = dict.fromkeys(n for c in compasses for n in list_sources(c.calibration))
        order = (*SOURCES, *(name for name in taken if name not in (*SOURCES, RATE)), RATE)
        return tuple(name for name in order if name in taken)

    @property
    def columns(self) -> tuple[str, ...]:
        """The inputs that hold them, each once."""
        return list_columns(self.sources)

    @property
    def time_constants(self) -> dict[str, float]:
        """Those of the columns that go through a filter, s."""
        return find_time_constants(self.sources)

    @property
    def dip(self) -> float | None:
        """The dip that the setup expects, radians; not to be seen by a compass without tilt."""
        h, v = self.setup.horizontal, self.setup.vertical
        if h is None or v is None or self.tilt == "level":
            return None
        return float(np.arctan2(v, h))

    @property
    def watched(self) -> bool:
        """Whether there are two compasses to watch: with their field in nT, and a tilt."""
        scaled = all(calibration.unit_out != RAW for calibration in self.calibrations)
        return len(self.calibrations) == 2 and self.dip is not None and scaled

    @property
    def expected(self) -> tuple[float | None, ...]:
        """The strength that each compass should read: horizontal where it stays level. From the
        setup, else the magnitude of the calibration; `None` where neither tells."""
        return tuple(self._find_expected(calibration) for calibration in self.calibrations)

    def _find_expected(self, calibration: Affine) -> float | None:
        h, v = self.setup.horizontal, self.setup.vertical
        if h is None or v is None:
            return None if self.tilt == "level" else calibration.magnitude
        if calibration.unit_out == RAW:
            return None
        return h if self.tilt == "level" else float(np.hypot(h, v))

    @property
    def magnitudes(self) -> tuple[float, ...]:
        """The field of each compass where nothing disturbs it, for the self-test."""
        h, v = self.setup.horizontal, self.setup.vertical
        if h is not None and v is not None and self.calibrations[0].unit_out != RAW:
            return (float(np.hypot(h, v)),) * len(self.calibrations)
        return tuple(calibration.magnitude or 50_000.0 for calibration in self.calibrations)

    @property
    def deviations(self) -> Array | None:
        """(k, 9) A to E, degrees, and the heel terms, degrees per degree; `None` without any."""
        if all(card is None for card in self.cards):
            return None
        table = np.zeros((len(self.cards), 9))
        for row, card in zip(table, self.cards, strict=True):
            if card is not None:
                row[:5] = card.coefficients
                row[5:] = 0.0 if card.heel is None else card.heel
        return table

    @property
    def heeled(self) -> bool:
        """Whether a deviation depends on roll or pitch; a setup that stays level has neither."""
        table = self.deviations
        return table is not None and bool(table[:, 5:].any()) and self.tilt != "level"

    @property
    def constants(self) -> int:
        """How many float32 the tables of the C hold."""
        tables = [np.zeros(len(self.expected))]
        tables += [self.powers, *([self.temperatures] if self.warm else [])]
        if self.accelerometer is not None:
            tables += [self.accelerometer.bias, self.accelerometer.matrix]
        if self.deviations is not None:
            tables.append(self.deviations if self.heeled else self.deviations[:, :5])
        if isinstance(self.declination, DeclinationGrid):
            tables.append(self.declination.north)  # two 16-bit numbers a node
        return sum(table.size for table in tables)
