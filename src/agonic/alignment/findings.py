"""What the fits of this wing say of their readings: every finding in one table."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from agonic.health import Finding
from agonic.health.finding import Severity, word_finding
from agonic.report.digits import significant


class Words(NamedTuple):
    """A finding's message and what to do, values in braces; how severe it is, or can be; and the
    size above which it is said, where that is a number of its own."""

    message: str
    action: str = ""
    severities: tuple[Severity, ...] = ("check",)
    limit: float = float("inf")


NOTE: tuple[Severity, ...] = ("note",)
REFUSED: tuple[Severity, ...] = ("refuse",)
WORSE: tuple[Severity, ...] = ("check", "refuse")

FINDINGS: Mapping[str, Words] = {
    # star sensor
    "alignment undetermined": Words("{what}", "{action}", REFUSED),
    "unknowns undetermined": Words("{what}; the alignment itself is determined", "{action}"),
    "no redundancy": Words(
        "orientations just enough for the unknowns: a mistake would not be noticed",
        "add orientations",
    ),
    "session mistake": Words("{what}", "{action}", REFUSED),
    "session misfit": Words("{what}", "{action}"),
    "nominal mounting": Words(
        "{what}",
        "check the nominal angles and the axes",
        limit=4.0,  # standard deviations of it
    ),
    "alignment loose": Words(
        "the alignment is known to {sd}″ about its worst axis, not to {wanted:g}″", "{action}"
    ),
    "reference unchecked": Words(
        "these orientations do not show whether the reference's axes and the clocks are right: "
        "were they off by {by:g}″ (0.7 s of a clock), the alignment would be off by up to {off}″, "
        "and no residual would show it",
        "{action}; or state how well north and the clocks are known (axes_sd_arcsec of the "
        "reference; a second is 15″)",
        limit=1.5,  # times the stated or the wanted standard error
    ),
    "below the horizon": Words(
        "the star sensor looks below the horizon in {low} of {n} orientations",
        "check longitude, time scale and the sense of the attitudes",
        limit=0.0,
    ),
    "attitude scatter": Words(
        "within the orientations the attitudes scatter {ratio} times as much {which} the boresight "
        "as stated",
        "let the platform settle, check the numbers of the orientations, or state a larger sd",
        limit=1.3,  # times what is stated
    ),
    "geodetic coordinates": Words(
        "the site's coordinates are geodetic: north and down may be off by up to 20″, the "
        "deflection of the vertical",
        "give astronomical coordinates{otherwise}",
    ),
    "predicted earth rotation": Words(
        "the Earth's rotation on {date} is predicted, not measured, by the installed table, which "
        "may be off by {sd}″",
        "{action}",
        NOTE,
    ),
    "near-zero beta": Words(
        "the third axes of star sensor and magnetometer are nearly parallel, so only the {known} "
        "of α and γ is determined; quaternion and matrix are good",
        severities=NOTE,
    ),
    # gyrotheodolite
    "methods disagree": Words(
        "{one} and {other} differ by {by}″",
        "check that all were read on one circle, east increasing, and that amplitudes and times "
        "belong together",
        limit=4.0,  # standard errors
    ),
    "short swing": Words(
        "the record holds {periods} periods of the swing", "follow the gyro for two periods or more"
    ),
    "zero drifts": Words(
        "the middle of the swing moves by {by}″ over the record, so north is known to half of that "
        "at best",
        "let the gyro warm up, keep it out of sun and wind, and follow it again",
        limit=3.0,  # standard errors
    ),
    "readings scatter": Words(
        "the readings of {name} scatter by {excess} times the stated noise; the standard error was "
        "widened",
        "look for a misread circle or a zero that drifts, and read again",
        limit=1.0,  # times the stated noise, which chance does not exceed
    ),
    "no spread": Words(
        "the standard error of north is not determined",
        "read more turning points, or state reading_sd_arcsec or time_sd_s",
    ),
    "faces": Words(
        "the two faces to {name} differ by {by}″ and half a turn",
        "check the readings, and adjust the theodolite",
        limit=120.0,  # arcseconds
    ),
    "orientations": Words(
        "one orientation does not determine the rotation about the field",
        "turn the platform to at least two others",
        REFUSED,
    ),
    "platform misfit": Words("{what}", "{action}"),
    "platform settles": Words(
        "the magnetometer turned by {by}″ while an orientation was recorded; circle and levels "
        "were read at one moment of it, and the standard error was enlarged by the same amount",
        "wait after each turn until the readings rest, and clamp the platform",
    ),
    # coil
    "one polarity": Words(
        "the current never changes its sign, so its steady errors do not cancel",
        "reverse it",
    ),
    "no reference": Words(
        "the drift of the ambient field is only estimated, by a smooth curve",
        "record a reference beside it",
        NOTE,
    ),
    "no inertial axis": Words(
        "the readings have no date for which the Earth's rotation is known, so there is no "
        "inertial axis",
        "give times as dates, or install a newer astropy-iers-data",
        NOTE,
    ),
    "nonlinear": Words(
        "at {current} A the constant is off by {off} ppm",
        "check shunt and source, and the magnetometer's linearity",
    ),
    "even in the current": Words(
        "reversing does not reverse {left} nT at {largest:g} A",
        "look for heating, or iron near the coil; the axis is free of it",
        NOTE,
        limit=4.0,  # standard errors
    ),
    "correlated residuals": Words(
        "residuals are correlated over {length} stretches",
        "reverse the current more often, or put the reference nearer",
        limit=2.0,  # stretches that count as one
    ),
    "coil not settled": Words(
        "the field still changes after each change of the current: the second halves of the "
        "stretches alone give a constant that differs by {by} %",
        "give a longer settle_s in the session, and leave each current on for longer",
        WORSE,
        limit=1e-5,  # of the constant
    ),
    "large current": Words(
        "the largest current is {largest} A, more than such coils carry",
        "give current_A in amperes; are these milliamperes?",
        limit=50.0,  # amperes
    ),
    "axis not as drawn": Words(
        "the axis is {away}° from the nominal axis",
        "check the leads and the axes: {cause}",
        limit=5.0,  # degrees
    ),
    "coil in the reference": Words(
        "the reference sees {share} % of the coil's field, so that much may be missing from the "
        "constant",
        "put the reference farther from the coil, or fit without it",
        limit=1e-5,  # of the constant
    ),
    "ambient field differs": Words(
        "without the coil the magnetometer reads {by} % {way} than the reference; if that is an "
        "error of its gain, the constant has the same error",
        "give the magnetometer's calibration, or state why the field differs",
        limit=0.005,  # of the field
    ),
    "constant drifts": Words(
        "the second half of the readings gives a constant {by} % from that of the first: the coil, "
        "its shunt or its source warms up",
        "warm it up before, and keep the current on for the same time in both directions",
        limit=1e-4,  # of the constant
    ),
    # accelerometer
    "vertical varies": Words(
        "the vertical field scatters by {by} % of the field between orientations",
        "calibrate the magnetometer first, and keep away from iron",
        WORSE,
        limit=0.02,  # of the field
    ),
    "turn undetermined": Words(
        "{n} orientations do not determine the turn about {axis}",
        "hold it still also nose up, on either side and upside down, and in between",
        REFUSED,
        limit=5.0,  # degrees
    ),
    "turn loose": Words(
        "the standard error of the turn about {axis} is {sd}°",
        "add orientations far from the others",
        limit=1.0,  # degrees
    ),
    "uneven gravity": Words(
        "the accelerometer reads gravity as {by} % larger one way than another",
        "calibrate it; its bias tilts every orientation",
        limit=0.03,  # of gravity
    ),
    "dips the wrong way": Words(
        "by this fit the field dips {way} by {dip:.0f}°, and {here}: an axis of the magnetometer "
        "or accelerometer with the wrong sign, or two exchanged, fits as well",
        "compare the axes with the data sheets{unknown}",
    ),
    # turned platform
    "platform remanence": Words(
        "the platform has a field of its own of {size} nT across its axis, which turns a field by "
        "up to {turned}″",
        "demagnetize or replace what is magnetic on it, or solve for the bias (--solve bias) with "
        "the magnetometer where it will stay",
    ),
    "platform iron": Words(
        "something on the platform is magnetized by the field: {size} nT repeat twice in one turn",
        "find the screw or the motor, or solve for the matrix (--solve bias,matrix)",
    ),
    "remanence loose": Words(
        "the platform's own field is known to {sd} nT only, and {wanted} nT are needed",
        "take more readings at each setting, and a reference farther off",
    ),
}
"""What is said of each kind of finding, in the order of the instruments."""


def is_above(name: str, size: float) -> bool:
    """Whether a size is above the limit in the table; what is no number is."""
    return not size <= FINDINGS[name].limit


def report_above(name: str, size: float, /, **values: str | float) -> Iterator[Finding]:
    """The finding of what has a size, where that is above the limit in the table."""
    if size > FINDINGS[name].limit:
        yield report(name, **values)


def report(name: str, severity: Severity | None = None, /, **values: str | float) -> Finding:
    """A finding of the table; numbers with two digits, unless their format says how."""
    row = FINDINGS[name]
    return word_finding(name, severity or row.severities[0], row.message, row.action, values)


def write_by_axis(sds: Iterable[float], unit: str = "″", between: str = "   ") -> str:
    """Standard errors (3,) about the axes x, y and z."""
    return between.join(
        f"{a} {significant(float(sd), 2)}{unit}" for a, sd in zip("xyz", sds, strict=True)
    )
