"""`agonic plan placement PARTS|LOG|TABLE -o DIR`: where magnetometers should sit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from agonic.console.options import Between, Json, Report, Seed, Unit
from agonic.errors import AgonicError, UnitError

if TYPE_CHECKING:
    from agonic.samples import Samples


def placement(
    source: Path | None = None,
    calibrated: bool = False,
    seed: Seed = 0,
    horizontal: float | None = None,
    noise: float | None = None,
    first: str | None = None,
    unit: Unit = None,
    between: Between = None,
    out: Path | None = None,
    report: Report = None,
    as_json: Json = False,
) -> int:
    """The best places of two magnetometers, their mix, and the deviation to expect.

    A list of parts says what is magnetic on board and where a magnetometer may sit; without any,
    an example is shown. A table has a row for each place and source:
    place,source,add_x_nT,add_y_nT,add_z_nT, what is added there when the source is switched on.

    Options
    -------
    source <[PARTS|LOG|TABLE]> : A list of parts, .toml; a recording of two magnetometers, strapped
        down; or a table of places. Without: an example of a list.
    calibrated --calibrated : Of a list: iron is calibrated, only currents still disturb.
    horizontal NT ≥1.0 : Level part of the field; default: 20000.
    noise NT ≥0.001 : Of a reading on an axis, for a table; default: 200.
    first SENSOR : Which of the recording is the first.
    out -o DIR : Folder for the page.
    """
    from agonic.console.finish import finish
    from agonic.logs.contents import read_bytes
    from agonic.placement import document
    from agonic.placement.layout import read_layout
    from agonic.placement.mix import judge_recording, rank_places, read_places
    from agonic.placement.plan import plan_placement
    from agonic.provenance import Input, hash_file

    if source is None:
        return _show_example(out, as_json)
    if out is not None and (out.suffix or report is not None):
        raise AgonicError(f"-o {out} is the folder for report.html; a file goes with --report")
    level = horizontal or 20_000.0
    if source.suffix.lower() == ".toml":
        if any(given is not None for given in (horizontal, noise, first, unit, between)):
            raise AgonicError(
                f"{source.name} says itself where it is used and how noisy sensors are: [field], "
                "[sensor]; only --calibrated and --seed go with a list of parts"
            )
        layout = read_layout(source)
        count = len(layout.parts) + len(layout.wires)
        read = Input(name=source.name, sha256=hash_file(source), count=count)
        plan = plan_placement(layout, calibrated=calibrated, seed=seed)
        made = document.describe_plan(plan, read)
    elif calibrated:
        raise AgonicError(f"--calibrated goes with a list of parts, and {source} is none (.toml)")
    elif b"place" in read_bytes(source).split(b"\n", 1)[0]:
        ranked = rank_places(read_places(source), noise or 200.0, level)
        made = document.describe_places(ranked)
    else:
        samples = _pair_sensors(source, first, unit, between)
        made = document.describe_placement(judge_recording(samples, level))
    return finish(made, out=out, report=report, as_json=as_json)


def _show_example(out: Path | None, as_json: bool) -> int:
    """A list of parts with every key explained, in a folder where one is given."""
    from agonic.atomic import write_atomically
    from agonic.console.output import print_json, say
    from agonic.placement.layout import EXAMPLE

    text = EXAMPLE.read_text(encoding="utf-8")
    file = None
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        file = str(write_atomically(out / "parts.toml", text))
    if as_json:
        print_json("agonic/plan-placement-example@1", {"example": text, "file": file})
        return 0
    say(text if file is None else f"Written   {file}, an example: put your own parts into it")
    comment = "" if file else "# "  # what is printed may be sent into a file as it is
    say(f"{comment}Next      agonic plan placement {file or 'parts.toml'} -o places")
    return 0


def _pair_sensors(
    source: Path, first: str | None, unit: str | None, between: str | None
) -> Samples:
    """The readings of the two magnetometers of a recording."""
    from agonic.console.sensors import open_sensors

    sensors = open_sensors(source, None, unit, between)[1]
    if len(sensors) < 2:
        raise AgonicError(f"{source} holds one magnetometer; record two, or give a table of places")
    if any(one.unit != "nT" for one in sensors[:2]):
        raise UnitError("name the unit of the readings with --unit: the disturbance is given in nT")
    names = [one.name for one in sensors]
    if first is not None and first not in names:
        raise AgonicError(f"{source} holds {', '.join(names)}, and not {first}")
    own = sensors[0 if first is None else names.index(first)]
    return own.with_second(next(one for one in sensors if one is not own))
