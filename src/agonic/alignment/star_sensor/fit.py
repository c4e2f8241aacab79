"""`fit_alignment`: the rotation from a star sensor to a magnetometer, and its standard error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agonic.alignment.calibration import make_calibration, make_provenance
from agonic.alignment.maths.two_frames import GROUPS, Solution
from agonic.alignment.session.observed import observe, solve_session
from agonic.alignment.session.session import Session, check_session
from agonic.alignment.star_sensor.evidence import examine
from agonic.alignment.star_sensor.result import AlignmentFit
from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Validity
from agonic.calibration.chain import Chain
from agonic.errors import check_choice

METHOD = ("harbin-2018", "iers-2010")


def fit_alignment(
    session: Session,
    *,
    solve: Sequence[str] = ("alignment",),
    wanted_sd_arcsec: float = 2.0,
) -> AlignmentFit:
    """The rotation from the axes of a star sensor to those of a magnetometer on one platform.

    Of every orientation of the platform the residual

        W (raw − bias) − R_mc R_ci R_ie R_en H (B_ref + O)

    is made as small as its noise by Levenberg–Marquardt: R_ci is what the star sensor reads, R_ie
    the Earth's orientation (ERFA with the tables of the IERS), R_en the site, H the axes of the
    reference and O the difference of the field between the piers. R_mc, and what else is solved
    for, changes by small rotation vectors, so no angle is singular.

    Parameters
    ----------
    session : readings and site (`read_session`).
    solve : "alignment", and further "reference" (its axes), "pier" (O), "bias" and "matrix" (of the
        magnetometer, symmetric). What the session knows with a standard deviation joins by itself.
    wanted_sd_arcsec : above this the fit says which orientations to add.

    Returns an `AlignmentFit`; its findings say what is undetermined, and which usual mistake would
    explain a bad fit. Raises `AgonicError` for readings that cannot belong together, and
    `ValidityError` where the table of the Earth's rotation ends before the session.

    Source: patent CN 108871301 B, equations 1 to 11; IERS Conventions 2010, chapter 5.

    >>> from agonic.alignment.simulation.session import simulate_session
    >>> made = simulate_session(seed=1)
    >>> fit = fit_alignment(made.session)
    >>> fit.verdict, bool(fit.worst_sd_arcsec < 2.0)
    ('good', True)
    """
    for group in solve:
        check_choice("solve", group, tuple(GROUPS))
    asked = tuple(group for group in GROUPS if group in solve or group == "alignment")
    checked = check_session(session)
    observed = observe(checked)
    solution = solve_session(checked, observed, asked)
    fit = AlignmentFit(
        calibration=_calibration(checked, solution, asked),
        session=checked,
        observed=observed,
        solution=solution,
        solve=asked,
        wanted_sd_arcsec=wanted_sd_arcsec,
    )
    return examine(fit)


def _calibration(session: Session, solution: Solution, solve: tuple[str, ...]) -> Alignment | Chain:
    """From the magnetometer's readings to the field in the star sensor's axes."""
    star, samples, site = session.star, session.magnetometer, session.site
    arrays = {star.name: star.rot_ci.reshape(-1, 9)}
    arrays |= {one.name: one.field for one in session.instruments}
    settings = {
        "fit": "alignment",
        "solve": ", ".join(solve),
        "latitude_deg": site.latitude_deg,
        "longitude_deg": site.longitude_deg,
        "coordinates": site.coordinates,
        "date": session.date,
        "refraction": star.refraction,
        "aberration": star.aberration,
    }
    provenance = make_provenance(session.sources, arrays, settings, *METHOD)
    own, last = None, slice(GROUPS["bias"].start, None)
    if {"bias", "matrix"} & set(solve):
        own = Affine(
            bias=solution.unknowns.bias,
            matrix=solution.unknowns.matrix,
            covariance=solution.covariance[last, last],
            magnitude=solution.magnitude,
            noise=session.noise,
            sensor=samples.name,
            validity=Validity(largest_reading=float(np.abs(samples.field).max())),
            provenance=provenance,
        )
    return make_calibration(
        solution.unknowns.rot_mc,
        solution.covariance[:3, :3],
        samples,
        provenance,
        frame="c",
        before=session.calibration,
        own=own,
    )
