"""`fit_remanence`: what field a platform has of its own, from turning it beneath a magnetometer."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from scipy.special import chdtri

from agonic.alignment.maths.columns import (
    Harmonics,
    average,
    compute_size,
    fit_harmonics,
    fit_lines,
    split,
)
from agonic.alignment.session.observed import average_beside
from agonic.arrays import Array, Index
from agonic.errors import LogError, UnitError
from agonic.health import Finding, Judged, figure
from agonic.health.finding import Fact, find_facts
from agonic.maths.estimation.noise.student import RARE
from agonic.maths.rotations.frames import ARCSEC_RAD
from agonic.readable import Shown
from agonic.samples import Samples
from agonic.units import RAW

MIN_SETTINGS, MIN_SETTINGS_FOR_TWICE = 6, 10
"""Of the platform: for a magnet on it, and for what the field induces in it as well."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RemanenceFit(Judged):
    """The result of `fit_remanence`.

    Parameters
    ----------
    samples, reference : what was read. angle_deg : (k,) of the platform at each setting.
    field : (k, 3) what is read there beside the mean and what changed meanwhile, nT. noise :
        (k, 3) its standard deviations.
    harmonics : what goes round with the platform. magnitude : of the field, nT.
    size, sd : of the platform's own field across the axis of the turn, nT; chance : how often noise
        alone makes one as large. induced, induced_sd, induced_chance : the same of what goes round
        twice, `None` with too few settings.
    """

    samples: Samples
    reference: Samples | None
    angle_deg: Annotated[Array, Shown(key="angles_deg")]
    field: Array
    noise: Array
    harmonics: Harmonics
    magnitude: float
    size: Annotated[float, Shown(key="remanence_nT")]
    sd: Annotated[float, Shown(key="remanence_sd_nT")]
    chance: Annotated[float, Shown(key="by_chance")]
    induced: Annotated[float | None, Shown(key="induced_nT")] = None
    induced_sd: Annotated[float | None, Shown(key="induced_sd_nT")] = None
    induced_chance: float | None = None
    findings: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def n(self) -> Annotated[int, Shown()]:
        """How many settings of the platform."""
        return len(self.angle_deg)

    @property
    def size_arcsec(self) -> Annotated[float, Shown(key="remanence_arcsec")]:
        """By how much it turns the field where it stands across it."""
        return self.size / self.magnitude / ARCSEC_RAD

    @property
    def sd_arcsec(self) -> Annotated[float, Shown(key="remanence_sd_arcsec")]:
        """Its standard error."""
        return self.sd / self.magnitude / ARCSEC_RAD


def fit_remanence(
    samples: Samples, reference: Samples | None = None, *, wanted_arcsec: float = 2.0
) -> RemanenceFit:
    """The field that a platform has of its own, from turning it beneath a fixed magnetometer.

        field = c0 + c1 cos ψ + s1 sin ψ + c2 cos 2ψ + s2 sin 2ψ + the ambient field's changes

    A magnet on the platform goes round once in a turn ψ, iron that the ambient field magnetizes
    twice; nothing else does. What lies along the axis of the turn stays there and is not seen.

    Parameters
    ----------
    samples : readings in nT of a magnetometer that stands still beside or above the platform, with
        `heading_deg` the platform's angle, six settings or more over the whole circle.
    reference : a magnetometer farther off, at the same times; its changes are taken out. Without
        one a parabola in time is.
    wanted_arcsec : what of it matters.

    Returns a `RemanenceFit`. Raises `LogError` without angles or with too few settings, `UnitError`
    for readings without a unit.

    Source: patent CN 108871301 B, step 1: a platform without remanence.

    >>> from agonic.alignment.simulation.session import simulate_remanence
    >>> fit = fit_remanence(simulate_remanence(remanence=5.0, seed=1))
    >>> fit.verdict, round(fit.size)
    ('check', 5)
    """
    if samples.unit == RAW:
        raise UnitError("name the unit of the readings: the field of the platform is given in nT")
    visits, angle = _visit(samples)
    seen = average_beside(visits, samples, samples.field, reference)
    # a parabola of the ambient field, or the three components of the reference
    drift = 2 if samples.time is not None and seen.beside is None else 0
    ambient = 3 if seen.beside is not None else drift
    twice = len(visits) >= MIN_SETTINGS_FOR_TWICE + ambient - 2
    unrest = _measure_unrest(samples, visits) if reference is None else np.zeros(3)
    found = fit_harmonics(seen, np.radians(angle), drift, unrest, twice=twice)
    sizes = [compute_size(*both) for both in zip(found.parts, found.covariance, strict=True)]
    size, sd, chance = sizes[0]
    induced, induced_sd, induced_chance = sizes[1] if twice else (None, None, None)
    fit = RemanenceFit(
        samples=samples,
        reference=reference,
        angle_deg=angle,
        field=found.shape + found.residuals,
        noise=found.noise,
        harmonics=found,
        magnitude=float(np.linalg.norm(samples.field, axis=1).mean()),
        size=size,
        sd=sd,
        chance=chance,
        induced=induced,
        induced_sd=induced_sd,
        induced_chance=induced_chance,
    )
    matters = wanted_arcsec * ARCSEC_RAD * fit.magnitude
    return replace(fit, findings=tuple(find_facts(FACTS, fit, matters)), remarks=_remarks(fit))


def _visit(samples: Samples) -> tuple[list[Index], Array]:
    """The rows of each setting of the platform in order, all round, and its angle."""
    if samples.heading_deg is None:
        raise LogError(
            f"{samples.name} has no angle of the platform; add a column heading_deg with the angle "
            "to which it was turned"
        )
    heading = np.radians(samples.heading_deg)
    moved = np.abs(np.degrees(np.angle(np.exp(1j * np.diff(heading))))) > 0.05
    visits = split(moved)
    angle = [np.degrees(np.angle(np.exp(1j * heading[rows]).mean())) % 360 for rows in visits]
    apart = np.unique(np.round(angle, 1))
    gaps = np.diff(np.append(apart, apart[0] + 360.0))
    if len(visits) < MIN_SETTINGS or len(apart) < 4 or gaps.max() > 130.0:
        raise LogError(
            f"{len(visits)} settings of the platform at {len(apart)} angles leave "
            f"{gaps.max():.0f}° of the circle empty; turn it in steps of 45° or less all round, "
            "and leave the magnetometer where it is"
        )
    return visits, np.array(angle)


def _measure_unrest(samples: Samples, visits: list[Index]) -> Array:
    """By how much the ambient field may go round in the time of the turn, nT on each axis. While
    the platform rests only the ambient field moves: by its rates, less their noise and a
    parabola's, an oscillation of the turn's period T has the amplitude √2 rate T / 2π."""
    if samples.time is None or min(len(rows) for rows in visits) < 5:
        return np.zeros(3)
    lines = fit_lines((samples.time[rows], samples.field[rows]) for rows in visits)
    middles = average(samples.time, visits)
    time = middles - middles.mean()
    design = np.stack([np.ones(len(time)), time / max(float(np.abs(time).max()), 1e-9)], axis=1)
    rest = lines.slope - design @ np.linalg.lstsq(design, lines.slope, rcond=None)[0]
    freedom = len(time) - 2
    chance = (lines.squares / (lines.freedom * lines.power)[:, None]).mean(axis=0)
    surplus = (rest**2).sum(axis=0) / freedom - chance
    sure = (rest**2).sum(axis=0) > chdtri(freedom, RARE) * chance
    turn_s = float(np.ptp(middles)) * len(time) / (len(time) - 1)
    return np.where(sure, np.sqrt(2.0 * np.maximum(surplus, 0.0)) * turn_s / (2 * np.pi), 0.0)


FACTS = (
    Fact(
        "platform remanence",
        lambda fit, matters: (
            {"value": fit.size, "turned": fit.size_arcsec}
            if fit.chance < RARE and fit.size > matters
            else None
        ),
        "check",
        "the platform has a field of its own of {value} nT across its axis, which turns a field by "
        "up to {turned}″",
        "demagnetize or replace what is magnetic on it, or solve for the bias (--solve bias) with "
        "the magnetometer where it will stay",
    ),
    Fact(
        "platform iron",
        lambda fit, matters: (
            fit.induced
            if fit.induced is not None and fit.induced_chance < RARE and fit.induced > matters
            else None
        ),
        "check",
        "something on the platform is magnetized by the field: {value} nT repeat twice in one turn",
        "find the screw or the motor, or solve for the matrix (--solve bias,matrix)",
    ),
    Fact(
        "remanence loose",
        lambda fit, matters: {"sd": fit.sd, "wanted": matters} if fit.sd > matters else None,
        "check",
        "the platform's own field is known to {sd} nT only, and {wanted} nT are needed",
        "take more readings at each setting, and a reference farther off",
    ),
)
"""What is said of a platform, given the field, nT, that matters."""


def _remarks(fit: RemanenceFit) -> tuple[str, ...]:
    """What was found, in a sentence."""
    if fit.chance < RARE:
        return (
            f"the platform's own field is {figure(fit.size)} ± {figure(fit.sd)} nT across the axis "
            f"of the turn, {figure(fit.size_arcsec)}″",
        )
    most = fit.size + 2 * fit.sd
    return (
        f"no field of the platform itself is detected: it is at most {figure(most)} nT "
        f"({figure(most / fit.magnitude / ARCSEC_RAD)}″) across the axis of the turn",
    )
