"""`agonic simulate campaign -o DIR`: recordings of a climatic chamber with known truth."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.console.options import Folder, Format, Json, Seed

if TYPE_CHECKING:
    from agonic.thermal.simulation.campaign import Faults, SimulatedCampaign

FAULTS = "missing=3,7 stuck=SENSOR swapped=4,9 drift=5000 truncated=6 kelvin"
"""How each fault is written."""


def campaign(
    out: Folder,
    sensors: str = "2xMMC5883MA,3xMPU-9255",
    rate: float = 1.0,
    noise: float | None = None,
    field: float = 48_000.0,
    fault: Annotated[
        list[str] | None, typer.Option(metavar="FAULT", help=f"Repeatable: {FAULTS}.")
    ] = None,
    format: Format = "csv",
    seed: Seed = 0,
    as_json: Json = False,
) -> int:
    """A thermal chamber: recordings, their campaign.toml, and the truth in a folder of its own.

    Options
    -------
    sensors LIST : 2xMMC5883MA,3xMPU-9255; MODEL:NOISE in nT.
    rate HZ ≥0.001 : Readings a second.
    noise ≥0 : Noise per axis, nT; default: by the model.
    field : Magnitude of the field, nT.
    """
    from agonic.console.output import finish_made, write_truth
    from agonic.thermal.files.write import write_campaign
    from agonic.thermal.simulation.campaign import simulate_campaign

    made = simulate_campaign(
        sensors,
        rate_Hz=rate,
        noise=noise,
        magnitude=field,
        faults=parse_faults(fault or []),
        seed=seed,
    )
    files = write_campaign(made.description, made.stations(), out, format=format)  # type: ignore[arg-type]
    if format == "csv":
        _cut_last_lines(files, made)
    truth, stations = write_truth("campaign", _tell_truth(made), out / "truth"), len(files) - 1
    record = {"sensors": list(made.truth), "stations": stations, "facts": made.facts}
    return finish_made(
        stations,
        f"stations, {len(made.truth)} sensors",
        out,
        f"The truth: {truth}",
        record=record | {"files": [*files, truth]},
        as_json=as_json,
        next_step=f"agonic fit thermal {quote(str(out))} -o results",
        schema="agonic/simulate-campaign@1",
    )


def parse_faults(words: list[str]) -> Faults:
    """The faults that the words name."""
    from agonic.errors import AgonicError
    from agonic.thermal.simulation.campaign import Faults

    given: dict[str, Any] = {}
    for word in words:
        name, _, value = word.partition("=")
        try:
            given[name] = _FAULTS[name](value)
        except (KeyError, ValueError):
            raise AgonicError(f"--fault {word!r} is not known; write one of {FAULTS}") from None
    return Faults(**given)


def _parse_numbers(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in text.split(","))


def _parse_pair(text: str) -> tuple[int, int]:
    one, other = _parse_numbers(text)
    return one, other


def _parse_name(text: str) -> str:
    if not text:
        raise ValueError
    return text


_FAULTS: dict[str, Any] = {
    "missing": _parse_numbers,
    "stuck": _parse_name,
    "swapped": _parse_pair,
    "drift": float,
    "truncated": _parse_numbers,
    "kelvin": lambda text: not text or text == "yes",
}


def _cut_last_lines(files: list[Path], made: SimulatedCampaign) -> None:
    """Let the last line of a truncated recording end in its middle."""
    for number, file in zip(made.recorded, files, strict=False):
        if number in made.faults.truncated:
            file.write_bytes(file.read_bytes()[:-9])


def _tell_truth(made: SimulatedCampaign) -> dict[str, Any]:
    """What the readings really depend on: sensors, turns of the box, the field over time."""
    return {
        "sensors": {
            name: {
                "bias": truth.bias,
                "matrix": truth.matrix,
                "rate": truth.rate,
                "centre_C": truth.centre_C,
                "half_range_C": truth.half_range_C,
            }
            for name, truth in made.truth.items()
        },
        "matrix_nb": {number: turned.as_matrix() for number, turned in made.rotations.items()},
        "field": {"time_s": made.knots, "field_n_nT": made.field_knots},
        "facts": made.facts,
    }
