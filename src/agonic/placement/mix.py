"""What was measured of two magnetometers, or at places in a table: the mixes that cancel best."""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from typing import Annotated

import numpy as np

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.contents import read_bytes
from agonic.placement.search import combine
from agonic.readable import Shown
from agonic.samples import Samples

STILL_DEG = 1.0
"""How far the attitude may go in a recording of a vehicle that is strapped down."""
COLUMNS = ("place", "add_x_nT", "add_y_nT", "add_z_nT")


@dataclass(frozen=True, kw_only=True, eq=False)
class Mix:
    """The mix field = raw₁ − G (raw₂ − raw₁) of magnetometers at two places.

    Parameters
    ----------
    first, second : the places; `second` None for one alone. matrix : G (3, 3).
    before, left : what disturbs at the first place and in the mix, nT rms of an axis.
    noise, noise_before : of one reading of the mix and of the first alone on an axis, nT.
    share : of the first's disturbance at the second, along itself: −1 is opposite and equal.
    horizontal : the field by which a heading is found, nT.
    """

    name: Annotated[str, Shown("Magnetometers", key="")]
    first: Annotated[str, Shown()]
    second: Annotated[str | None, Shown()]
    matrix: Array
    before: Annotated[float, Shown(key="disturbance_nT")]
    left: Annotated[float, Shown("Disturbance left", "nT", 2, key="left_nT")]
    noise: Annotated[float, Shown(key="noise_nT")]
    noise_before: float
    share: Annotated[float, Shown()]
    horizontal: float

    @property
    def total(self) -> float:
        """Disturbance and noise of one reading together, nT of an axis."""
        return float(np.hypot(self.left, self.noise))

    @property
    def noise_factor(self) -> Annotated[float, Shown("Noise", "×", 2)]:
        """How many times the noise of the first alone."""
        return self.noise / self.noise_before

    @property
    def heading_deg(self) -> Annotated[float, Shown("Heading, one reading", "°", 2)]:
        """What disturbance and noise make of a heading, degrees."""
        return float(np.degrees(self.total / self.horizontal))


def list_mixes(
    names: Sequence[str], moments: Array, noise: Array, horizontal: float
) -> dict[tuple[int, int], Mix]:
    """Every place (p) alone and every pair with the mix of least disturbance and noise together."""
    p, even = len(names), np.eye(3) / 3  # all directions count alike
    d = moments.reshape(p, 3, p, 3)
    of_products = np.einsum("ik,pjql->pijqkl", even, d).reshape(9 * p, 9 * p)
    _, mixes = combine(of_products, even, noise)

    def judge(one: int, two: int) -> Mix:
        g = mixes[one, two]
        weights = np.concatenate([np.eye(3) + g, -g], axis=1)
        both = d[np.ix_([one, two], range(3), [one, two], range(3))].reshape(6, 6)
        variance = np.repeat(noise[[one, two]] ** 2, 3)
        own = max(both[:3, :3].trace(), 0.0)
        left = max((weights @ both @ weights.T).trace(), 0.0)
        alone = one == two
        return Mix(
            name=f"{names[one]} alone" if alone else f"{names[one]} with {names[two]}",
            first=names[one],
            second=None if alone else names[two],
            matrix=g,
            before=float(np.sqrt(own / 3)),
            left=float(np.sqrt(left / 3)),
            noise=float(np.sqrt((weights**2 @ variance).sum() / 3)),
            noise_before=float(noise[one]),
            share=0.0 if alone else float(both[:3, 3:].trace() / max(own, 1e-12)),
            horizontal=horizontal,
        )

    return {(one, two): judge(one, two) for one in range(p) for two in range(one, p)}


def judge_recording(samples: Samples, horizontal: float = 20_000.0) -> Mix:
    """The best mix of the two sensors of a recording of a vehicle that stands strapped down."""
    if samples.second is None:
        raise LogError(f"{samples.name} has no second magnetometer beside it; log both")
    if len(samples) < 50:
        raise LogError(f"{len(samples)} readings are too few; record a minute while all switches")
    for name in ("roll_deg", "pitch_deg"):
        angle = getattr(samples, name)
        if angle is not None and float(np.ptp(np.percentile(angle, (2, 98)))) > STILL_DEG:
            raise LogError(
                f"{name} changes by more than {STILL_DEG:g}°, so the field itself changes in the "
                "sensors; strap the vehicle down, and switch motors and loads on and off"
            )
    both = np.concatenate([samples.field, samples.second], axis=1)
    steps = np.diff(both, axis=0)
    sd = np.median(np.abs(steps - np.median(steps, axis=0)), axis=0) / 0.6745 / np.sqrt(2)
    noise = np.maximum(np.sqrt(np.square(sd).reshape(2, 3).mean(axis=1)), 1e-3)
    names = (samples.name, samples.second_sensor or "second")
    mix = list_mixes(names, np.cov(both.T) - np.diag(np.square(sd)), noise, horizontal)[0, 1]
    return replace(mix, left=max(mix.left, mix.noise / float(np.sqrt(len(samples)))))


def read_places(path: Path | str) -> dict[str, Array]:
    """What each source adds at each place, (s, 3) nT, by the place's name.

    The table has a row a place and source: `place,source,add_x_nT,add_y_nT,add_z_nT`. Raises
    `LogError` where columns or sources are missing, or a number is none.
    """
    text = read_bytes(path).decode("utf-8-sig", errors="replace")
    table = csv.DictReader(StringIO(text), skipinitialspace=True)
    missing = [name for name in COLUMNS if name not in (table.fieldnames or ())]
    if missing:
        raise LogError(f"has no column {', '.join(missing)}", path=path)
    found: dict[str, dict[str, list[float]]] = defaultdict(dict)
    for number, row in enumerate(table, start=2):
        try:
            added = [float(row[name]) for name in COLUMNS[1:]]
        except (TypeError, ValueError):
            added = [np.nan]
        if not np.isfinite(added).all():
            raise LogError("what is added is not three numbers", path=path, row=number)
        found[row["place"].strip()][(row.get("source") or "all").strip()] = added
    sources = sorted({name for own in found.values() for name in own})
    for place, own in found.items():
        lacking = [name for name in sources if name not in own]
        if lacking:
            raise LogError(f"{place} has no row for {', '.join(lacking)}", path=path)
    if not found:
        raise LogError("holds no place", path=path)
    return {place: np.array([own[name] for name in sources]) for place, own in found.items()}


def rank_places(places: dict[str, Array], noise: float, horizontal: float = 20_000.0) -> list[Mix]:
    """Every place alone and every pair, the best first; sources are taken to switch by
    themselves."""
    names = sorted(places, key=lambda name: float(np.square(places[name]).sum()))
    added = np.concatenate([places[name] for name in names], axis=1)
    made = list_mixes(names, added.T @ added, np.full(len(names), noise), horizontal)
    return sorted(made.values(), key=lambda mix: mix.total)
