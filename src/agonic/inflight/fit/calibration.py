"""The estimate back in nT: what changed in flight, and ground and change in one or as a chain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.calibration.affine import PARAMETERS, Affine
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
    gauge = estimate.layout.gauge
    at_end = _at_end(estimate)
    size = _sizes(problem, estimate)
    covariance = at_end @ estimate.solution.covariance @ at_end.T * np.outer(size, size)
    bias, matrix = split(model_basis("full", gauge) @ (at_end @ estimate.solution.params))
    if gauge == FREE:
        _, rest = split_rotation(matrix, covariance, FREE)
        matrix, covariance = rest.rotation.T @ matrix, rest.covariance[:9, :9]
    ground = problem.ground
    frame = samples.frame if ground is None else ground.frame_out
    return Affine(
        bias=bias * problem.magnitude,
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
        provenance=Provenance(
            inputs=(samples.origin,), settings=_settings(problem, estimate), method=METHOD
        ),
    )


def build_alignment(problem: Problem, estimate: Estimate, change: Affine) -> Alignment | None:
    """From sensor axes to those of the attitude; None without attitude."""
    if problem.direction is None:
        return None
    at_end = _at_end(estimate)
    _, matrix = split(model_basis("full", FREE) @ (at_end @ estimate.solution.params))
    covariance = at_end @ estimate.solution.covariance @ at_end.T
    _, rest = split_rotation(matrix, covariance, estimate.layout.gauge)
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
    c, k, s = estimate.layout.constants, estimate.layout.bias_terms, terms.splines
    own = np.r_[0:3, [c + axis * k + j for axis in range(3) for j in range(s)]].astype(np.intp)
    return Drift(
        knots=terms.knots,
        middle=terms.middle,
        constant=params[:3] * magnitude,
        coefficients=estimate.layout.biases(params)[:, :s] * magnitude,
        covariance=estimate.solution.covariance[np.ix_(own, own)] * magnitude**2,
        start=terms.start,
        stop=terms.stop,
    )


def build_sources(problem: Problem, estimate: Estimate) -> tuple[Array, Array]:
    """What a unit of each source adds to a reading (3, k), nT, and its standard error."""
    layout, terms = estimate.layout, estimate.terms
    first, size = terms.splines + terms.degree, problem.magnitude / terms.spread
    sd = np.sqrt(np.maximum(np.diag(estimate.solution.covariance), 0.0))
    return (
        layout.biases(estimate.solution.params)[:, first:] * size,
        layout.biases(sd)[:, first:] * size,
    )


def build_calibration(
    problem: Problem, estimate: Estimate, change: Affine, samples: Samples
) -> Affine | Thermal | Chain:
    """Ground and change multiplied out where both are affine, else as a chain."""
    terms, ground = estimate.terms, problem.ground
    steps: list[Any] = []
    last: Affine | Thermal = change
    if terms.degree:
        steps = [_interference(problem, estimate, change, alone=True)] if terms.sources else []
        last = _thermal(problem, estimate, change)
    elif terms.sources:
        last = _interference(problem, estimate, change)
    elif ground is not None and type(ground) is not Affine:  # its rotation the flight does not tell
        plain = Affine(bias=np.zeros(3), matrix=np.eye(3))
        plain = replace(plain, unit_in=change.unit_in, frame_in=change.frame_in)
        last = join_affine(plain, change, samples, find_rotation_covariance(problem, estimate))
    if ground is None and not steps:
        return last
    if type(ground) is Affine and type(last) is Affine:
        return join_affine(ground, last, samples, find_rotation_covariance(problem, estimate))
    if isinstance(ground, Chain):
        steps = [*ground.steps, *steps]
    elif ground is not None:
        steps = [ground, *steps]
    return Chain(steps=(*steps, last), provenance=change.provenance)


def join_affine(
    ground: Affine, change: Affine, samples: Samples, rotation_covariance: Array
) -> Affine:
    """Ground and change as one affine calibration; `rotation_covariance` (3, 3), rad², is what the
    ground leaves open of the rotation, which the flight does not tell."""
    return replace(
        change,
        bias=ground.bias + np.linalg.solve(ground.matrix, change.bias),
        matrix=change.matrix @ ground.matrix,
        gauge="free",
        covariance=_join_covariance(ground, change, rotation_covariance),
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


def _join_covariance(ground: Affine, change: Affine, rotation_covariance: Array) -> Array:
    """Covariance (12, 12) of bias and matrix of the two in one.

        matrix = (1 + Ω) M W,   bias = b + W⁻¹ c

    The flight knows bias and gains of the present, with the ground's covariance of W as its prior,
    so that the change is all that is uncertain, but for the rotation Ω.
    """
    local = np.zeros((12, 12))
    local[:3, :3] = np.linalg.inv(ground.matrix)
    local[3:, 3:] = np.kron(np.eye(3), ground.matrix.T)
    assert change.covariance is not None
    free = np.linalg.pinv(model_basis("full", "free"))
    onto = free @ local @ model_basis("full")
    turned = skew(np.eye(3)) @ change.matrix @ ground.matrix
    turn = free[:, 3:] @ turned.reshape(3, 9).T
    return np.asarray(onto @ change.covariance @ onto.T + turn @ rotation_covariance @ turn.T)


def _interference(
    problem: Problem, estimate: Estimate, change: Affine, *, alone: bool = False
) -> Interference:
    """The change with what the sources add; or the sources `alone`, ahead of the change."""
    values = _fields_for(Interference, change) | {
        "sources": estimate.terms.sources,
        "coefficients": build_sources(problem, estimate)[0],
        "second_sensor": problem.samples.second_sensor
        if "second" in estimate.terms.sources
        else None,
    }
    if not alone:
        return Interference(**{**values, "covariance": _with_sources(problem, estimate)})
    plain = Affine(bias=np.zeros(3), matrix=np.eye(3))
    values |= {name: getattr(plain, name) for name in ("bias", "matrix", "covariance", "validity")}
    return Interference(**{**values, "unit_out": change.unit_in})


def _with_sources(problem: Problem, estimate: Estimate) -> Array:
    """Covariance of `Interference.parameters`: nine, then what the sources add, row by row."""
    terms, layout = estimate.terms, estimate.layout
    k, c, kb = len(terms.spread), layout.constants, layout.bias_terms
    own = np.arange(k)
    onto = np.zeros((9 + 3 * k, layout.parameters))
    onto[:9] = _nine(problem, estimate)
    for axis in range(3):
        columns = c + axis * kb + terms.bias_count - k + own
        onto[9 + axis * k + own, columns] = problem.magnitude / terms.spread
    return np.asarray(onto @ estimate.solution.covariance @ onto.T)


def _thermal(problem: Problem, estimate: Estimate, change: Affine) -> Thermal:
    """The change as polynomials in temperature."""
    terms, layout, params = estimate.terms, estimate.layout, estimate.solution.params
    p = terms.degree + 1
    powers = layout.biases(params)[:, terms.splines : terms.splines + terms.degree].T
    matrix = np.zeros((p, 3, 3))
    matrix[0] = change.matrix
    if terms.matrix_degree:
        matrix[1:] = rotation_of(estimate).T @ layout.matrices(params)[: terms.degree]
        matrix = (matrix + np.swapaxes(matrix, 1, 2)) / 2
    onto = _by_power(problem, estimate)
    values = _fields_for(Thermal, change) | {
        "bias": np.vstack([change.bias, powers * problem.magnitude]),
        "matrix": matrix,
        "centre_C": terms.centre_C,
        "half_range_C": terms.half_range_C,
        "covariance": onto @ estimate.solution.covariance @ onto.T,
    }
    return Thermal(**values)


def _by_power(problem: Problem, estimate: Estimate) -> Array:
    """From all parameters to those of a `Thermal`, (9 p, m)."""
    terms, layout, p = estimate.terms, estimate.layout, estimate.terms.degree + 1
    c, kb, km = layout.constants, layout.bias_terms, layout.matrix_terms
    onto = np.zeros((len(PARAMETERS) * p, layout.parameters))
    onto[::p] = _nine(problem, estimate)
    for power in range(1, p):
        for axis in range(3):
            onto[axis * p + power, c + axis * kb + terms.splines + power - 1] = problem.magnitude
        for entry in range(6 if terms.matrix_degree else 0):
            onto[(3 + entry) * p + power, c + 3 * kb + entry * km + power - 1] = 1.0
    return onto


def _at_end(estimate: Estimate) -> Array:
    """From all parameters to bias and matrix at the end of the record and the middle temperature,
    (9 or 12, m)."""
    layout = estimate.layout
    c, k = layout.constants, layout.bias_terms
    onto = np.zeros((c, layout.parameters))
    onto[:, :c] = np.eye(c)
    onto[:3, c : c + 3 * k] = np.kron(np.eye(3), estimate.terms.last)
    return onto


def _sizes(problem: Problem, estimate: Estimate) -> Array:
    """What bias and matrix are to be multiplied by, (9,) or (12,)."""
    ones = np.ones(estimate.layout.constants - 3)
    return np.concatenate([np.full(3, problem.magnitude), ones])


def _nine(problem: Problem, estimate: Estimate) -> Array:
    """From all parameters to the nine of the change, nT, (9, m); the rotation is small."""
    onto = _at_end(estimate) * _sizes(problem, estimate)[:, None]
    if len(onto) == 9:
        return onto
    six = np.eye(9, 12)
    for k in range(3):
        six[6 + k, [6 + k, 9 + k]] = 0.5
    return np.asarray(six @ onto)


def _fields_for(kind: type, change: Affine) -> dict[str, Any]:
    """The fields of the change that another kind of calibration has too, by name."""
    theirs = {field.name for field in fields(kind)}
    return {f.name: getattr(change, f.name) for f in fields(change) if f.name in theirs}


def _settings(problem: Problem, estimate: Estimate) -> Mapping[str, Any]:
    """What was chosen, for the provenance."""
    asked, terms = problem.settings, estimate.terms
    return {
        "fit": "inflight",
        "reference": problem.source,
        "solve": asked.solve,
        "drift_intervals": max(terms.splines - 2, 0),
        "temperature_degree": asked.temperature_degree,
        "matrix_rate": terms.rate,
        "sources": list(terms.sources),
        "attitude": asked.attitude,
        "gain_sd": asked.gain_sd,
        "soft_iron_sd": asked.soft_iron_sd,
        "robust": asked.robust,
        "ground": None if problem.ground is None else problem.ground.kind,
        "excluded": int((~problem.used).sum()),
    }
