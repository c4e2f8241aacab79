"""The fits from the simplest to the chosen one, side by side on unseen parts of a log."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.linalg import polar

from agonic.arrays import Array, Index, Mask
from agonic.attitude.fit import CHANNELS, open_channels_parts
from agonic.attitude.problem import Settings
from agonic.calibration.affine import Affine
from agonic.calibration.base import select_columns
from agonic.calibration.interference import Interference
from agonic.calibration.sources import name_sources, stack_inputs
from agonic.ellipsoid import open_ellipsoid_parts
from agonic.errors import AgonicError
from agonic.fit import Fit
from agonic.maths.equation.affine import FREE
from agonic.maths.equation.coverage import heading_jacobian_deg, level_directions, make_level_axes
from agonic.maths.rotations.angles import wrap_deg
from agonic.maths.rotations.right_angles import right_angles
from agonic.maths.rotations.tilt import two_axis_deg
from agonic.readable import Shown
from agonic.recording.parts import cut_blocks, predict
from agonic.reference import Reference
from agonic.report.fields import FRACTION
from agonic.report.labels import unit_label
from agonic.samples import Samples
from agonic.verification import Verification, verify

MOST_ROWS = 1000
"""Rows, evenly spaced, that the rungs are fitted to, and by whose unseen parts they are judged."""

NAMES = {"sphere": "bias only", "diagonal": "diagonal", "full": "full"}
AIDS = {
    "levelled": "roll and pitch",
    "inertial": "accelerometer and gyro",
    "vector": "roll, pitch, heading",
}


@dataclass(frozen=True)
class Rung:
    """One fit of a ladder. `parameters` that it estimates; `spread` of the magnitude of unseen
    readings over its mean, and `held_out_rms` the same in the unit of the field, NaN where parts of
    the log could not be fitted; `heading_error_deg` of a level vehicle, rms over all headings, with
    its standard error, and `errors_deg`, its mean at even headings; `why` it was chosen, or not;
    `unit` of the field."""

    name: Annotated[str, Shown("Fit")]
    parameters: Annotated[int, Shown("Unknowns")]
    spread: Annotated[float, Shown("Spread", FRACTION)]
    held_out_rms: Annotated[float, Shown("Residual, unseen", "{unit}", 2)]
    heading_error_deg: Annotated[
        float, Shown("Heading error, predicted", "°", sd="heading_error_sd_deg", most=180.0)
    ]
    heading_error_sd_deg: Annotated[float, Shown()]
    errors_deg: tuple[float, ...] = ()
    chosen: Annotated[bool, Shown()] = False
    why: Annotated[str, Shown()] = ""
    unit: str = ""


def build_ladder(
    samples: Samples,
    reference: Reference | None,
    fit: Fit,
    verification: Verification,
    *,
    method: str,
    reason: str,
    single: bool,
) -> tuple[Rung, ...]:
    """The ladder of fits to samples, up to the one that was chosen. Each is judged on blocks of
    time that it has not seen, as the chosen one was: `single` where each block was left out in its
    turn. Its heading is compared with that of the chosen fit, whose own uncertainty counts in
    (`predict_heading_error`)."""
    chosen = plain = fit.calibration
    if isinstance(chosen, Interference):
        inputs = stack_inputs(chosen.sources, None, select_columns(chosen, samples))
        plain = chosen.at(inputs.mean(axis=0))
    # without the turn that only an attitude shows
    near = Affine(bias=plain.bias, matrix=polar(plain.matrix)[1], magnitude=plain.magnitude)
    rows = find_even_rows(len(samples), MOST_ROWS)
    some, known = samples.select(rows), None if reference is None else reference.select(rows)
    every = np.ones(len(some), dtype=bool)
    used = every if fit.weights is None else fit.weights[rows] > 0
    block, weights = cut_blocks(some)
    fold = block if single else block % 2
    compare = partial(predict_heading_error, fit=fit, samples=some)
    unit = unit_label(chosen.unit_out)
    gain = float(np.trace(chosen.matrix)) / 3
    as_recorded = Affine(bias=np.zeros(3), matrix=gain * np.eye(3))
    heading = compare(as_recorded)._asdict()
    before = verification.spread_before
    size = chosen.magnitude or np.nan
    rungs = [Rung("as recorded", 0, before, before * size, **heading, unit=unit)]
    for name, open_parts, why in _list_others(fit, method):
        try:
            fit_part = open_parts(some, known, near=near)
            found = fit_part(every)
        except AgonicError:
            continue
        folds = predict(some, fit_part, fold, weights)
        held_out = (np.nan, np.nan)
        if folds is not None:
            judged = verify(found, some, known, corrected=folds.unseen, held_out=used)
            held_out = (judged.spread_after, judged.residual_rms)
        rungs.append(
            Rung(name, _count(found), *held_out, **compare(found)._asdict(), why=why, unit=unit)
        )
    held_out = (verification.spread_after, verification.residual_rms)
    own = Rung(
        _name(chosen, method), _count(chosen), *held_out, **compare(chosen)._asdict(), unit=unit
    )
    if method == "ellipsoid" and fit.tests:
        reason = "; ".join(dict.fromkeys(test.sentence for test in fit.tests))
    rungs.append(replace(own, chosen=True, why=reason))
    return tuple(sorted(rungs, key=lambda rung: rung.parameters))


def find_even_rows(n: int, most: int) -> Index:
    """No more than `most` of n rows, evenly spaced, (k,)."""
    return np.unique(np.linspace(0, n - 1, most).astype(int))


_OpenParts = Callable[..., Callable[[Mask], Affine]]
"""What opens the fits to parts of samples of a reference, `near` a calibration."""


def _list_others(fit: Fit, method: str) -> Iterator[tuple[str, _OpenParts, str]]:
    """Name of each fit beside the chosen one, what makes it, and why it was not chosen."""
    chosen = fit.calibration
    alone = method == "ellipsoid"
    said = {test.smaller: test.sentence for test in fit.tests if alone}
    for model, name in NAMES.items():
        if not alone or chosen.model != model:
            open_parts = partial(open_ellipsoid_parts, model=model)
            yield name, open_parts, said.get(model, "")
    if chosen.needs and method in CHANNELS:
        name = f"{NAMES[chosen.model]} + {AIDS[method]}"
        beside = partial(open_channels_parts, channels=CHANNELS[method], settings=Settings())
        yield name, beside, "what disturbs on board is missing"


def _name(chosen: Affine, method: str) -> str:
    parts = [NAMES[chosen.model]]
    parts += [AIDS[method]] if method in AIDS else []
    parts += [name_sources(chosen.sources)] if isinstance(chosen, Interference) else []
    return " + ".join(parts)


def _count(calibration: Affine) -> int:
    """Unknowns of a calibration: its model's, and three for each signal of a source."""
    matrix = {"sphere": 1, "diagonal": 3}.get(calibration.model, 0)
    return 3 + matrix if matrix else len(calibration.parameters)


class HeadingError(NamedTuple):
    """The rms error of a level heading, its standard error, and its mean at even headings."""

    heading_error_deg: float
    heading_error_sd_deg: float
    errors_deg: tuple[float, ...] = ()


def predict_heading_error(rung: Affine, *, fit: Fit, samples: Samples) -> HeadingError:
    """The error of a level heading by one calibration as another fit sees it. With truth at the
    fit's calibration plus an error δ of covariance C, the error at heading k is e_k + J_k δ, e the
    difference of the two headings. Then m = mean (e + J δ)² has

        E m = mean e² + tr Q,   var m = 2 tr Q² + 4 eᵀ J C Jᵀ e / n²,   Q = J C Jᵀ / n,

    and the error is √E m with standard deviation √var m / (2 √E m). A mounting by right angles is
    not counted as an error of a calibration that cannot know it.
    """
    chosen, coverage = fit.calibration, fit.coverage
    if chosen.magnitude is None or "second" in (*chosen.needs, *rung.needs):
        return HeadingError(np.nan, np.nan)
    axes = make_level_axes(coverage.down).T
    directions, _ = level_directions(coverage.inclination_deg, down=coverage.down)
    jacobian = heading_jacobian_deg(
        coverage.inclination_deg, chosen.magnitude, chosen.matrix, chosen.gauge, coverage.down
    )
    m = jacobian.shape[-1]
    assert chosen.covariance is not None
    n = len(jacobian)
    by_heading = jacobian @ chosen.covariance[:m, :m] @ jacobian.T
    raw = chosen.magnitude * directions @ np.linalg.inv(chosen.matrix).T + chosen.bias
    # (k, 3), at several moments
    added = _evaluate_sources(chosen, samples) - _evaluate_sources(rung, samples)
    field = (raw + added[:, None] - rung.bias) @ rung.matrix.T
    if chosen.gauge == FREE and rung.gauge != FREE:
        turn = chosen.matrix @ np.linalg.inv(rung.matrix)
        turns = right_angles()
        field = field @ turns[int(np.argmax(np.einsum("kij,ij->k", turns, turn)))].T
    field, directions = field @ axes, directions @ axes
    turned = two_axis_deg(field[..., 0], field[..., 1])
    true = two_axis_deg(directions[:, 0], directions[:, 1])
    error = wrap_deg(turned - true)
    mean = float(np.mean(error**2) + np.trace(by_heading) / n)
    steady = error.mean(axis=0)
    variance = 2 * np.sum(by_heading**2) / n**2 + 4 * steady @ by_heading @ steady / n**2
    size = float(np.sqrt(mean))
    sd = float(np.sqrt(variance) / (2 * size)) if size else 0.0
    order = np.argsort(np.round(true % 360.0, 6))
    return HeadingError(size, sd, tuple(steady[order].tolist()))


def _evaluate_sources(calibration: Affine, samples: Samples, moments: int = 25) -> Array:
    """What sources on board add to the readings, (k, 3), at moments spread over the samples."""
    if not isinstance(calibration, Interference):
        return np.zeros((1, 3))
    few = samples.select(find_even_rows(len(samples), moments))
    columns: dict[str, Any] = select_columns(calibration, few)
    x = stack_inputs(calibration.sources, None, columns)
    return np.asarray(x @ calibration.coefficients.T)
