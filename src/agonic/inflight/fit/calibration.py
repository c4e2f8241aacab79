"""The estimate back in nT: what changed in flight, and ground and change in one or as a chain."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Validity
from agonic.calibration.chain import Chain
from agonic.calibration.interference import Interference
from agonic.calibration.thermal import Thermal
from agonic.inflight.fit.covariance import Estimate
from agonic.inflight.fit.ground_errors import compute_ground_covariance
from agonic.inflight.fit.problem import Problem
from agonic.inflight.fit.solve import rotation_of
from agonic.inflight.fit.terms import Drift
from agonic.maths.equation.affine import FREE, model_basis, split
from agonic.maths.rotations.polar import split_rotation
from agonic.maths.rotations.vectors import skew
from agonic.provenance import Provenance
from agonic.samples import Samples

METHOD = ("huber-1981",)


def build_change(problem: Problem, estimate: Estimate, samples: Samples) -> Affine:
    """field = matrix @ (ground field − bias) at the end of the record and at the middle
    temperature, with covariance; a rotation in it is left to the alignment."""
    gauge, ground, asked, terms = (
        estimate.layout.gauge, problem.ground, problem.settings, estimate.terms
    )  # fmt: skip
    params, covariance = _find_at_end(problem, estimate)
    bias, matrix = split(model_basis("full", gauge) @ params)
    if gauge == FREE:
        _, rest = split_rotation(matrix, covariance, FREE)
        matrix, covariance = rest.rotation.T @ matrix, rest.covariance[:9, :9]
    frame = samples.frame if ground is None else ground.frame_out
    settings = {
        "fit": "inflight",
        "reference": problem.source,
        "solve": asked.solve,
        "drift_intervals": terms.intervals,
        "temperature_degree": asked.temperature_degree,
        "matrix_rate": terms.rate,
        "sources": list(terms.sources),
        "attitude": asked.attitude,
        "gain_sd": asked.gain_sd,
        "soft_iron_sd": asked.soft_iron_sd,
        "robust": asked.robust,
        "ground": None if ground is None else ground.kind,
        "excluded": int((~problem.used).sum()),
    }
    return Affine(
        bias=bias,
        matrix=(matrix + matrix.T) / 2,
        covariance=covariance,
        unit_in=samples.unit if ground is None else ground.unit_out,
        unit_out="nT",
        magnitude=problem.magnitude,
        noise=estimate.noise["magnitude"].sd * problem.magnitude,
        sensor=samples.name,
        device_id=samples.device_id,
        frame_in=frame,
        frame_out=frame,
        validity=Validity.of(samples),
        provenance=Provenance(inputs=(samples.origin,), settings=settings, method=METHOD),
    )


def build_alignment(problem: Problem, estimate: Estimate, change: Affine) -> Alignment | None:
    """From sensor axes to those of the attitude; None without attitude."""
    if problem.direction is None:
        return None
    params, covariance = _find_at_end(problem, estimate)
    _, matrix = split(model_basis("full", FREE) @ params)
    _, rest = split_rotation(matrix, covariance, FREE)
    return Alignment(
        rotation=Rotation.from_matrix(problem.rotation @ rest.rotation),
        covariance=problem.rotation @ rest.covariance[9:, 9:] @ problem.rotation.T,
        frame_in=change.frame_out,
        sensor=change.sensor,
        provenance=change.provenance,
    )


def build_drift(estimate: Estimate, magnitude: float) -> Drift:
    """The bias in time, nT."""
    terms, params = estimate.terms, estimate.solution.params
    own = estimate.layout.bias_columns(slice(terms.splines))
    known = np.concatenate([np.arange(3), own.ravel()])
    return Drift(
        knots=terms.knots,
        middle=terms.middle,
        constant=params[:3] * magnitude,
        coefficients=params[own] * magnitude,
        covariance=estimate.solution.covariance[np.ix_(known, known)] * magnitude**2,
        start=terms.start,
        stop=terms.stop,
    )


def build_sources(problem: Problem, estimate: Estimate) -> tuple[Array, Array]:
    """What a unit of each source adds to a reading (3, k), nT, and its standard error."""
    terms, sd = estimate.terms, np.sqrt(np.maximum(np.diag(estimate.solution.covariance), 0.0))
    own = estimate.layout.bias_columns(slice(terms.splines + terms.degree, None))
    size = problem.magnitude / terms.spread
    return estimate.solution.params[own] * size, sd[own] * size


def build_calibration(
    problem: Problem, estimate: Estimate, change: Affine, samples: Samples
) -> Affine | Thermal | Chain:
    """Ground and change multiplied out where both are affine, else as a chain."""
    terms, ground = estimate.terms, problem.ground
    steps: list[Any] = []
    last: Affine | Thermal = change
    turn = find_rotation_covariance(problem, estimate)
    if terms.degree:
        steps = [_build_interference(problem, estimate, change)] if terms.sources else []
        last = _build_thermal(problem, estimate, change)
    elif terms.sources:
        last = _build_interference(problem, estimate, change)
    elif ground is not None and type(ground) is not Affine:  # its rotation the flight does not tell
        plain = replace(_PLAIN, unit_in=change.unit_in, frame_in=change.frame_in)
        last = join_affine(plain, change, samples, turn)
    if ground is None and not steps:
        return last
    if type(ground) is Affine and type(last) is Affine:
        return join_affine(ground, last, samples, turn)
    before = ground.steps if isinstance(ground, Chain) else [] if ground is None else [ground]
    return Chain(steps=(*before, *steps, last), provenance=change.provenance)


_PLAIN = Affine(bias=np.zeros(3), matrix=np.eye(3))


def join_affine(
    ground: Affine, change: Affine, samples: Samples, rotation_covariance: Array
) -> Affine:
    """Ground and change as one affine calibration: matrix = (1 + Ω) M W, bias = b + W⁻¹ c.

    The flight knows bias and gains of the present, with the ground's covariance of W as its prior,
    so that the change is all that is uncertain, but for the rotation Ω, which it does not tell:
    `rotation_covariance` (3, 3), rad², is what the ground leaves open of it.
    """
    assert change.covariance is not None
    local = block_diag(np.linalg.inv(ground.matrix), np.kron(np.eye(3), ground.matrix.T))
    matrix = change.matrix @ ground.matrix
    free = np.linalg.pinv(model_basis("full", "free"))
    onto = free @ local @ model_basis("full")
    turn = free[:, 3:] @ (skew(np.eye(3)) @ matrix).reshape(3, 9).T
    return replace(
        change,
        bias=ground.bias + np.linalg.solve(ground.matrix, change.bias),
        matrix=matrix,
        gauge="free",
        covariance=onto @ change.covariance @ onto.T + turn @ rotation_covariance @ turn.T,
        unit_in=ground.unit_in,
        frame_in=ground.frame_in,
        validity=Validity.of(samples),
    )


def find_rotation_covariance(problem: Problem, estimate: Estimate) -> Array:
    """What the ground leaves open of the rotation, (3, 3), rad²; nothing where the attitude tells
    the rotation, which is then the alignment's."""
    if problem.ground is None or problem.direction is not None:
        return np.zeros((3, 3))
    at = np.array([estimate.terms.centre_C])
    return compute_ground_covariance(problem.ground, at)[6:9, 6:9]


def _build_interference(problem: Problem, estimate: Estimate, change: Affine) -> Interference:
    """The change with what the sources add; beside a temperature these alone, ahead of it."""
    terms, second = estimate.terms, "second" in estimate.terms.sources
    values = _list_fields(Interference, change) | {
        "sources": terms.sources,
        "coefficients": build_sources(problem, estimate)[0],
        "second_sensor": problem.samples.second_sensor if second else None,
    }
    if not terms.degree:
        return Interference(**values | {"covariance": _find_covariance(problem, estimate)})
    alone = {n: getattr(_PLAIN, n) for n in ("bias", "matrix", "covariance", "validity")}
    return Interference(**values | alone | {"unit_out": change.unit_in})


def _build_thermal(problem: Problem, estimate: Estimate, change: Affine) -> Thermal:
    """The change as polynomials in temperature."""
    terms, layout, params = estimate.terms, estimate.layout, estimate.solution.params
    powers = params[layout.bias_columns(slice(terms.splines, terms.splines + terms.degree))].T
    matrix = np.zeros((terms.degree, 3, 3))
    if terms.matrix_degree:
        matrix = rotation_of(estimate).T @ layout.matrices(params)[: terms.degree]
        matrix = (matrix + np.swapaxes(matrix, 1, 2)) / 2
    values = _list_fields(Thermal, change) | {
        "bias": np.vstack([change.bias, powers * problem.magnitude]),
        "matrix": np.concatenate([change.matrix[None], matrix]),
        "centre_C": terms.centre_C,
        "half_range_C": terms.half_range_C,
        "covariance": _find_covariance(problem, estimate),
    }
    return Thermal(**values)


def _find_covariance(problem: Problem, estimate: Estimate) -> Array:
    """Covariance of bias and six entries by powers of temperature, each with its powers, nT; or,
    without powers, of what the sources add after these, row by row."""
    terms, layout, p = estimate.terms, estimate.layout, estimate.terms.degree + 1
    by_source = layout.bias_columns(slice(layout.bias_terms - len(terms.spread), None))
    onto = np.zeros((9 * p + (by_source.size if p == 1 else 0), layout.parameters))
    nine = _map_to_end(estimate)
    if len(nine) == 12:  # the turn that is left in a free matrix is small
        nine[6:9] = (nine[6:9] + nine[9:]) / 2
    nine[:3] *= problem.magnitude
    onto[: 9 * p : p] = nine[:9]
    for power in range(1, p):
        by_axis = layout.bias_columns(slice(terms.splines + power - 1, terms.splines + power))
        onto[range(power, 3 * p, p), by_axis[:, 0]] = problem.magnitude
        entries = layout.parameters + layout.matrix_terms * np.arange(-6, 0) + power - 1
        if terms.matrix_degree:
            onto[range(3 * p + power, 9 * p, p), entries] = 1.0
    if p == 1:
        sizes = np.tile(problem.magnitude / terms.spread, 3)
        onto[range(9, len(onto)), by_source.ravel()] = sizes
    return np.asarray(onto @ estimate.solution.covariance @ onto.T)


def _map_to_end(estimate: Estimate) -> Array:
    """From all parameters to bias and matrix at the end of the record and the middle temperature,
    (9 or 12, m)."""
    layout = estimate.layout
    onto = np.eye(layout.constants, layout.parameters)
    onto[range(3), layout.bias_columns(slice(None)).T] = estimate.terms.last[:, None]
    return onto


def _find_at_end(problem: Problem, estimate: Estimate) -> tuple[Array, Array]:
    """Bias, nT, and matrix at the end of the record, (9,) or (12,), and their covariance."""
    onto = _map_to_end(estimate)
    onto[:3] *= problem.magnitude
    return onto @ estimate.solution.params, onto @ estimate.solution.covariance @ onto.T


def _list_fields(kind: type, change: Affine) -> dict[str, Any]:
    """The fields of the change that another kind of calibration has too, by name."""
    theirs = {field.name for field in fields(kind)}
    return {f.name: getattr(change, f.name) for f in fields(change) if f.name in theirs}
