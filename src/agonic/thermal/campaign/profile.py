"""`Profile`: what the chamber does at every station, as temperature over time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.errors import AgonicError

Action = Literal["heat", "cool", "hold"]


def format_signed(level_C: float) -> str:
    """A temperature with its sign, 0 without one."""
    return f"{level_C:+.4g}" if level_C else "0"


@dataclass(frozen=True, kw_only=True)
class Segment:
    """A stretch of a profile in which the temperature goes from `start_C` to `end_C` evenly."""

    action: Action
    start_C: float
    end_C: float
    duration_s: float
    recorded: bool = True

    @property
    def words(self) -> str:
        """What to set on the chamber."""
        minutes = f"{self.duration_s / 60:.3g} min"
        if self.action == "hold":
            return f"hold {format_signed(self.end_C)} °C for {minutes}"
        rate = abs(self.end_C - self.start_C) / self.duration_s * 60
        return f"{self.action} to {format_signed(self.end_C)} °C in {minutes} ({rate:.3g} °C/min)"


@dataclass(frozen=True, kw_only=True)
class Profile:
    """The programme of Nikolaev et al. 2023, section 3, with the rates it leaves open.

    Heat to `highest_C`, hold, start recording, cool smoothly to `lowest_C`, hold, heat in steps to
    `highest_C`, hold, stop.

    Parameters
    ----------
    lowest_C, highest_C : ends of the range. hold_min : the three holds.
    cooling_C_per_min, heating_C_per_min : rates. cooling_limit_C_per_min : faster cooling is
        abrupt: the sensor no longer has the temperature that it reports.
    step_C, step_hold_min : the steps of heating. room_C : where the first heating starts.
    """

    lowest_C: float = -10.0
    highest_C: float = 50.0
    hold_min: float = 15.0
    cooling_C_per_min: float = 0.5
    heating_C_per_min: float = 1.0
    step_C: float = 10.0
    step_hold_min: float = 6.0
    cooling_limit_C_per_min: float = 1.0
    room_C: float = 20.0

    def __post_init__(self) -> None:
        if not (-150.0 <= self.lowest_C < self.highest_C <= 250.0):
            raise AgonicError(
                f"a range of {self.lowest_C:g} to {self.highest_C:g} °C is not a range; give the "
                "lower end first, within -150 to 250 °C"
            )
        rates = (self.cooling_C_per_min, self.heating_C_per_min, self.step_C)
        if min(rates) <= 0 or min(self.hold_min, self.step_hold_min) < 0:
            raise AgonicError("rates and steps of a profile must be above 0, and holds not below")
        if self.cooling_C_per_min > self.cooling_limit_C_per_min:
            raise AgonicError(
                f"cooling at {self.cooling_C_per_min:g} °C/min is above the limit of "
                f"{self.cooling_limit_C_per_min:g}; cool more slowly"
            )

    @property
    def span_C(self) -> float:
        """From the lowest to the highest temperature."""
        return self.highest_C - self.lowest_C

    @property
    def steps(self) -> int:
        """How many steps the heating takes."""
        return max(1, round(self.span_C / self.step_C))

    @property
    def heating_levels_C(self) -> list[float]:
        """Where the steps of heating end."""
        levels = np.linspace(self.lowest_C, self.highest_C, self.steps + 1)[1:]
        return [float(level) for level in levels]

    @property
    def before(self) -> tuple[Segment, ...]:
        """What comes before the recording."""
        low, high = sorted((self.room_C, self.highest_C))
        duration = max(high - low, 1.0) / self.heating_C_per_min * 60
        return (
            Segment(
                action="heat",
                start_C=self.room_C,
                end_C=self.highest_C,
                duration_s=duration,
                recorded=False,
            ),
            self._hold(self.highest_C, recorded=False),
        )

    @property
    def recording(self) -> tuple[Segment, ...]:
        """What is recorded, from the first reading on."""
        high, low = self.highest_C, self.lowest_C
        down = self.span_C / self.cooling_C_per_min * 60
        cooling = Segment(action="cool", start_C=high, end_C=low, duration_s=down)
        heating: list[Segment] = []
        at = low
        for level in self.heating_levels_C:
            up = (level - at) / self.heating_C_per_min * 60
            heating.append(Segment(action="heat", start_C=at, end_C=level, duration_s=up))
            if level != high and self.step_hold_min:
                pause = self.step_hold_min * 60
                heating.append(Segment(action="hold", start_C=level, end_C=level, duration_s=pause))
            at = level
        return (cooling, self._hold(low), *heating, self._hold(high))

    def _hold(self, level: float, recorded: bool = True) -> Segment:
        duration = self.hold_min * 60
        return Segment(
            action="hold", start_C=level, end_C=level, duration_s=duration, recorded=recorded
        )

    @property
    def recorded_s(self) -> float:
        """Length of the recording of a station."""
        return sum(segment.duration_s for segment in self.recording)

    @property
    def corners(self) -> tuple[Array, Array]:
        """Seconds since the first reading, and temperatures, where segments meet."""
        durations = [segment.duration_s for segment in self.recording]
        time = np.concatenate([[0.0], np.cumsum(durations)])
        level = np.array([self.highest_C, *(segment.end_C for segment in self.recording)])
        return time, level

    def at(self, time_s: ArrayLike) -> Array:
        """The chamber's temperature (n,) so many seconds after the first reading."""
        return np.interp(np.asarray(time_s, dtype=np.float64), *self.corners)

    def spread(self, bin_width_C: float = 0.5) -> tuple[Array, Array]:
        """Temperatures (m,) of bins over the range, and the seconds of a station in each."""
        bins = max(2, round(self.span_C / bin_width_C))
        edges = np.linspace(self.lowest_C, self.highest_C, bins + 1)
        seconds = np.zeros(bins)
        for segment in self.recording:
            low, high = sorted((segment.start_C, segment.end_C))
            if segment.action == "hold":
                within = min(int(np.searchsorted(edges, low, "right")) - 1, bins - 1)
                seconds[within] += segment.duration_s
                continue
            inside = np.clip(edges, low, high)
            seconds += np.diff(inside) / (high - low) * segment.duration_s
        return (edges[1:] + edges[:-1]) / 2, seconds
