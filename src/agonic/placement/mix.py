"""Where a second magnetometer should sit: the mix of two that cancels best, and what it costs."""

from __future__ import annotations

import csv
from collections import defaultdict
from dataclasses import dataclass, replace
from io import StringIO
from itertools import combinations
from pathlib import Path
from typing import Annotated

import numpy as np

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.contents import read_bytes
from agonic.readable import Shown
from agonic.samples import Samples

STILL_DEG = 1.0
"""How far the attitude may go in a recording of a vehicle that is strapped down."""
FEWEST = 50
COLUMNS = ("place", "add_x_nT", "add_y_nT", "add_z_nT")


@dataclass(frozen=True, kw_only=True, eq=False)
class Mix:
    """The mix field = raw₁ − G (raw₂ − raw₁) of magnetometers at two places.

    Parameters
    ----------
    first, second : the places; `second` empty for one alone. matrix : G (3, 3).
    before, left : what disturbs at the first place and in the mix, nT rms of an axis.
    noise, noise_before : of one reading of the mix and of the first alone on an axis, nT.
    share : of the first's disturbance at the second, along itself: −1 is opposite and equal.
    """

    first: Annotated[str, Shown()]
    second: str
    matrix: Array
    before: Annotated[float, Shown(key="disturbance_nT")]
    left: Annotated[float, Shown(key="left_nT")]
    noise: Annotated[float, Shown(key="noise_nT")]
    noise_before: float
    share: Annotated[float, Shown()] = 0.0

    @property
    def total(self) -> float:
        """Disturbance and noise of one reading together, nT of an axis."""
        return float(np.hypot(self.left, self.noise))

    @property
    def noise_factor(self) -> Annotated[float, Shown()]:
        """How many times the noise of the first alone."""
        return self.noise / self.noise_before

    def heading_deg(self, horizontal: float) -> float:
        """What disturbance and noise make of a heading, degrees, by the horizontal field, nT."""
        return float(np.degrees(self.total / horizontal))


def find_mix(
    first: str, second: str, moments: tuple[Array, Array, Array], noise: tuple[float, float]
) -> Mix:
    """The mix that leaves least of disturbance and noise together, and keeps the field.

    With d₁ and d₂ what disturbs at the two places, e = d₂ − d₁ and σ₁, σ₂ the noise of an axis,

        G = (E[d₁eᵀ] − σ₁² 1) (E[eeᵀ] + (σ₁² + σ₂²) 1)⁻¹

    makes E|d₁ − G e|² + σ₁² |1 + G|² + σ₂² |G|² least. Opposite and equal disturbances have
    G = −½: the mean, at 0.71 of the noise. Where both see the same, nothing cancels.

    Parameters: `moments` E[d₁d₁ᵀ], E[d₁d₂ᵀ], E[d₂d₂ᵀ], (3, 3) each, nT²; `noise` of an axis, nT.

    Source: the best linear unbiased combination (Gauss–Markov), with the field as what is kept.

    >>> opposite = 1e6 * np.eye(3)
    >>> made = find_mix("bow", "mast", (opposite, -opposite, opposite), (100.0, 100.0))
    >>> float(made.matrix[0, 0].round(2)), round(made.noise_factor, 2), round(made.left)
    (-0.5, 0.71, 0)
    """
    own, across, other = moments
    one = np.eye(3)
    apart = own + other - across - across.T
    toward = across - own
    s1, s2 = np.square(noise)
    g = np.linalg.solve((apart + (s1 + s2) * one).T, (toward - s1 * one).T).T
    left = np.trace(own - g @ toward.T - toward @ g.T + g @ apart @ g.T)
    spread = s1 * np.square(one + g).sum() + s2 * np.square(g).sum()
    return Mix(
        first=first,
        second=second,
        matrix=g,
        before=float(np.sqrt(max(np.trace(own), 0.0) / 3)),
        left=float(np.sqrt(max(left, 0.0) / 3)),
        noise=float(np.sqrt(spread / 3)),
        noise_before=float(noise[0]),
        share=float(np.trace(across) / max(np.trace(own), 1e-12)),
    )


def judge_recording(samples: Samples) -> Mix:
    """The best mix of the two sensors of a recording of a vehicle that stands strapped down.

    Parameters: samples in nT with `second`, while everything on board is switched. Raises
    `LogError` without a second sensor, with too few readings, or where the vehicle moved. What is
    left is no less than the noise of the mean hides.
    """
    if samples.second is None:
        raise LogError(f"{samples.name} has no second magnetometer beside it; log both")
    if len(samples) < FEWEST:
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
    noise = tuple(float(np.sqrt(np.mean(np.square(part)))) for part in (sd[:3], sd[3:]))
    moments = np.cov(both.T) - np.diag(np.square(sd))
    mix = find_mix(
        samples.name,
        samples.second_sensor or "second",
        (moments[:3, :3], moments[:3, 3:], moments[3:, 3:]),
        (max(noise[0], 1e-3), max(noise[1], 1e-3)),
    )
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
    found: dict[str, dict[str, Array]] = defaultdict(dict)
    for number, row in enumerate(table, start=2):
        try:
            added = np.array([float(row[name]) for name in COLUMNS[1:]])
        except (TypeError, ValueError):
            raise LogError("what is added is not three numbers", path=path, row=number) from None
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


def rank_places(places: dict[str, Array], noise: float) -> list[Mix]:
    """Every place alone and every pair, the best first; sources are taken to switch by themselves.

    >>> here = {"bow": np.array([[900.0, 0, 0]]), "mast": np.array([[-900.0, 0, 0]])}
    >>> best = rank_places({**here, "stern": np.array([[500.0, 0, 0]])}, 100.0)[0]
    >>> sorted((best.first, best.second)), round(best.left) < 50
    (['bow', 'mast'], True)
    """
    made = [
        Mix(
            first=name,
            second="",
            matrix=np.zeros((3, 3)),
            before=float(np.sqrt(np.square(added).sum() / 3)),
            left=float(np.sqrt(np.square(added).sum() / 3)),
            noise=noise,
            noise_before=noise,
        )
        for name, added in places.items()
    ]
    quiet_first = sorted(places, key=lambda name: float(np.square(places[name]).sum()))
    for first, second in combinations(quiet_first, 2):
        one, two = places[first], places[second]
        made.append(
            find_mix(first, second, (one.T @ one, one.T @ two, two.T @ two), (noise, noise))
        )
    return sorted(made, key=lambda mix: mix.total)
