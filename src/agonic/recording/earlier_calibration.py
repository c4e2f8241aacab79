"""`judge`: a calibration that was made earlier, by what samples say of it now."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration, select_columns
from agonic.calibration.inputs import stack_inputs
from agonic.calibration.interference import Interference
from agonic.calibration.steps import compose, compute_composed_covariance
from agonic.ellipsoid import evaluate, open_ellipsoid_parts
from agonic.errors import AgonicError
from agonic.fit import Fit
from agonic.maths.equation.affine import FREE, model_basis
from agonic.recording.calibrated import Calibrated, conclude
from agonic.recording.choice.fits import Choice
from agonic.reference import Reference
from agonic.samples import Samples
from agonic.verification import verify


def judge(
    calibration: Calibration,
    samples: Samples,
    reference: Reference | None = None,
    **settings: Any,
) -> Calibrated:
    """A calibration made earlier, with the evidence and checks that these samples give.

    Parameters: settings as in `evaluate`; the steps of a chain are joined. Raises `AgonicError` for
    a calibration that is not affine or carries no covariance.
    """
    if isinstance(calibration, Alignment):
        raise AgonicError(
            "an alignment turns axes and changes no size, so a log cannot check it: report "
            "the chain of a calibration and this alignment, or look at its session (agonic fit)"
        )
    calibration = _join_steps(calibration)
    method = str(calibration.provenance.settings.get("fit", "ellipsoid"))
    settings["by_magnitude"] = method == "ellipsoid"
    fit = _evidence(calibration, samples, reference, settings)
    known = reference if calibration.unit_out == "nT" else None
    why = "the calibration was made before"
    given = Choice(samples, reference, fit, method, why, open_ellipsoid_parts)
    return conclude(given, verify(calibration, samples, known))


def _join_steps(calibration: Calibration) -> Affine:
    """A calibration in one step or in several, as one, with its covariance.

    Raises `AgonicError` where a step depends on temperature or is a network.
    """
    if isinstance(calibration, Affine):
        return calibration
    one, covariance = compose(calibration), compute_composed_covariance(calibration)
    if covariance is None:
        return one
    to_free = np.linalg.inv(model_basis("full", FREE))
    return replace(one, covariance=to_free @ covariance @ to_free.T)


def _evidence(
    calibration: Affine, samples: Samples, reference: Reference | None, settings: dict[str, Any]
) -> Fit:
    """What the samples say of a calibration; sources on board are taken at their mean."""
    if not isinstance(calibration, Interference):
        return evaluate(calibration, samples, reference, **settings)
    mean = stack_inputs(calibration.sources, None, select_columns(calibration, samples)).mean(
        axis=0
    )
    cleaned = calibration.cleaned(samples.field, **select_columns(calibration, samples))
    steady = samples.with_columns(field=cleaned + calibration.coefficients @ mean)
    fit = evaluate(calibration.at(mean), steady, reference, **settings)
    return replace(fit, calibration=calibration)
