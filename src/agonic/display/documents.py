"""The document of each result: what its page, its text and a notebook show."""

from __future__ import annotations

from collections.abc import Callable
from functools import singledispatch
from html import escape
from typing import Any

from agonic.alignment.coil.result import CoilFit
from agonic.alignment.direction.result import FieldDirection, describe_direction
from agonic.alignment.document import (
    describe_coil,
    describe_di_flux,
    describe_gravity,
    describe_north,
)
from agonic.alignment.gravity import GravityFit
from agonic.alignment.north.di_flux import DiFluxFit
from agonic.alignment.north.fit import NorthFit
from agonic.alignment.star_sensor.document import describe_alignment
from agonic.alignment.star_sensor.result import AlignmentFit
from agonic.headings.deviation import DeviationFit
from agonic.headings.deviation.document import describe_deviation
from agonic.headings.document import describe_headings
from agonic.headings.result import Heading
from agonic.health import Judged
from agonic.history.document import describe_drift
from agonic.history.result import Drift
from agonic.inflight.fit import InflightFit
from agonic.inflight.report.document import describe_inflight, describe_tracking
from agonic.inflight.tracking import Tracker
from agonic.readable import Readable
from agonic.recording.calibrated import Calibrated
from agonic.recording.document import describe_recording
from agonic.report.document import Document
from agonic.thermal.document import describe_campaign, describe_known_field
from agonic.thermal.fit.result import ThermalFit
from agonic.thermal.result import CalibratedCampaign

_HEIGHT_PX = 720


@singledispatch
def describe(shown: object) -> Document | None:
    """The document of a result; None where there is none."""
    if not isinstance(shown, Judged):
        return None
    name = getattr(getattr(shown, "calibration", None), "sensor", type(shown).__name__)
    calibration = getattr(shown, "calibration", None)
    return Document.judge(shown, name=name, kind=type(shown).__name__, calibration=calibration)


_DESCRIBED: dict[type, Callable[[Any], Document]] = {
    AlignmentFit: describe_alignment,
    Calibrated: lambda one: describe_recording([one], title=one.samples.name),
    CalibratedCampaign: describe_campaign,
    CoilFit: describe_coil,
    DeviationFit: describe_deviation,
    DiFluxFit: describe_di_flux,
    Drift: describe_drift,
    FieldDirection: describe_direction,
    GravityFit: lambda one: describe_gravity(one, one.calibration.sensor),
    Heading: describe_headings,
    InflightFit: describe_inflight,
    NorthFit: describe_north,
    ThermalFit: lambda one: describe_known_field(one, one.calibration.sensor),
    Tracker: lambda one: describe_tracking(one, None),
}
for _kind, _describe in _DESCRIBED.items():
    describe.register(_kind, _describe)


def write_summary(shown: Readable) -> str:
    """All that is to be said of an object, as text."""
    document = describe(shown)
    return repr(shown) if document is None else document.to_text()


def draw_page(shown: Readable) -> str:
    """The page of a result in a frame of its own, which no style of a notebook reaches."""
    document = describe(shown)
    if document is None:
        return f'<pre style="white-space:pre-wrap">{escape(repr(shown))}</pre>'
    page = escape(document.to_html(), quote=True)
    name = escape(f"{document.kind}: {document.name}", quote=True)
    return (
        f'<iframe title="{name}" srcdoc="{page}" loading="lazy" '
        f'style="width:100%;height:{_HEIGHT_PX}px;border:0"></iframe>'
    )
