"""`agonic fit network LOG`: a network on top of an affine calibration, or the table of nodes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from agonic.console import options
from agonic.console.parse import parse_names, parse_nodes
from agonic.console.sensors import open_sensor

if TYPE_CHECKING:
    from agonic.reference import Reference
    from agonic.samples import Samples


def network(
    log: options.LogPath,
    reference: options.KnownField = None,
    out: options.Out = None,
    hidden: str = "3",
    inputs: str = "field",
    base: str = "affine",
    target: str | None = None,
    stopping: str = "bayesian",
    select: bool = False,
    compare: bool = False,
    figure: Path | None = None,
    which: options.SensorChoice = options.SensorChoice(),
    place: options.Place = options.Place(),
    robust: options.Robust = True,
    seed: int = 0,
    between: options.Between = None,
    report: Path | None = None,
    as_json: options.Json = False,
) -> int:
    """A network where no affine calibration is enough; it is written only where it is better.

    Options
    -------
    hidden NODES : Nodes of the hidden layer; 5,3: of two layers.
    inputs NAMES : What goes in: field, temperature, temperature_rate, current_A, throttle, second,
        or any column such as motor1_duty.
    base CAL : Calibration under it: a file, affine, or none.
    target : vector, or magnitude; default: vector where the attitude is known.
    stopping : Against overfitting: bayesian, early or plain.
    select --select : Make the table of 7 to 2 hidden nodes, and choose.
    compare --compare : Train it by gradient descent as well, to compare.
    figure SVG : Chart of training or table; needs agonic[plot].
    seed : Seed of the random starts.
    report HTML : Page to write about the fit.
    """
    from agonic.atomic import write_atomically
    from agonic.console.finish import finish
    from agonic.console.progress import progress
    from agonic.network.fit import choose_network, compare_methods, fit_network
    from agonic.network.report.document import describe_network
    from agonic.network.report.figures import draw_chart

    samples = open_sensor(log, *which, between)
    samples, known = _known(samples, log, reference, which.unit, place)
    settings: dict[str, Any] = {
        "inputs": parse_names(inputs),
        "base": _base(base),
        "target": target or _target(samples, known),
        "stopping": stopping,
        "robust": robust,
        "seed": seed,
    }
    choice = None
    if select:
        choice = choose_network(
            samples, known, progress=lambda nodes: progress(nodes, "Training"), **settings
        )
    nodes = choice.fit.calibration.shape.hidden if choice else parse_nodes(hidden)
    fit = choice.fit if choice else fit_network(samples, known, hidden=nodes, **settings)
    methods = compare_methods(samples, known, hidden=nodes, **settings) if compare else ()
    files = []
    if figure:
        files.append(write_atomically(figure, draw_chart(fit, choice)))
    document = describe_network(fit, samples, choice=choice, methods=methods, title=log.name)
    return finish(document, out=out, files=files, report=report, as_json=as_json)


def _known(
    samples: Samples, log: Path, given: str | None, unit: str | None, place: options.Place
) -> tuple[Samples, Reference]:
    """The rows whose field is known, and that field."""
    from agonic.console.place import find_reference, match_known_field
    from agonic.errors import AgonicError

    if given is not None:
        return match_known_field(samples, given, log, unit)
    found, _ = find_reference(samples, *place)
    if found is None:
        raise AgonicError(
            "the field that the sensor was in is not known: give it with --reference, the "
            "place with --at LAT,LON and --date, or its magnitude with --field"
        )
    return samples, found


def _base(text: str) -> Any:
    """What --base names."""
    from agonic.errors import AgonicError
    from agonic.files.calibration import load

    if text in ("affine", "none"):
        return None if text == "none" else text
    if not Path(text).exists():
        raise AgonicError(f"--base {text!r} is neither affine, none, nor a calibration file")
    return load(text)


def _target(samples: Samples, reference: Reference, calibration: Any = None) -> str:
    """The vector where its components are known in the axes of the sensor or of the calibration.

    A field known through the attitude is in the body's axes; a calibration that ends in the
    sensor's own says nothing of how the sensor is mounted: then the magnitude alone teaches.
    """
    attitude = (samples.roll_deg, samples.pitch_deg, samples.heading_deg)
    turned = reference.frame == "n" and not samples.heading_estimated
    known = reference.frame in ("m", "b") or (turned and all(a is not None for a in attitude))
    frame = "b" if turned else reference.frame
    meets = calibration is None or calibration.frame_out == frame
    return "vector" if reference.kind == "vector" and known and meets else "magnitude"
