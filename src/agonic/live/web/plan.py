"""`Plan`: what a live session is to reach."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from agonic.calibration.affine import Affine
from agonic.live.state import LiveParams
from agonic.live.streams import Chunk
from agonic.reference import Reference


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What a session is to reach: the field to expect, when to stop, where to write. `settings` are
    those of the fit that go with the reference; `before` calibrations by sensor; `fresh` not to go
    on with what the folder holds of a session that was not finished."""

    folder: Path
    reference: Reference | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    target_deg: float = 0.5
    sensor: str | None = None
    before: Mapping[str, Affine] = field(default_factory=dict)
    fresh: bool = False

    def params(self, first: Chunk) -> LiveParams:
        """Those of the live fit of a sensor."""
        reference = self.reference
        known = None if reference is None else float(reference.magnitudes(1)[0])
        place = None
        if reference is not None and reference.kind == "vector":
            north, east, down = map(float, reference.values[0])
            place = north, east, down
        return LiveParams(
            unit=first.unit,
            magnitude=known,
            field_n=place,
            magnitude_sd=reference.sd if reference else 0.0,
            source=reference.source if reference else "given",
            target_deg=self.target_deg,
            inclination_deg=self.settings.get("inclination_deg", 60.0),
            name=first.sensor,
            device_id=first.device_id,
        )
