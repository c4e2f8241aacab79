"""`agonic direction ALIGNMENT LOG -o OUT`: where the field points, among the stars and here."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.console.options import At, Json, Report, SensorChoice
from agonic.errors import AgonicError, check_choice

if TYPE_CHECKING:
    from agonic.alignment.direction.follow import Follower
    from agonic.alignment.session.session import Site

Effect = Annotated[
    str, typer.Option(metavar="EFFECT", help="In the attitudes: present or removed.")
]


def direction(
    alignment: Path,
    log: Path | None = None,
    out: Path | None = None,
    live: str | None = None,
    stars: str | None = None,
    turns: str = "ci",
    across: float | None = None,
    about: float | None = None,
    refraction: Effect = "removed",
    aberration: Effect = "removed",
    at: At = None,
    gap: float | None = None,
    wait: float | None = None,
    noise: float | None = None,
    which: SensorChoice = SensorChoice(),
    report: Report = None,
    as_json: Json = False,
) -> int:
    """Find where the field points at each reading: star sensor, celestial, Earth and local axes.

    Writes the vector in all four, right ascension and declination of where it points, magnetic
    declination and inclination, and their standard errors.

    Options
    -------
    alignment <ALIGNMENT> : Calibration of agonic fit alignment.
    log <[LOG]> : Readings; or a session.toml, or its folder.
    out -o OUT : CSV file to write.
    live SOURCE : Instead of LOG: readings as they come from what agonic live reads, or - for
        standard input; a line of JSON for each.
    stars TABLE|SOURCE : Attitudes of the star sensor; with --live by default lines of it, after
        `star,`.
    turns SENSE : Quaternions: ci (inertial into sensor) or ic.
    across ARCSEC : Error of an attitude across the boresight.
    about ARCSEC : Error of an attitude about the boresight.
    gap S : Longest gap, s, between attitudes that are interpolated.
    wait S : How long a reading waits for late attitudes; default: as --gap.
    noise NT : Noise of one reading on one axis.
    """
    from agonic.alignment.direction.compute import field_direction
    from agonic.alignment.direction.follow import Follower
    from agonic.alignment.direction.result import describe_direction
    from agonic.alignment.files.sessions import SESSION, read_session
    from agonic.alignment.files.tables import read_stars, write_direction
    from agonic.calibration.steps import require_calibration
    from agonic.console.finish import finish, require_table
    from agonic.console.sensors import open_sensor
    from agonic.files.calibration import load

    known = require_calibration(load(alignment))

    stated: dict[str, Any] = {"turns": turns, "errors": (across, about), "numbered": False}
    stated |= {"refraction": refraction, "aberration": aberration}
    check_choice("turns", turns, ("ci", "ic"))
    if (across is None) != (about is None):
        raise AgonicError("--across and --about go together")
    if live is not None:
        if log is not None or out is not None or report is not None:
            raise AgonicError("--live writes lines of JSON: leave LOG, -o and --report out")
        follower = Follower(known, _make_site(at), noise=noise, gap_s=gap, wait_s=wait)
        return _follow(follower, live, stars, stated, which)
    if log is None or out is None:
        raise AgonicError("needed are LOG and -o OUT, or --live SOURCE")
    require_table(out)
    site: Site | None
    if log.is_dir() or log.name == SESSION:
        session = read_session(log)
        samples, attitudes, site = session.magnetometer, session.star, session.site
        noise = session.noise if noise is None else noise
    else:
        samples, site = open_sensor(log, *which), _make_site(at)
        if stars is None:
            raise AgonicError(
                f"{samples.name} has no attitudes of a star sensor: give its table with --stars"
            )
        attitudes = read_stars(Path(stars), **stated)
    found = field_direction(known, samples, attitudes, site, noise=noise, gap_s=gap)
    files = [write_direction(found, out)]
    made = describe_direction(found, (samples.source, *known.provenance.inputs))
    return finish(made, files=files, report=report, as_json=as_json)


def _make_site(at: str | None) -> Site | None:
    """The place on the command line, its coordinates along the plumb line."""
    from agonic.alignment.session.session import Site
    from agonic.console.parse import parse_position

    if at is None:
        return None
    latitude, longitude, *_ = parse_position(at)
    return Site(latitude_deg=latitude, longitude_deg=longitude)


def _follow(
    follower: Follower,
    live: str,
    stars: str | None,
    stated: dict[str, Any],
    which: SensorChoice,
) -> int:
    """The direction of readings as they come; attitudes from there, or a source of their own."""
    from agonic.alignment.files.tables import read_stars
    from agonic.cli.live_direction import MARK, StarLines, follow_live
    from agonic.live.streams import open_source

    sources = [open_source(live, unit=which.unit, mark=MARK if stars is None else None)]
    if stars is not None and Path(stars).is_file():
        follower.add(read_stars(Path(stars), **stated))
    elif stars is not None:
        sources.append(open_source(stars, mark=""))
    return follow_live(follower, sources, StarLines(stated), which.sensor)
