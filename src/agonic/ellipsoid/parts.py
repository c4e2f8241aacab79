"""Fits by magnitude to parts of a log, from the one to all of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from agonic.arrays import Mask
from agonic.calibration.affine import Affine
from agonic.ellipsoid.calibration import make_calibration_of
from agonic.ellipsoid.fit import fit_ellipsoid_alone
from agonic.ellipsoid.problem import normalise_start, pose
from agonic.ellipsoid.settings import Settings
from agonic.ellipsoid.solve import list_numbers, seek
from agonic.maths.equation.parts import estimate_part
from agonic.reference import Reference
from agonic.samples import Samples


def open_ellipsoid_parts(
    samples: Samples,
    reference: Reference | None = None,
    *,
    near: Affine | None = None,
    **settings: Any,
) -> Callable[[Mask], Affine]:
    """What gives the calibration by some of the rows (n,), as `fit_ellipsoid_alone` of them does.

    The minimum is sought from that of all rows, with their noise; where a part has another, or a
    model is still to be chosen, it is fitted by itself.

    >>> turned = Samples(field=50_000 * np.random.default_rng(0).normal(size=(40, 3)))
    >>> open_ellipsoid_parts(turned, model="sphere")(np.arange(40) < 30).model
    'sphere'
    """
    chosen = Settings(**settings)
    model = chosen.model

    def fit_alone(rows: Mask) -> Affine:
        known = None if reference is None else reference.select(rows)
        return fit_ellipsoid_alone(samples.select(rows), known, near=near, **settings)

    if model == "auto" or chosen.method != "likelihood":
        return fit_alone
    posed = pose(samples, reference, chosen.method)
    start = None if near is None else normalise_start(near, posed.scale)
    problem = posed.problem(model, chosen.soft_iron_sd)
    try:
        found = seek(problem, posed.robust(chosen), chosen.seed, start)
    except (OverflowError, np.linalg.LinAlgError):
        return fit_alone

    def fit(rows: Mask) -> Affine:
        some = np.flatnonzero(rows[posed.usable])
        part = estimate_part(problem, found, some)
        if part is None:
            return fit_alone(rows)
        numbers = list_numbers(part, model)
        return make_calibration_of(samples, numbers, posed.scale, chosen.gauge)

    return fit
