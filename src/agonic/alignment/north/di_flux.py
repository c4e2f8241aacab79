"""`fit_di_flux`: declination, inclination and the errors of a fluxgate theodolite from a sheet.

At the horizontal reading h and the zenith reading v the telescope points along t, with A = h − h₀
the azimuth from the magnetic meridian at h₀; q is square to it along the trunnion axis and p where
v goes on to:

    t = (sin v cos A, sin v sin A, −cos v)   q = (−sin A, cos A, 0)
    p = (cos v cos A, cos v sin A, sin v)

The fluxgate lies along t + δ q + ε p with small collimation errors δ and ε, and has an offset S₀;
in the field F (cos I, 0, sin I) it reads

    S = F [cos I (sin v cos A − δ sin A + ε cos v cos A) + sin I (ε sin v − cos v)] + S₀.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, NamedTuple

import numpy as np

from agonic.alignment.maths.columns import average, find_rows
from agonic.alignment.maths.north import Pointing, average_faces
from agonic.alignment.session.laboratory import DiSheet
from agonic.arrays import Array, Mask
from agonic.errors import CoverageError
from agonic.health import Finding, Judged, figure
from agonic.health.finding import Fact, Limit, Told, find_facts
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.noise.student import compute_widening
from agonic.maths.rotations.angles import wrap_deg
from agonic.maths.rotations.frames import ARCSEC_RAD
from agonic.readable import Shown

NAMES = ("meridian", "inclination", "delta", "epsilon", "offset", "scale")
"""Unknowns: h₀, I, δ, ε in radians, S₀/F, and F in the unit of the readings."""
LEAST_RAD = ARCSEC_RAD
"""What a circle is read to: few residuals may be smaller by chance."""
LEVEL_SIN = 0.99999  # the telescope is level to 0.26°: a setting for the declination
METHOD = ("brunke-matzka-2018",)


class Settings(NamedTuple):
    """Readings of both circles, (n,) radians, and of the fluxgate, (n,). Where `from_meridian` is
    set the horizontal reading counts from the magnetic meridian itself."""

    horizontal: Array
    zenith: Array
    reading: Array
    from_meridian: Mask


class SheetEstimate(NamedTuple):
    """The unknowns (6,) with covariance, residuals (n,) in the unit of the readings, freedom."""

    params: Array
    covariance: Array
    residuals: Array
    freedom: int
    noise: float


@dataclass(frozen=True, kw_only=True, eq=False)
class DiFluxFit(Judged):
    """The result of `fit_di_flux`: angles in degrees, standard errors in arcseconds.

    Parameters
    ----------
    estimate : the unknowns: meridian, inclination, collimation δ and ε, offset, scale. mark : the
        direction to the azimuth mark on the circle and the telescope's own collimation.
    scaled : whether sheet or caller say how many units of the fluxgate an angle is.
    meridian_deg : the circle's reading in the magnetic meridian, looking north.
    declination_deg : east positive, within ±90°: the sheet does not say which face the mark was
        read in first; `None` where the azimuth of the mark is not known. Its standard error has the
        meridian's and, where its readings show one, the mark's.
    inclination_deg : down positive.
    collimation_arcsec : (2,) δ, to the right of the telescope, and ε, to greater zenith angles, of
        the fluxgate. offset_arcsec : S₀/F as an angle, and its standard error.
    offset, scale : S₀ and F in the unit of the fluxgate's readings.
    noise_arcsec : what is left of a setting, as an angle of the field.
    """

    sheet: DiSheet
    estimate: SheetEstimate
    mark: Pointing
    scaled: bool
    meridian_deg: Annotated[float, Shown()]
    meridian_sd_arcsec: Annotated[float, Shown()]
    declination_deg: Annotated[float | None, Shown()]
    declination_sd_arcsec: Annotated[float, Shown()]
    inclination_deg: Annotated[float, Shown()]
    inclination_sd_arcsec: Annotated[float, Shown()]
    collimation_arcsec: tuple[float, float]
    collimation_sd_arcsec: tuple[float, float]
    offset_arcsec: tuple[float, float]
    offset: Annotated[float, Shown()]
    offset_sd: Annotated[float, Shown()]
    scale: Annotated[float, Shown()]
    noise_arcsec: Annotated[float, Shown()]
    findings: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def n(self) -> Annotated[int, Shown()]:
        """How many settings of the circles."""
        return len(self.estimate.residuals)


def fit_di_flux(sheet: DiSheet, *, magnitude: float | None = None) -> DiFluxFit:
    """Declination and inclination of a DI-flux sheet, with the errors of the instrument.

    The fluxgate on the telescope, off by small angles δ and ε and with an offset S₀, reads

        S = F [cos I (sin v cos A − δ sin A + ε cos v cos A) + sin I (ε sin v − cos v)] + S₀

    at azimuth A from the magnetic meridian and zenith reading v. Every setting of the circles is
    one equation, whatever the scheme; the usual eight leave three for the noise.

    Parameters
    ----------
    sheet : readings (`read_di_flux`). magnitude : F, nT, where the sheet does not say.

    Returns a `DiFluxFit`. Raises `CoverageError` where the settings leave something open.

    Source: H.-P. Brunke, J. Matzka, Geoscientific Instrumentation, Methods and Data Systems 7,
    2018.

    >>> from agonic.alignment.simulation.laboratory import simulate_di_flux
    >>> made = simulate_di_flux(seed=1)
    >>> fit = fit_di_flux(made.sheet)
    >>> bool(abs(fit.inclination_deg - made.inclination_deg) < 5 / 3600)
    True
    """
    # a large reading shows how many units of the fluxgate an angle is
    measured = bool(np.abs(sheet.reading).max() > 30.0)
    found, at = estimate_sheet(sheet, magnitude, measured)
    scaled = measured or magnitude is not None or sheet.magnitude is not None
    mark = _mark(sheet)
    values = _derive(sheet, found, mark)
    fit = DiFluxFit(sheet=sheet, estimate=found, mark=mark, scaled=scaled, **values)
    inclined = (
        f"inclination {fit.inclination_deg:.4f}° ± {figure(fit.inclination_sd_arcsec)}″, "
        f"{fit.n} settings, {fit.estimate.freedom} degrees of freedom"
    )
    remarks: tuple[str, ...] = (inclined,)
    if (turned := fit.declination_deg) is not None:
        declined = f"declination {turned:.4f}° ± {figure(fit.declination_sd_arcsec)}″"
        remarks = (declined, inclined)
    return replace(
        fit, findings=tuple(find_facts(FACTS, fit, at)), remarks=(*remarks, *sheet.notes)
    )


def _derive(sheet: DiSheet, found: SheetEstimate, mark: Pointing) -> dict[str, Any]:
    """What the unknowns mean: angles, offset and scale, with their standard errors."""
    values = dict(zip(NAMES, found.params.tolist(), strict=True))
    sd = dict(zip(NAMES, (np.sqrt(np.diag(found.covariance)) / ARCSEC_RAD).tolist(), strict=True))
    meridian, scale = np.degrees(values["meridian"]) % 360, values["scale"]
    azimuth = sheet.mark_azimuth_deg
    turned = None
    if azimuth is not None:
        turned = float(wrap_deg(2 * (meridian + azimuth - mark.reading_deg)) / 2)
    of_mark = 3600.0 * mark.sd_deg if np.isfinite(mark.sd_deg) else 0.0
    return {
        "meridian_deg": float(meridian),
        "meridian_sd_arcsec": sd["meridian"],
        "declination_deg": turned,
        "declination_sd_arcsec": float(np.hypot(sd["meridian"], of_mark)),
        "inclination_deg": float(np.degrees(values["inclination"])),
        "inclination_sd_arcsec": sd["inclination"],
        "collimation_arcsec": (values["delta"] / ARCSEC_RAD, values["epsilon"] / ARCSEC_RAD),
        "collimation_sd_arcsec": (sd["delta"], sd["epsilon"]),
        "offset_arcsec": (values["offset"] / ARCSEC_RAD, sd["offset"]),
        "offset": values["offset"] * scale,
        "offset_sd": sd["offset"] * ARCSEC_RAD * scale,
        "scale": scale,
        "noise_arcsec": abs(found.noise / scale) / ARCSEC_RAD,
    }


def _mark(sheet: DiSheet) -> Pointing:
    """The mark's direction; readings taken one after the other in one face count once."""
    marks = sheet.mark_deg
    faces = np.abs(wrap_deg(marks - marks[0])) > 90.0
    runs = np.concatenate([[0], np.cumsum(np.diff(faces.astype(int)) != 0)])
    each = [marks[runs == run] for run in range(int(runs[-1]) + 1)]
    read = average_faces(np.array([a[0] + wrap_deg(a - a[0]).mean() for a in each]))
    if not read.sd_deg > 1e-7:  # it was read once, and copied
        return read._replace(sd_deg=float("nan"))
    return read._replace(sd_deg=max(read.sd_deg, np.degrees(LEAST_RAD) / np.sqrt(len(each))))


def _find_off_meridian(fit: DiFluxFit, at: Settings) -> Told:
    sides = at.horizontal[~at.from_meridian & (np.abs(np.sin(at.zenith)) <= LEVEL_SIN)]
    off = np.abs(wrap_deg(2 * (np.degrees(sides) - fit.meridian_deg)) / 2)
    return float(off.max(initial=0.0))


FACTS = (
    Fact(
        "no mark",
        lambda fit, at: {} if fit.sheet.mark_azimuth_deg is None else None,
        "note",
        "the sheet has no azimuth of the mark, so the declination is not determined",
        "give Abs-AzimuthMark",
    ),
    Fact(
        "mark read once",
        lambda fit, at: (
            None if np.isfinite(fit.mark.sd_deg) or fit.sheet.mark_azimuth_deg is None else {}
        ),
        "note",
        "all readings of the mark are equal, so their error is not known and not included in that "
        "of the declination",
        "read it in both faces before and after",
    ),
    Fact(
        "off the meridian",
        _find_off_meridian,
        Limit(note=0.1),  # degrees
        "the inclination was taken {value}° off the magnetic meridian; this is corrected",
        "check the circle's readings there",
    ),
    Fact(
        "no scale",
        lambda fit, at: {} if not fit.scaled and np.abs(fit.sheet.reading).max() > 0 else None,
        "check",
        "neither the total field nor a reading of known tilt gives the scale of the fluxgate",
        "give --field",
    ),
    Fact(
        "reads backwards",
        # the field turned round with a fluxgate turned round reads the same at all settings
        lambda fit, at: {} if fit.scale <= 0 else None,
        "check",
        "the fluxgate reads less where the field along it is larger: its sign is reversed, or the "
        "first setting of the inclination does not look north and the field dips the other way",
        "look for settings that were exchanged",
    ),
    Fact(
        "settings disagree",
        lambda fit, at: fit.noise_arcsec,
        Limit(check=10.0),  # arcseconds
        "the settings disagree by {value}″ of the field's direction",
        "look for a misread circle, iron on the observer or a disturbed field",
    ),
    Fact(
        "collimation",
        lambda fit, at: max(np.abs(fit.collimation_arcsec)) / 3600.0,
        Limit(check=1.0),  # degrees
        "the fluxgate is {value}° from the telescope",
        "adjust it; errors of second order are not small",
    ),
)
"""What is said of a sheet, in the order of its parts: mark, meridian, scale, scatter."""


def predict(params: Array, at: Settings) -> tuple[Array, Array]:
    """What the fluxgate reads, (n,), and the Jacobian (n, 6)."""
    meridian, inclination, delta, epsilon, offset, scale = params
    azimuth = at.horizontal - np.where(at.from_meridian, 0.0, meridian)
    ca, sa = np.cos(azimuth), np.sin(azimuth)
    cv, sv = np.cos(at.zenith), np.sin(at.zenith)
    ci, si = np.cos(inclination), np.sin(inclination)
    level, upright = sv * ca - delta * sa + epsilon * cv * ca, epsilon * sv - cv
    sighted = ci * level + si * upright + offset
    by_azimuth = ci * (-sv * sa - delta * ca - epsilon * cv * sa)
    jacobian = scale * np.stack(
        [
            np.where(at.from_meridian, 0.0, -by_azimuth),
            ci * upright - si * level,
            -ci * sa,
            ci * cv * ca + si * sv,
            np.ones_like(sa),
            sighted / scale,
        ],
        axis=1,
    )
    return scale * sighted, jacobian


def estimate_sheet(
    sheet: DiSheet, magnitude: float | None, measured: bool
) -> tuple[SheetEstimate, Settings]:
    """The unknowns from either end of the meridian that may be north: the one that fits better. Two
    level settings half a turn apart look alike; with δ, ε and the offset in both kinds of settings
    only the right end fits."""
    flat = level(sheet)
    settings = [len(np.unique(sheet.setting[rows])) for rows in (flat, ~flat)]
    if settings[0] < 4 or settings[1] < 3:
        raise CoverageError(
            f"{settings[0]} settings with the telescope level and {settings[1]} others were given",
            undetermined="meridian, inclination and collimation together",
            turns="take four of each: east and west, north and south, sensor up and down",
        )
    scale = magnitude or sheet.magnitude or 50_000.0
    tried = []
    for meridian in _ends(sheet):
        at = _settings(sheet, meridian)
        azimuth = at.horizontal - np.where(at.from_meridian, 0.0, meridian)
        inclination = np.arctan(np.tan(at.zenith[~flat]) * np.cos(azimuth[~flat]))
        start = np.array([meridian, float(np.median(inclination)), 0.0, 0.0, 0.0, scale])
        tried.append((_solve(sheet, at, start, scale_known=not measured), at))
    return min(tried, key=lambda both: abs(both[0].noise / both[0].params[-1]))


def _settings(sheet: DiSheet, meridian: float) -> Settings:
    """What the kernel needs. Of the settings by name the first looks north; in the others the
    zenith reading shows which way, since tan I = tan v cos A has one sign."""
    h, v = np.radians(sheet.horizontal_deg), np.radians(sheet.zenith_deg)
    nominal = _nominal(sheet, meridian)
    if nominal.any():
        sign = np.sign(np.tan(v))
        first = int(np.flatnonzero(nominal)[0])
        h = np.where(nominal, np.where(sign == sign[first], 0.0, np.pi), h)
    return Settings(h, v, sheet.reading, nominal)


def _ends(sheet: DiSheet) -> list[float]:
    """The circle's readings, rad, that may be magnetic north: square to the level settings. Where
    the inclination's settings have readings of the circle the first looks north."""
    flat = level(sheet)
    doubled = np.exp(2j * np.radians(sheet.horizontal_deg[flat])).mean()
    meridian = float(np.angle(doubled) / 2 - np.pi / 2)
    both = [meridian, meridian + np.pi]
    if _nominal(sheet, meridian).any():
        return both
    first = np.radians(sheet.horizontal_deg[~flat][0])
    return [max(both, key=lambda end: float(np.cos(first - end)))]


def _nominal(sheet: DiSheet, meridian: float) -> Mask:
    """Settings whose horizontal reading is 0 or half a turn by name only, from the meridian."""
    off = wrap_deg(2 * (sheet.horizontal_deg - np.degrees(meridian))) / 2
    round_number = np.abs(wrap_deg(2 * sheet.horizontal_deg) / 2) < 0.01
    return ~level(sheet) & round_number & (np.abs(off) > 3.0)


def level(sheet: DiSheet) -> Mask:
    """The settings with the telescope level, for the declination."""
    return np.abs(np.sin(np.radians(sheet.zenith_deg))) > LEVEL_SIN


def _solve(sheet: DiSheet, at: Settings, start: Array, *, scale_known: bool) -> SheetEstimate:
    """The unknowns of settings that repeat, by least squares. Readings of one setting
    share what the circle was set wrong by, so the noise follows from the means of the groups: their
    misfit over the settings less the unknowns, 1″ at least. The covariance is widened by Student's
    t: the usual eight settings leave three for the noise."""
    free = np.ones(len(NAMES), dtype=bool)
    free[-1] = not scale_known
    unit = start[-1]

    def pieces(step: Array) -> list[tuple[Array, Array]]:
        params = start.copy()
        params[free] += step
        values, jacobian = predict(params, mean)
        return [((values - mean.reading) / unit, jacobian[:, free] / unit)]

    # circles and fluxgate move by so little within a setting that means are exact
    rows = find_rows(sheet.setting, np.unique(sheet.setting))
    horizontal, zenith, reading = (average(column, rows) for column in at[:3])
    mean = Settings(horizontal, zenith, reading, at.from_meridian[[own[0] for own in rows]])
    solution = leastsq.solve(pieces, np.zeros(int(free.sum())), scale=LEAST_RAD, tolerance=1e-8)
    params = start.copy()
    params[free] += solution.params
    left = solution.residuals
    freedom = len(left) - int(free.sum())
    noise = float(np.sqrt(left @ left / freedom)) if freedom > 0 else float("nan")
    covariance = np.zeros((len(NAMES), len(NAMES)))
    wide = (max(noise / LEAST_RAD, 1.0) * compute_widening(freedom)) ** 2
    covariance[np.ix_(free, free)] = wide * leastsq.inverse(solution.information)
    return SheetEstimate(params, covariance, left * unit, freedom, noise * unit)
