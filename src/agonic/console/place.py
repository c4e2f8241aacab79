"""What the field should have been: from the command line, or from the log's own place and date."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from agonic.errors import AgonicError, UnitError

if TYPE_CHECKING:
    from agonic.console.options import ScalarChoice
    from agonic.reference import Reference
    from agonic.samples import Samples


def find_reference(
    samples: Samples,
    at: str | None,
    date: str | None,
    magnitude: float | None,
    model: str | None = None,
) -> tuple[Reference | None, dict[str, Any]]:
    """The reference for a sensor and the fit settings that go with the place."""
    from agonic.console.parse import parse_position
    from agonic.field.place import choose_reference

    where = parse_position(at) if at and magnitude is None else None
    return choose_reference(samples, where, date, magnitude, model)


def find_scalar_reference(
    samples: Samples, wanted: bool | None, sd: float = 0.0
) -> Reference | None:
    """The scalar instrument beside the sensor as reference, where there is one and it may teach.

    `wanted` true requires it, false leaves it aside, `None` takes it where the log has it; `sd` is
    how far it may be off as a whole, nT. Raises `AgonicError` where it is no magnitude of a field.
    """
    from agonic.health.scale import check_scalar
    from agonic.reference import Reference

    if wanted is False or (wanted is None and samples.scalar is None):
        return None
    if samples.scalar is None:
        notes = [f" ({note})" for note in samples.notes if note.startswith("scalar left out")]
        why = "".join(notes) or " (column scalar_nT)"
        raise AgonicError(f"--scalar: the log holds no scalar instrument{why}")
    if (wrong := check_scalar(samples)) is not None:
        raise AgonicError(f"{wrong.sentence}; --no-scalar or --scalar none leaves it aside")
    said = "the scalar instrument in the log"
    return Reference.magnitude(samples.scalar, sd=sd, source=said)


NO_SCALAR = "none"


class Beside(NamedTuple):
    """A scalar instrument that was asked for: the header of its column in the log, or its own
    table, and how far it may be off as a whole, nT; neither where the log's own is to be taken."""

    header: str | None
    table: Samples | None
    sd: float

    def refer(
        self, samples: Samples, reference: Reference | None, *, given: bool
    ) -> tuple[Samples, Reference | None]:
        """The samples, of rows that the scalar instrument has, and its readings as reference.

        Where none was asked for, that of the log is taken unless a place was `given`, or roll and
        pitch make more of the `reference` there is.
        """
        if self.table is not None:
            from agonic.logs.other_instrument import join_scalar

            samples = join_scalar(samples, self.table)
        asked = self.table is not None or self.header is not None
        other = given or samples.scalar is None or samples.roll_deg is not None
        if self.header == NO_SCALAR or (other and not asked):
            return samples, reference
        return samples, find_scalar_reference(samples, True, self.sd)


@contextmanager
def open_beside_scalar(choice: ScalarChoice) -> Iterator[Beside]:
    """The scalar instrument that the command line names; logs opened meanwhile have its column."""
    from agonic.logs.headers.column_names import naming_scalar
    from agonic.logs.other_instrument import read_scalar

    given = choice.column
    file, _, header = (given or "").rpartition(":")
    table = None
    if given is not None and Path(given).is_file():
        table = read_scalar(Path(given))
    elif file and Path(file).is_file():
        table = read_scalar(Path(file), header)
    column = given if table is None else None
    with naming_scalar(None if column == NO_SCALAR else column):
        yield Beside(column, table, choice.sd)


def set_track(samples: Samples, altitude_m: float | None, elements: Path | None) -> Samples:
    """The samples with an altitude for all of them, or positions from two-line elements."""
    if altitude_m is not None and elements is not None:
        raise AgonicError(
            "give --altitude or --tle, not both: elements have altitudes of their own"
        )
    if altitude_m is not None:
        return samples.with_columns(altitude_m=np.full(len(samples), altitude_m))
    if elements is None:
        return samples
    from agonic.logs.space.positions import positions_from_tle

    if samples.time is None or samples.epoch is None:
        raise AgonicError(f"--tle {elements}: {samples.name} has no date; give --date")
    return samples.with_columns(**positions_from_tle(elements, samples.time, samples.epoch))


_UNIT = re.compile(r"[\[(]([^\])]+)[\])]|[_ ,]([^_ ,()\[\]]+)$")


def open_beside_known_field(
    log: Path, sensor: str | None, given: str, unit: str | None = None
) -> tuple[Samples, Reference]:
    """The sensor of a log that was asked for, or the only one that is not the known field itself,
    with that field; the parameters are those of `match_known_field`."""
    from agonic.console.sensors import choose_name, open_sensors

    _, sensors = open_sensors(log, sensor, unit)
    known = _read(given, log, unit)
    others = [
        one
        for one in sensors
        if one.name != given and not np.array_equal(one.field, known.field, equal_nan=True)
    ]
    if not others:
        raise AgonicError(f"{log.name} holds no magnetometer beside the known field")
    name = choose_name(one.name for one in others)
    return match_known_field(next(s for s in others if s.name == name), given, log, unit)


def match_known_field(
    samples: Samples, given: str, log: Path, unit: str | None = None
) -> tuple[Samples, Reference]:
    """The rows whose field is known, and that field as vectors in the sensor's axes."""
    known = _read(given, log, unit)
    if (known.unit == "raw") != (samples.unit == "raw") and known.unit == "raw":
        raise AgonicError(f"{given} gives the known field without a unit; name it, or give --unit")
    return _match(samples, known, given)


def _read(given: str, log: Path, unit: str | None) -> Samples:
    """The known field as samples of a sensor of its own."""
    from agonic.logs.read import open_log, read

    if Path(given).exists():
        return read(given, unit=unit)
    named = [one for one in open_log(log, unit=unit).sensors if one.name == given]
    if named:
        return named[0]
    names = [name.strip() for name in given.split(",")]
    if len(names) != 3 or not all(names):
        raise AgonicError(
            f"--reference {given!r} is neither a file, nor three columns of {log.name} as X,Y,Z, "
            "nor another of its sensors"
        )
    columns = dict(zip("xyz", names, strict=True))
    return open_log(log, unit=_find_unit(names[0]) or unit, columns=columns).sensors[0]


def _find_unit(header: str) -> str | None:
    """The unit that stands in a header, if one does."""
    from agonic.units import find_unit

    for found in _UNIT.finditer(header):
        try:
            return find_unit(found[1] or found[2])
        except UnitError:
            continue
    return None


def _match(samples: Samples, known: Samples, given: str) -> tuple[Samples, Reference]:
    """The known field at the times of the samples, or row by row without times."""
    from agonic.reference import Reference

    if samples.time is not None and known.time is not None:
        rows = (samples.time >= known.time[0]) & (samples.time <= known.time[-1])
        if not rows.any():
            raise AgonicError(f"{given} and the log were never recorded at the same time")
        samples = samples.select(rows)
        axes = [np.interp(samples.time, known.time, axis) for axis in known.field.T]  # type: ignore[arg-type]
        values = np.stack(axes, axis=1)
    elif len(known) == len(samples):
        values = known.field
    else:
        raise AgonicError(
            f"{given} has {len(known)} rows and the log {len(samples)}; give both times, or as "
            "many rows"
        )
    frame = known.frame if known.frame in ("m", "b") else "m"
    return samples, Reference.vector(values, frame=frame, source=Path(given).name)
