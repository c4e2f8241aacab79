"""What a calibration file holds, kind by kind: records made from the fields of calibrations."""

from __future__ import annotations

from dataclasses import MISSING, fields
from functools import reduce
from operator import or_
from types import GenericAlias
from typing import Annotated, Any, Literal, get_type_hints

import msgspec
from msgspec import Meta, Struct, defstruct

from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.chain import Chain
from agonic.calibration.deviation import Deviation
from agonic.calibration.interference import Interference
from agonic.calibration.network import Network
from agonic.calibration.schema_fields import (
    ProvenanceRecord,
    Stored,
    ValidityRecord,
)
from agonic.calibration.thermal import Thermal

_FIRST = ("sensor", "unit_in", "unit_out", "frame_in", "frame_out", "model", "gauge")
"""Fields that stand first in a record, and are never left out."""
_SAME = {"validity": ValidityRecord, "provenance": ProvenanceRecord}


def make_record(kind: Any, law: str, **forms: Any) -> type[Struct]:
    """The record of a kind of calibration: its fields, in their forms, under its law.

    `forms` are of fields that hold calibrations.

    >>> make_record(Alignment, "field_out = rotation.apply(field_in).").__struct_fields__
    ('sensor', 'unit_in', 'frame_in', 'frame_out', 'rotation', 'covariance', 'provenance')
    """
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
_KINDS = [
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
        ("calibration", reduce(or_, _KINDS)),
    ],
    namespace={"__doc__": "A calibration of a magnetometer, made with agonic."},
    frozen=True,
)
