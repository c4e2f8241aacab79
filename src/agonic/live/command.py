"""`agonic live SOURCE`: calibrate while the sensor is being turned, in a browser or a terminal."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from agonic.console.options import Json, Place, SensorChoice
from agonic.errors import AgonicError, MissingExtraError

if TYPE_CHECKING:
    from agonic.calibration.affine import Affine
    from agonic.live.streams import Source
    from agonic.live.web.session import Session
    from agonic.reference import Reference

PORT = 8737  # of the page


def live(
    source: str | None = None,
    out: Path = Path("live-agonic"),
    which: SensorChoice = SensorChoice(),
    place: Place = Place(),
    target: float = 0.5,
    before: list[Path] | None = None,
    speed: float = 1.0,
    port: int = PORT,
    listen: str | None = None,
    fresh: bool = False,
    browser: bool = True,
    text: bool = False,
    as_json: Json = False,
) -> int:
    """Calibrate while the sensor is being turned: what is covered, how good it is, what to do next.

    Opens a page on this machine; its button Accept writes what `agonic calibrate` writes. With
    --text or --json the same in the terminal, which ends when the target is reached or the source
    has ended. Readings that come without a unit stay raw. When it is stopped before Accept, the
    same command continues.

    Options
    -------
    source <[SOURCE]> : A serial port (/dev/ttyUSB0, COM3:57600), udp://[HOST]:PORT,
        tcp://HOST:PORT, each also after mavlink+, a log to replay, or sim. Without it: list the
        serial ports.
    out -o DIR : Folder to write to.
    target DEG : Standard error of the heading to reach.
    before CAL : Calibration to show beside the new one.
    speed : Speed of replay or sim; 0: as fast as possible.
    port ≥0 ≤65535 : Of the page; 0: any free.
    listen ADDR : Show the page to other machines, by a secret address.
    fresh --fresh : Start again where a session in DIR was not finished.
    browser --open/--no-open : Open the page in a browser.
    text --text : In the terminal, without a page.
    """
    from agonic.live.streams import open_source
    from agonic.live.web.plan import Plan
    from agonic.live.web.session import Session

    if source is None:
        return _list_ports()
    if not 0 < target < 180:
        raise AgonicError(f"a --target of {target:g}° is not possible; give one above zero")
    opened = open_source(source, unit=which.unit, speed=speed)
    _require_writable(out)
    reference, settings = _find_reference(opened, place)
    plan = Plan(
        folder=out,
        reference=reference,
        settings=settings,
        target_deg=target,
        sensor=which.sensor,
        before=_load_before(before or []),
        fresh=fresh,
    )
    session = Session(opened, plan)
    if text or as_json:
        from agonic.live.terminal import run_in_terminal

        return run_in_terminal(session, as_json)
    return _run_on_page(session, listen, port, browser)


def _find_reference(source: Source, place: Place) -> tuple[Reference | None, dict[str, Any]]:
    """What the field should be: as told, by the log that is replayed, or by the simulation."""
    import numpy as np

    from agonic.console.place import find_reference
    from agonic.live.streams.replay import FIELD_N, Replay
    from agonic.reference import Reference
    from agonic.samples import Samples

    played = source.sensors if isinstance(source, Replay) else ()
    if place.field is None and place.at is None and played and played[0].notes == ("simulated",):
        return Reference.vector(FIELD_N, frame="n", source="the simulation"), {}
    samples = played[0] if played else Samples(field=np.array([[0.0, 0.0, 1.0]]))
    reference, settings = find_reference(samples, *place)
    if reference is None:
        return None, settings
    told: dict[str, Any] = {"sd": reference.sd, "source": reference.source}
    if reference.kind == "vector" and reference.frame == "n":  # nobody goes far meanwhile
        return Reference.vector(reference.values.mean(axis=0), frame="n", **told), settings
    magnitude = float(reference.magnitudes(len(samples)).mean())
    return Reference.constant(magnitude, **told), settings


def _require_writable(folder: Path) -> None:
    """`AgonicError` where nothing can be written to a folder, before anybody turns a sensor."""
    from tempfile import TemporaryFile

    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    try:
        with TemporaryFile(dir=there):
            pass
    except OSError as error:
        raise AgonicError(
            f"cannot write to {folder}: {error.strerror or error}; give another folder with -o"
        ) from None


def _load_before(paths: list[Path]) -> dict[str, Affine]:
    """Calibrations by the name of their sensor."""
    from agonic.calibration.affine import Affine
    from agonic.files.calibration import load

    found: dict[str, Affine] = {}
    for path in paths:
        calibration = load(path)
        if not isinstance(calibration, Affine):
            raise AgonicError(f"{path} is not a calibration of bias and matrix")
        found[calibration.sensor] = calibration
    return found


def _list_ports() -> int:
    """Say which serial ports there are, and what else can be a source; nothing was done."""
    from agonic.console.output import say
    from agonic.live.streams.links import list_ports
    from agonic.live.streams.source import FORMS

    ports = list_ports()
    for device, what in ports:
        say(f"{device}  {what}")
    first = ports[0][0] if ports else "sim"
    if not ports:
        say("No serial port was found.")
    say(f"\nSources   {FORMS}\n\nNext      agonic live {first}")
    return 2


def _run_on_page(session: Session, listen: str | None, port: int, browser: bool) -> int:
    """Serve the page until interrupted; what the source does is said in the terminal too."""
    import sys
    import threading

    try:
        from agonic.live.web.server import serve
    except ImportError:
        raise MissingExtraError("the live page", "live") from None
    from agonic.console.output import say
    from agonic.live.terminal import Lines

    def ready(address: str) -> None:
        say(f"Live      {address}")
        say(f"Writes to {session.plan.folder}; Ctrl-C stops")
        for task in (tell, show) if browser and _has_screen() else (tell,):
            threading.Thread(target=task, args=(address,), daemon=True).start()

    def tell(address: str) -> None:
        lines = Lines(sys.stderr)
        while not stopped.wait(0.5):
            lines.show_source(session.status)

    def show(address: str) -> None:
        import webbrowser

        webbrowser.open(address)

    stopped = threading.Event()
    serve(session, listen=listen, port=port, ready=ready)
    stopped.set()
    say(session.closing_message)
    return 0


def _has_screen() -> bool:
    """Whether somebody sits before a screen: not a script, not a server."""
    import os
    import sys

    if not sys.stdout.isatty():
        return False
    shown = any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    return shown or sys.platform in ("win32", "darwin")
