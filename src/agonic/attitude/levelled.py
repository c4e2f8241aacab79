"""`fit_levelled`: for vehicles that cannot tumble, from roll, pitch and the field of the place;
`fit_vector`: where the whole attitude is known, heading included."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from agonic.attitude.fit import CHANNELS, fit_channels
from agonic.attitude.problem import Gauge, Model, Settings
from agonic.fit import Fit
from agonic.logs.any_form import Given, as_samples
from agonic.reference import Reference


def fit_vector(
    samples: Given,
    reference: Reference | ArrayLike | None,
    *,
    model: Model = "full",
    gauge: Gauge = "auto",
    sources: Sequence[str] = (),
    robust: bool = True,
    soft_iron_sd: float | None = 0.1,
    turn_sd_deg: float | None = 2.0,
    inclination_deg: float | None = None,
    seed: int = 0,
) -> Fit:
    """Bias and matrix that turn every reading into the field of the place in body axes.

    Beside magnitude and dip as in `fit_levelled`, the azimuth, with e horizontal, in body axes by
    the known attitude, and square to the field:

        u·e = 0

    Each kind of residual is weighted by its
    own scatter, so a heading of poor quality does no harm to what roll and pitch determine.

    Parameters
    ----------
    samples : with `roll_deg`, `pitch_deg` and `heading_deg`; the heading must not come from the
        magnetometer itself.
    reference : (n, 3) or constant, `Reference.vector` in the frame n.

    model, gauge, sources, robust, soft_iron_sd, turn_sd_deg, inclination_deg, seed : as in
        `fit_levelled`; the matrix is free by default.

    Returns a `Fit`. Raises as `fit_levelled`.

    Source: maximum likelihood with Huber's sandwich covariance (Huber 1981).

    Examples
    --------
    >>> from agonic.simulation import simulate
    >>> flown = simulate("flight", n=2000, stray_nT_A=(0.0, 0.0, 0.0))
    >>> fit = fit_vector(flown.samples, Reference.vector(flown.field_n, frame="n"))
    >>> bool((abs(fit.calibration.bias - flown.truth.bias) < 4 * fit.sd[:3]).all())
    True
    """
    samples, reference = as_samples(samples), Reference.required(reference)
    chosen = Settings(
        model=model,
        gauge=gauge,
        sources=tuple(sources),
        robust=robust,
        soft_iron_sd=soft_iron_sd,
        turn_sd_deg=turn_sd_deg,
        inclination_deg=inclination_deg,
        seed=seed,
    )
    return fit_channels(samples, reference, CHANNELS["vector"], chosen, "vector")


def fit_levelled(
    samples: Given,
    reference: Reference | ArrayLike | None,
    *,
    model: Model = "full",
    gauge: Gauge = "auto",
    sources: Sequence[str] = (),
    robust: bool = True,
    soft_iron_sd: float | None = 0.1,
    turn_sd_deg: float | None = 2.0,
    inclination_deg: float | None = None,
    seed: int = 0,
) -> Fit:
    """Bias and matrix that give every reading the magnitude and the dip of the place.

    With d the direction of down by roll and pitch, u = W (raw − bias), z = u·d, h = |u − z d|:

        √(z² + h²) = F,   H z − Z h = 0,   F² = H² + Z²,

    both as distances in raw space, each weighted by the scatter of its own residuals. This is the
    pair z = Z, h = H, turned so that errors of roll and pitch stay in one of the two. The heading
    never enters, so it may be wrong or missing.

    Parameters
    ----------
    samples : with `roll_deg` and `pitch_deg`.
    reference : (n, 2) or constant, `Reference.horizontal_vertical`: the horizontal and vertical
        intensity; or a vector (n, 3) in the frame n as `ag.wmm().along(samples)` gives it.
    model : "full" (default), "diagonal" or "sphere".
    gauge : "symmetric" (nine numbers), "free" (twelve: a small turn between the sensor and the
        axes of roll and pitch as well), or "auto": free.
    sources : what disturbs on board, recorded in the samples: "current_A", "throttle", "second"
        (a second magnetometer); the result is then an `Interference`.
    robust : down-weight outliers by Tukey's loss when a reading stands out.
    soft_iron_sd : standard deviation of the prior on the symmetric part of W/gain − identity.
    turn_sd_deg : that of the prior on the turn, about each axis.
    inclination_deg : dip at which the heading's standard error is stated; default: the place's.
    seed : of the search for where to start.

    Returns a `Fit`. Raises `LogError` without roll and pitch, `UnitError` for a reference that is a
    magnitude only, and `CoverageError` where nothing can be fitted at all.

    Source: maximum likelihood with Huber's sandwich covariance (Huber 1981).

    Examples
    --------
    >>> from agonic.simulation import simulate
    >>> flown = simulate("flight", n=4000, noise=20.0, stray_nT_A=(0.0, 0.0, 0.0))
    >>> place = Reference.horizontal_vertical(25_000.0, 43_301.27)
    >>> fit = fit_levelled(flown.samples, place)
    >>> bool((abs(fit.calibration.bias - flown.truth.bias) < 4 * fit.sd[:3]).all())
    True
    """
    samples, reference = as_samples(samples), Reference.required(reference)
    chosen = Settings(
        model=model,
        gauge=gauge,
        sources=tuple(sources),
        robust=robust,
        soft_iron_sd=soft_iron_sd,
        turn_sd_deg=turn_sd_deg,
        inclination_deg=inclination_deg,
        seed=seed,
    )
    return fit_channels(samples, reference, CHANNELS["levelled"], chosen, "levelled")
