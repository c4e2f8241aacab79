"""`heading`: from samples and a setup to true headings with their standard errors."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from agonic.arrays import Mask
from agonic.attitude.undo_latency import bring_forward
from agonic.calibration.setup import Compass, Setup
from agonic.errors import AgonicWarning, LogError
from agonic.headings.compass_heading import (
    UNKNOWN_SD_DEG,
    Indication,
    Readings,
    interpolate_readings,
    pick_used,
)
from agonic.headings.expected_field import Surroundings, find_surroundings
from agonic.headings.monitor.watch import watch_pair
from agonic.headings.result import EACH_ROW, FLAGS, SMOOTHED, Heading
from agonic.headings.rows import RowHeadings, compare_compasses, find_row_headings
from agonic.headings.smoothing.rows import bridge, smooth_rows
from agonic.headings.smoothing.smooth import SmoothedHeading
from agonic.headings.tilt_source import mend_unit
from agonic.maths.rotations import tilt as kernel
from agonic.samples import Samples
from agonic.units import RAW, WEAKEST_HORIZONTAL

_Pairs = tuple[tuple[Compass, Samples], ...]


def heading(samples: Samples | Sequence[Samples], setup: Setup, *, smooth: bool = True) -> Heading:
    """The true heading at each sample, with its standard error and where not to trust it.

        compass = atan2(−y₂, x₂) of the levelled field,
        magnetic = compass + deviation(compass),   true = magnetic + declination

    Where the log has a gyro, the magnetic headings are those of compass and gyro together, smoothed
    forwards and backwards, if that leaves the smaller standard error; else, or on request, each row
    is taken by itself.

    Parameters
    ----------
    samples : readings of the magnetometer, or of several of one vehicle, matched to the compasses
        of the setup by name. Headings are at the times of the first compass, whose samples also
        give the attitude, the place and the date; another in the same rows whose roll and pitch are
        others has an inclinometer of its own, and is levelled by that.
    setup : calibrations, deviations, where the tilt and the declination come from.
    smooth : take all rows together, where the samples hold times and rates of a gyro and the tilt
        is from the log or from the gyro; `method` and `notes` of the result say what was done.

    Returns
    -------
    Heading, (n,) columns. Each row is taken from the first compass of the setup whose field is the
    expected one within the limits, or from the one nearest to it where none is. The standard error
    is carried through the chain by its Jacobian; about level an error of tilt counts with the
    tangent of the dip. Where the tilt has to be found, what acceleration did to it counts too.

    Raises
    ------
    LogError where a sensor, the attitude, or the place and date are missing, or the tilt is to come
    from a gyro or an accelerometer that turns otherwise than the magnetometer; ValidityError where
    the date is outside the world models; UnitError, FrameError where readings and calibration do
    not meet; MissingExtraError where the gyro filter is asked for and not installed.

    Source: Caruso (2000), Applications of magnetic sensors for low cost compass systems, IEEE
    Position Location and Navigation Symposium, 177–184, doi 10.1109/PLANS.2000.838300.

    Examples
    --------
    >>> from agonic.calibration.affine import Affine
    >>> mag = Affine(bias=[0, 0, 0], matrix=np.eye(3), covariance=np.zeros((9, 9)), noise=100.0)
    >>> setup = Setup(compasses=(Compass(calibration=mag),), declination_deg=3.0, tilt_sd_deg=0.0)
    >>> east = Samples(field=[[0.0, -20_000.0, 40_000.0]], roll_deg=[0.0], pitch_deg=[0.0])
    >>> found = heading(east, setup)
    >>> found.true_deg.round(6).tolist(), found.sd_deg.round(3).tolist()
    ([93.0], [0.286])
    """
    pairs = _match_sensors((samples,) if isinstance(samples, Samples) else tuple(samples), setup)
    unknown = None
    # by as much as the earliest readings seem early beside the attitude, that is brought forward
    late_s = -min(compass.latency_s for compass, _ in pairs)
    if late_s > 0 and all(own.time is not None for _, own in pairs):
        forward = [bring_forward(own, late_s) for _, own in pairs]
        unknown = forward[0][1]  # rows of the first whose attitude is not known then
        pairs = tuple(
            (replace(compass, latency_s=compass.latency_s + late_s), own)
            for (compass, _), (own, _) in zip(pairs, forward, strict=True)
        )
    first, read = pairs[0][1], []
    for compass, own in pairs:
        timed = own  # from here on by the clock of the first
        if first.epoch is not None and own.epoch is not None and own.time is not None:
            apart_s = (own.epoch - first.epoch).total_seconds()
            if apart_s:
                timed = own.with_columns(time=own.time + apart_s, epoch=first.epoch)
        readings = interpolate_readings(timed, compass, first.time)
        if unknown is not None:
            readings = readings._replace(missing=readings.missing | unknown)
        read.append(_add_tilt(readings, own, first))
    around = find_surroundings(first, setup)
    first, said = mend_unit(first, setup, pairs[0][0].calibration, smooth=smooth)
    seen = [(compass, readings) for (compass, _), readings in zip(pairs, read, strict=True)]

    def find(own: Samples) -> RowHeadings:
        return find_row_headings(own, seen, setup, around)

    by_row = find(first)
    smoothed: SmoothedHeading | None = None
    why: tuple[str, ...] = ()
    if smooth:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", AgonicWarning)  # the rows have said it by themselves
            by_row, smoothed, why = smooth_rows(first, by_row, find, setup, around)
    found = _make_heading(first, setup, by_row, around, smoothed)
    faults = watch_pair(first.time, by_row, setup, around)
    notes = (*(fault.sentence for fault in faults), *said, *found.notes, *why)
    return replace(found, faults=faults, notes=notes)


def _match_sensors(samples: tuple[Samples, ...], setup: Setup) -> _Pairs:
    """Each compass with the samples of its sensor; one of each go together whatever their names."""
    if len(samples) == 1 == len(setup.compasses):
        return ((setup.compasses[0], samples[0]),)
    by_name = {one.name: one for one in samples}
    missing = [c.sensor for c in setup.compasses if c.sensor not in by_name]
    if missing:
        raise LogError(
            f"the setup has a compass for {', '.join(missing)} and the samples are of "
            f"{', '.join(by_name) or 'no sensor'}; give those samples, or a setup without it"
        )
    return tuple((compass, by_name[compass.sensor]) for compass in setup.compasses)


def _add_tilt(readings: Readings, own: Samples, first: Samples) -> Readings:
    """The readings with the tilt of the sensor's own inclinometer, in the rows of the first."""
    if own is first or own.roll_deg is None or own.pitch_deg is None or len(own) != len(first):
        return readings
    if own.time is not None and first.time is not None and not np.array_equal(own.time, first.time):
        return readings
    tilt = np.column_stack([own.roll_deg, own.pitch_deg])
    shared = first.roll_deg is not None and first.pitch_deg is not None
    if shared and np.array_equal(tilt, np.transpose([first.roll_deg, first.pitch_deg])):
        return readings
    return readings._replace(tilt=tilt)


def _make_heading(
    first: Samples,
    setup: Setup,
    by_row: RowHeadings,
    around: Surroundings,
    smoothed: SmoothedHeading | None,
) -> Heading:
    """Each row from the compass to trust, with declination, standard error and flags."""
    n = len(first)
    tilt, compasses, used = by_row.tilt, by_row.compasses, by_row.used
    each = zip(*(one.indicated for one in compasses), strict=True)
    found = Indication(*(pick_used(used, values) for values in each))
    magnetic, random = found.magnetic_deg, found.random
    variance = found.systematic + random
    apart, disagreeing = compare_compasses(compasses, setup.disagreement_limit_deg)
    flags = _flag_rows(setup, by_row, found, disagreeing)
    if smoothed is not None:
        magnetic, variance, random = smoothed.magnetic_deg, smoothed.variance, np.zeros(n)
    sd, random_sd = (
        np.fmin(np.sqrt(v), UNKNOWN_SD_DEG)
        for v in (variance + around.declination_sd_deg**2, random)
    )
    notes = (*tilt.notes, *around.notes, *by_row.notes)
    if smoothed is not None:
        flags, bridged = bridge(flags, sd)
        notes = (*notes, *bridged)
    unknown = ~np.isfinite(magnetic)
    sd[unknown] = random_sd[unknown] = np.nan
    return Heading(
        time=first.time,
        compass_deg=found.compass_deg,
        magnetic_deg=magnetic,
        true_deg=kernel.wrap_turn_deg(magnetic + around.declination_deg),
        sd_deg=sd,
        random_sd_deg=random_sd,
        disagreement_deg=apart,
        used=used,
        flags=MappingProxyType(flags),
        roll_deg=np.broadcast_to(tilt.roll_deg, n),
        pitch_deg=np.broadcast_to(tilt.pitch_deg, n),
        tilt_sd_deg=np.broadcast_to(tilt.sd_deg, n),
        declination_deg=np.broadcast_to(around.declination_deg, n),
        sensors=tuple(one.compass.sensor for one in compasses),
        tilt=tilt.source,
        method=EACH_ROW if smoothed is None else SMOOTHED,
        notes=notes,
    )


def _flag_rows(
    setup: Setup, by_row: RowHeadings, found: Indication, disagreeing: Mask | None
) -> Mapping[str, Mask]:
    """The rows that each of `FLAGS` marks."""
    tilt, compasses, used = by_row.tilt, by_row.compasses, by_row.used
    nowhere = np.zeros(len(used), dtype=bool)
    far = [nowhere if one.distance is None else one.distance > 1.0 for one in compasses]
    scaled = [np.full(len(used), one.compass.calibration.unit_out != RAW) for one in compasses]
    upright = tilt.tilt.cos_roll * tilt.tilt.cos_pitch
    marked = (
        pick_used(used, [one.readings.missing for one in compasses]),
        tilt.missing,
        upright < np.cos(np.radians(setup.tilt_limit_deg)),
        (found.horizontal < WEAKEST_HORIZONTAL) & pick_used(used, scaled),
        pick_used(used, far),
        tilt.unsure,
        disagreeing,
    )
    flags = zip(FLAGS, (nowhere if rows is None else rows for rows in marked), strict=True)
    return {name: np.broadcast_to(rows, nowhere.shape) for name, rows in flags}
