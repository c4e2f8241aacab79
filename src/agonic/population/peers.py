"""`Peers`: the sensors of a population that are compared with one another, each counted once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.maths.estimation.robust.robust_spread import estimate_robust_spread
from agonic.population.population import Population
from agonic.units import RAW

MIN_PEERS = 8
"""Fewer sensors do not tell what is usual among them."""

LEAST_FIELD_SHARE = 0.002
"""Share of the field below which a difference does not matter: about 0.1° of heading."""

LEAST_FACTOR = 1.5
"""Noise and spread that differ by less than this factor do not matter."""


_EARLY = datetime.min.replace(tzinfo=UTC)


@dataclass(frozen=True)
class Quantity:
    """One thing that is compared: values and their standard errors (n, k), and what is usual.
    `centre` and `spread` (k,) are of the population, without the errors of the fits; differences of
    `least` or below do not matter. Magnitude, noise and spread are natural logarithms."""

    values: Array
    sd: Array
    centre: Array
    spread: Array
    least: float

    @property
    def distance(self) -> Array:
        """How far each sensor is from the centre in its spread and its own error, (n,)."""
        scale = np.sqrt(self.spread**2 + self.sd**2 + (0.1 * self.least) ** 2)
        with np.errstate(divide="ignore", invalid="ignore"):  # without any scale there is none
            return np.asarray(np.linalg.norm((self.values - self.centre) / scale, axis=1))

    @property
    def matters(self) -> Mask:
        """Which sensors are so far from the centre that it makes a difference, (n,)."""
        return np.asarray(np.linalg.norm(self.values - self.centre, axis=1) > self.least)


@dataclass(frozen=True)
class Peers:
    """Sensors whose figures have the same units and, where there are enough, the same channel.
    `rows` (n,) are their rows in `population`: of each sensor the latest good calibration, or the
    latest to be checked; of a log that is there more than once, the first copy."""

    population: Population
    rows: Index
    unit_in: str
    unit_out: str
    channel: str | None

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def enough(self) -> bool:
        """Whether they are enough to tell what is usual."""
        return len(self) >= MIN_PEERS

    @property
    def name(self) -> str:
        """Who they are, in words."""
        units = f"readings in {self.unit_in or 'unknown units'}"
        if self.unit_in == RAW:
            units = "readings in raw units"
        return f"{self.channel}, {units}" if self.channel else units

    @cached_property
    def field(self) -> float:
        """Magnitude of the field in the unit of the readings; NaN where it is unknown."""
        magnitude = self.population["magnitude"][self.rows]
        gain = np.abs(self._matrix[:, range(3), range(3)].mean(axis=1))
        known = np.isfinite(magnitude) & (gain > 0)
        return float(np.median(magnitude[known] / gain[known])) if known.any() else np.nan

    @cached_property
    def quantities(self) -> Mapping[str, Quantity]:
        """What is compared, by name: bias, gain, cross, magnitude, noise, spread."""
        matrix, errors = self._matrix, _fill_errors(self.population.matrix_sd[self.rows])
        gain, gain_sd = matrix[:, range(3), range(3)], errors[:, range(3), range(3)]
        usual = float(np.nanmedian(np.abs(gain))) if np.isfinite(gain).any() else 1.0
        cross, cross_sd = self.population.cross[self.rows], self.population.cross_sd[self.rows]
        readings = np.maximum(self.population["rows"][self.rows], 10)
        log_sd = 1.0 / np.sqrt(2.0 * readings)[:, None]
        bias = self.population.bias[self.rows]
        bias_sd = _fill_errors(self.population.bias_sd[self.rows])
        least = LEAST_FIELD_SHARE * self.field if np.isfinite(self.field) else 0.0
        return {
            "bias": make_quantity(bias, bias_sd, least),
            "gain": make_quantity(gain, gain_sd, LEAST_FIELD_SHARE * usual),
            "cross": make_quantity(cross, cross_sd, LEAST_FIELD_SHARE * usual),
            # between places near each other
            "magnitude": make_quantity(self._own_magnitude(), 0.0 * log_sd, 0.03),
            "noise": make_quantity(self._log("noise"), log_sd, float(np.log(LEAST_FACTOR))),
            "spread": make_quantity(self._log("spread_after"), log_sd, float(np.log(LEAST_FACTOR))),
        }

    @property
    def _matrix(self) -> Array:
        return self.population.matrix[self.rows]

    def _own_magnitude(self) -> Array:
        """Of calibrations that had no field to go by: with a mean gain of one, it has the gain."""
        logs, gain = self._log("magnitude"), self._matrix[:, range(3), range(3)].mean(axis=1)
        logs[~(np.abs(gain - 1.0) < 1e-6)] = np.nan
        return logs

    def _log(self, name: str) -> Array:
        values = self.population[name][self.rows]
        logs = np.full((len(values), 1), np.nan)
        np.log(values, out=logs[:, 0], where=values > 0)
        return logs


def find_peers(population: Population) -> tuple[Peers, ...]:
    """The groups of sensors that are compared with one another, the largest first. Rows that were
    refused take no part. A channel of a log forms a group of its own where it has eight sensors or
    more; all others with the same units are put together."""
    rows = _choose_rows(population)
    columns = [population[name][rows].tolist() for name in ("unit_in", "unit_out", "channel")]
    who = list(zip(*columns, strict=True))
    size = Counter(who)
    channels = Counter(key[:2] for key in size)
    grouped: dict[tuple[str, str, str | None], list[int]] = {}
    for row, key in zip(rows, who, strict=True):
        named = size[key] >= MIN_PEERS and channels[key[:2]] > 1
        grouped.setdefault(key if named else (*key[:2], None), []).append(row)
    made = [Peers(population, np.array(at), *key) for key, at in grouped.items()]
    return tuple(sorted(made, key=lambda group: (-len(group), group.name)))


def _choose_rows(population: Population) -> list[int]:
    """The row that stands for each sensor, in the population's order."""
    columns = ("sensor", "channel", "unit_in", "unit_out", "sha256", "source", "verdict", "start")
    chosen: dict[tuple[str, ...], tuple[tuple[bool, datetime], int]] = {}
    first: dict[tuple[str, str], str] = {}
    rows = zip(*(population[name].tolist() for name in columns), strict=True)
    for row, (sensor, channel, *units, digest, source, verdict, start) in enumerate(rows):
        if verdict == "refused":
            continue
        if digest and first.setdefault((digest, channel), source) != source:
            continue
        worth = (verdict == "good", start or _EARLY)
        key = (sensor, channel, *units)
        if key not in chosen or worth > chosen[key][0]:
            chosen[key] = (worth, row)
    return sorted(row for _, row in chosen.values())


def _fill_errors(sd: Array) -> Array:
    """Standard errors, none where they are not known; what has no bounds stays without."""
    return np.nan_to_num(sd, posinf=np.inf)


def make_quantity(values: Array, sd: Array, least: float = 0.0) -> Quantity:
    """A quantity with what is usual of it."""
    centre, spread = estimate_robust_spread(values, np.broadcast_to(sd, values.shape))
    return Quantity(values, sd, centre, spread, least)
