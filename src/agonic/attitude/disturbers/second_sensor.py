"""Whether a second magnetometer sits where it can compensate the first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.arrays import Array
from agonic.attitude.fit import fit_channels
from agonic.attitude.settings import Settings
from agonic.errors import AgonicError
from agonic.fit import Fit
from agonic.health import Finding, figure
from agonic.reference import Reference
from agonic.samples import Samples

SLIGHT = 0.005
"""A disturbance over the usual changes of the current that is less of the field is left alone."""
ALIKE = 0.3
"""Disturbances that differ by less of themselves cannot be told from the field."""


def find_placement(
    samples: Samples, reference: Reference, channels: tuple[str, ...], settings: Settings
) -> Finding | None:
    """What the current does to either sensor, and whether a mix of the two can cancel it.

    A mix that keeps the field, u = raw₁ + P (raw₂ − raw₁), cancels disturbances d₁ and d₂ where
    P (d₂ − d₁) = −d₁: it exists unless d₁ = d₂, and the smallest magnifies noise by about
    1 + |d₁|/|d₂ − d₁|. None without a current that varies.
    """
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
    first, second = (_slope(fit) * (high - low) for fit in fits)
    return judge_placement(first, second, float(reference.magnitudes(len(samples)).mean()))


def _slope(fit: Fit) -> Array:
    """Field that an ampere adds, nT."""
    calibration = fit.calibration
    return np.asarray(calibration.matrix @ calibration.cleaned(np.zeros(3), current_A=-1.0))


def judge_placement(first: Array, second: Array, magnitude: float) -> Finding:
    """The finding for what the current adds at the two places, nT, in a field of `magnitude`.

    >>> judge_placement(np.array([3000.0, 0, 0]), np.array([-3000.0, 0, 0]), 5e4).what
    'the current moves the two sensors by 3000 nT and 3000 nT, opposite ways: their mean cancels it'
    >>> judge_placement(np.array([3000.0, 0, 0]), np.array([2800.0, 0, 0]), 5e4).severity
    'check'
    """
    sizes = [float(np.linalg.norm(v)) for v in (first, second)]
    apart = float(np.linalg.norm(second - first))
    words = f"the current moves the two sensors by {figure(sizes[0])} nT and {figure(sizes[1])} nT"
    if max(sizes) < SLIGHT * magnitude:
        return Finding("placement", "note", f"{words}: there is little to compensate")
    if apart < ALIKE * max(sizes):
        return Finding(
            "placement",
            "check",
            f"{words}, the same way: no mix of the two can tell it from the field",
            "move one of them farther from the wires, or to their other side",
        )
    if np.linalg.norm(first + second) < ALIKE * max(sizes):
        return Finding("placement", "note", f"{words}, opposite ways: their mean cancels it")
    noise = figure(1 + sizes[0] / apart)
    return Finding(
        "placement",
        "note",
        f"{words}, neither alike nor opposite: a mix can cancel it at {noise} times the noise, "
        "the mean of the two cannot",
    )
