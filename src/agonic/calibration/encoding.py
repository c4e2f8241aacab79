"""The calibration file: JSON that holds a calibration exactly, and its JSON Schema.

The version in `schema` changes when the meaning of a reading changes. Fields that only add
information may come without a new version, so unknown fields are passed over when loading.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from functools import reduce
from math import isfinite
from operator import or_
from types import GenericAlias
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_type_hints

import msgspec
import numpy as np
from msgspec import Meta, Struct, defstruct

from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration, Validity
from agonic.calibration.chain import Chain
from agonic.calibration.deviation import Deviation
from agonic.calibration.interference import Interference
from agonic.calibration.network import Network
from agonic.calibration.schema_fields import (
    ProvenanceRecord,
    Stored,
    ValidityRecord,
)
from agonic.calibration.steps import AnyCalibration, require_calibration
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError, LogError
from agonic.provenance import Provenance

SCHEMA = "agonic/calibration"
VERSION = 1


class _Heading(Struct):
    schema: str = ""


def encode(calibration: Calibration | Deviation) -> bytes:
    """The bytes of the calibration file: the same for the same calibration, always."""
    known = calibration if isinstance(calibration, Deviation) else require_calibration(calibration)
    plain = {
        "schema": f"{SCHEMA}@{VERSION}",
        "equation": known.equation,
        "calibration": _plain(known),
    }
    try:
        record = msgspec.convert(plain, CalibrationFile)
    except msgspec.ValidationError as error:
        raise AgonicError(f"this calibration cannot be saved: {error}") from None
    return _rows_on_one_line(msgspec.json.format(msgspec.json.encode(record), indent=2)) + b"\n"


def decode(data: bytes) -> AnyCalibration | Deviation:
    """The calibration in the bytes of a calibration file, as `encode` wrote them."""
    _require_known_version(msgspec.json.decode(data, type=_Heading).schema)
    restored: AnyCalibration | Deviation = _restore(
        msgspec.json.decode(data, type=CalibrationFile).calibration
    )
    return restored


def schema() -> dict[str, Any]:
    """The JSON Schema of the calibration file.

    >>> schema()["$defs"]["AffineRecord"]["properties"]["bias"]["description"]
    'Subtracted from the readings, in unit_in.'
    """
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **msgspec.json.schema(CalibrationFile),
    }


def _plain(value: Any) -> Any:
    """The value in what JSON has, every float as it is."""
    if is_dataclass(value):
        plain = {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
        return {"kind": value.kind, **plain} if hasattr(value, "kind") else plain
    if hasattr(value, "as_quat"):  # a rotation
        return {"quat_wxyz": np.roll(value.as_quat(), 1).tolist()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not isfinite(value):
        raise AgonicError(f"a calibration with {value} in it cannot be saved; fit it again")
    if value is None or isinstance(value, str | bool | int | float):
        return value
    raise AgonicError(
        f"a {type(value).__name__} in the provenance cannot be saved; "
        "settings are numbers, text, or lists of them"
    )


def _rows_on_one_line(text: bytes) -> bytes:
    """Indented JSON with each row of numbers on a line; strings never hold a raw line break."""
    return re.sub(
        rb'\[\n\s*([^][{}"]*?)\s*\n\s*\]',
        lambda row: b"[" + re.sub(rb"\s*\n\s*", b" ", row[1]) + b"]",
        text,
    )


def _require_known_version(text: str) -> None:
    name, _, version = text.partition("@")
    if name != SCHEMA or not version.isdecimal():
        raise LogError(f'it needs "schema": "{SCHEMA}@{VERSION}" and has {text!r}')
    if int(version) > VERSION:
        raise LogError(
            f"it was made by a newer agonic (version {version} of the format, this one knows "
            f"up to {VERSION}); update agonic"
        )


_KINDS: dict[str, Any] = {
    one.kind: one for one in (Affine, Interference, Thermal, Network, Alignment, Chain, Deviation)
}


def _restore(record: Any) -> Any:
    """The calibration of a record."""
    values = msgspec.structs.asdict(record)
    values["provenance"] = msgspec.convert(record.provenance, Provenance, from_attributes=True)
    if "validity" in values:
        values["validity"] = msgspec.convert(record.validity, Validity, from_attributes=True)
    if "rotation" in values:
        values["rotation"] = _rotation(record.rotation.quat_wxyz)
    if values.get("base") is not None:
        values["base"] = _restore(record.base)
    if "steps" in values:
        values["steps"] = tuple(map(_restore, record.steps))
    return _KINDS[record.__struct_config__.tag](**values)


def _rotation(quat_wxyz: tuple[float, ...]) -> Rotation:
    """The rotation; a quaternion of length 1 keeps its bits, which normalising would not."""
    from scipy.spatial.transform import Rotation  # slow to load

    quat = np.roll(np.array(quat_wxyz), -1)
    return Rotation(quat, normalize=bool(abs(np.linalg.norm(quat) - 1.0) > 1e-12))


_FIRST = ("sensor", "unit_in", "unit_out", "frame_in", "frame_out", "model", "gauge")
"""Fields that stand first in a record, and are never left out."""
_SAME = {"validity": ValidityRecord, "provenance": ProvenanceRecord}


def make_record(kind: Any, law: str, **forms: Any) -> type[Struct]:
    """The record of a kind of calibration: its fields, in their forms, under its law. `forms` are
    of fields that hold calibrations."""
    hints = get_type_hints(kind, localns={"Rotation": Any}, include_extras=True)
    forms = {name: _find_form(hint) for name, hint in hints.items()} | _SAME | forms
    known = {f.name: f for f in fields(kind)}
    order = [name for name in _FIRST if name in known]
    order += [name for name in known if name not in order]
    return defstruct(
        f"{kind.__name__}Record",
        [(name, forms[name], _find_default(known[name])) for name in order],
        namespace={"__doc__": law},
        frozen=True,
        kw_only=True,
        tag_field="kind",
        tag=kind.kind,
    )


def _find_form(hint: Any) -> Any:
    return next(
        (one.form for one in getattr(hint, "__metadata__", ()) if type(one) is Stored), hint
    )


def _find_default(field: Any) -> Any:
    """What a file may leave out."""
    if field.name in (*_FIRST, "terms", "provenance"):
        return msgspec.NODEFAULT
    if field.name == "validity":
        return ValidityRecord()
    if field.default_factory is not MISSING:
        return msgspec.field(default_factory=field.default_factory)
    return msgspec.NODEFAULT if field.default is MISSING else field.default


_AFFINE = [
    make_record(Affine, "field = matrix @ (raw − bias)."),
    make_record(
        Interference, "field = matrix @ (raw − bias − coefficients @ x), x from the sources."
    ),
    make_record(
        Thermal,
        "field = matrix(T) @ (raw − bias(T) − rate dT/dt), powers of x = (T − centre)/half range.",
    ),
]
_BASE = Meta(description="What corrects alone far from the training; null: nothing.")
_STEPS = [
    *_AFFINE,
    make_record(
        Network,
        "field = base(raw) + g(x) · (output_middle + output_half · V [tanh(U [x, 1]), 1]).\n\n"
        "With `second` it is V [tanh(W [tanh(U [x, 1]), 1]), 1].",
        base=Annotated[reduce(or_, _AFFINE) | None, _BASE],
    ),
    make_record(Alignment, "field_out = rotation.apply(field_in)."),
]
_RECORDS = [
    *_STEPS,
    make_record(
        Chain,
        "Calibrations applied one after the other, in this order.",
        steps=Annotated[GenericAlias(tuple, (reduce(or_, _STEPS), ...)), Meta(min_length=1)],
    ),
    make_record(Deviation, "magnetic = compass + deviation(compass), in one state of the vehicle."),
]

CalibrationFile: Any = defstruct(
    "CalibrationFile",
    [
        ("schema", Literal["agonic/calibration@1"]),
        (
            "equation",
            Annotated[str, Meta(description="The correction in words, for the reader.")],
        ),
        ("calibration", reduce(or_, _RECORDS)),
    ],
    namespace={"__doc__": "A calibration of a magnetometer, made with agonic."},
    frozen=True,
)


if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation
