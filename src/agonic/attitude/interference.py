"""`fit_interference`: what currents on board do, and what a second magnetometer makes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.attitude.fit import fit_channels
from agonic.attitude.problem import Gauge, Model, Settings
from agonic.errors import AgonicError
from agonic.fit import Fit
from agonic.health import Finding, figure
from agonic.logs.any_form import Given, as_samples
from agonic.reference import Reference
from agonic.samples import Samples

SLIGHT = 0.005
"""A disturbance over the usual changes of the current that is less of the field is left alone."""
ALIKE = 0.3
"""Disturbances that differ by less of themselves cannot be told from the field."""


def find_placement(
    samples: Samples, reference: Reference, channels: tuple[str, ...], settings: Settings
) -> Finding | None:
    """What the current does to either sensor, and whether a mix of the two can cancel it. A mix
    that keeps the field, u = raw₁ + P (raw₂ − raw₁), cancels disturbances d₁ and d₂ where P (d₂ −
    d₁) = −d₁: it exists unless d₁ = d₂, and the smallest magnifies noise by about 1 + |d₁|/|d₂ −
    d₁|. None without a current that varies."""
    current = samples.current_A
    if current is None or not np.ptp(current) > 0 or samples.second is None:
        return None
    alone = replace(settings, sources=("current_A",))
    other = samples.with_columns(field=samples.second, second=None)
    try:
        fits = [
            fit_channels(s, reference, channels, alone, "interference") for s in (samples, other)
        ]
    except AgonicError:
        return None
    low, high = np.percentile(current, (5, 95))
    first, second = (
        (high - low) * c.matrix @ c.cleaned(np.zeros(3), current_A=-1.0)  # nT by these amperes
        for c in (fit.calibration for fit in fits)
    )
    return judge_placement(first, second, float(reference.magnitudes(len(samples)).mean()))


def judge_placement(first: Array, second: Array, magnitude: float) -> Finding:
    """The finding for what the current adds at the two places, nT, in a field of `magnitude`."""
    sizes = [float(np.linalg.norm(v)) for v in (first, second)]
    apart = float(np.linalg.norm(second - first))
    words = f"the current moves the two sensors by {figure(sizes[0])} nT and {figure(sizes[1])} nT"
    alike = apart < ALIKE * max(sizes)
    if slight := max(sizes) < SLIGHT * magnitude:
        words += ": there is little to compensate"
    elif alike:
        words += ", the same way: no mix of the two can separate it from the field"
    elif np.linalg.norm(first + second) < ALIKE * max(sizes):
        words += ", opposite ways: their mean cancels it"
    else:
        words += (
            f", neither alike nor opposite: a mix can cancel it at {figure(1 + sizes[0] / apart)} "
            "times the noise, the mean of the two cannot"
        )
    wrong = alike and not slight
    return Finding(
        "placement",
        "check" if wrong else "note",
        words,
        "move one of them farther from the wires, or to their other side" if wrong else "",
    )


def fit_interference(
    samples: Given,
    reference: Reference | ArrayLike | None,
    sources: Sequence[str] = ("current_A",),
    *,
    model: Model = "full",
    gauge: Gauge = "auto",
    robust: bool = True,
    soft_iron_sd: float | None = 0.1,
    turn_sd_deg: float | None = 2.0,
    inclination_deg: float | None = None,
    seed: int = 0,
) -> Fit:
    """Bias, matrix, and how much field each ampere (or other source) adds to the readings.

        field = W (raw − bias − K x)

    with x the current, the throttle, several of them, or the readings of a second magnetometer
    (then this is the 3×6 mix of two sensors by least squares). Aided by all that is known: the
    magnitude, with roll and pitch the dip, with an independent heading the azimuth.

    Parameters
    ----------
    samples : with the columns named in `sources`, which must vary.
    reference : per sample (n, 3), (n, 2) or (n,) as for `fit_vector`, `fit_levelled` or
        `fit_ellipsoid`, or constant; with the attitude in the
        samples it decides which residuals are used.
    sources : "current_A", "throttle", "second".

    model, gauge, robust, soft_iron_sd, turn_sd_deg, inclination_deg, seed : as in `fit_levelled`.

    Returns a `Fit` whose calibration is an `Interference`; with a second magnetometer and a
    current, the finding "placement" says whether the two sit where a mix can work. Raises
    `LogError` where a source is not recorded, `CoverageError` where it never changes.

    Examples
    --------
    >>> from agonic.simulation import simulate
    >>> flown = simulate("flight", n=4000, noise=50.0, stray_nT_A=(60.0, -35.0, 90.0))
    >>> fit = fit_interference(flown.samples, Reference.horizontal_vertical(25_000.0, 43_301.27))
    >>> added = flown.truth.matrix @ fit.calibration.coefficients[:, 0]  # nT per ampere
    >>> bool((abs(added - [60.0, -35.0, 90.0]) < 4.0).all())
    True
    """
    chosen = Settings.of(locals())
    if not sources:
        raise AgonicError("sources is empty; name what disturbs: current_A, throttle or second")
    samples, reference = as_samples(samples), Reference.required(reference)
    known = find_channels(samples, reference)
    fit = fit_channels(samples, reference, known, chosen, "interference")
    if "second" not in sources:
        return fit
    found = find_placement(samples, reference, known, chosen)
    return fit.with_findings(found)


def find_channels(samples: Samples, reference: Reference) -> tuple[str, ...]:
    """The channels that samples and reference allow."""
    levelled = samples.roll_deg is not None and samples.pitch_deg is not None
    if not levelled or reference.kind in ("constant", "magnitude"):
        return ("magnitude",)
    if samples.heading_deg is None or samples.heading_estimated or reference.kind != "vector":
        return ("magnitude", "dip")
    return ("magnitude", "dip", "azimuth")
