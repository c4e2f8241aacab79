"""Every command, where its function is, and under which heading help lists it."""

from __future__ import annotations

import tomllib
from pathlib import Path

EXAMPLES: dict[str, tuple[str, str]] = {
    command: (first, second)
    for command, (first, second) in tomllib.loads(
        Path(__file__).with_name("examples.toml").read_text("utf-8")
    ).items()
}
"""By the words that call a command: examples that are copied as they stand."""


GROUPS = {
    "Calibrate": {
        "calibrate": "agonic.cli.calibrate",
        "live": "agonic.live.command",
        "fit": "Fit one kind of calibration to a log.",
        "verify": "agonic.cli.verify",
        "evaluate": "agonic.recording.commands.evaluate",
        "demo": "agonic.recording.commands.demo",
    },
    "Heading": {
        "heading": "agonic.headings.commands.heading",
        "field": "agonic.cli.field",
        "direction": "agonic.cli.direction",
    },
    "Missions": {
        "track": "agonic.inflight.commands.track",
        "retrain": "agonic.network.commands.retrain",
    },
    "Laboratory": {
        "plan": "Plan the data to take, with the standard errors to expect.",
        "simulate": "Write readings of a simulated sensor or vehicle, and the truth beside them.",
        "reproduce": "agonic.reproduce.command",
    },
    "Fleet": {
        "fleet": "agonic.fleet.commands.fleet",
        "history": "agonic.history.command",
    },
    "Files": {
        "info": "agonic.recording.commands.info",
        "apply": "agonic.cli.apply",
        "export": "agonic.cli.export",
        "report": "agonic.cli.report",
        "cite": "agonic.cli.cite",
    },
}
"""The commands and their modules, under the headings and in the order of `agonic --help`; of those
that have kinds, what they are for."""

COMMANDS = [name for group in GROUPS.values() for name in group]
"""The names of all commands."""

_FIT = "agonic.alignment.commands.fit"
_AIDED = "agonic.recording.commands.fit_affine:aided"
_PLAN = "agonic.recording.commands.plan"
_MOTIONS = ["tumble", "sphere", "belt", "hand", "circle", "flight", "boat", "car", "static"]
_MOTION = "agonic.cli.simulate:motion"
_NETWORK = "agonic.network.commands.simulate_network"
_SESSION = "agonic.alignment.commands.simulate"

KINDS = {
    "fit": {
        "Calibrate": {
            "ellipsoid": "agonic.recording.commands.fit_affine",
            **dict.fromkeys(("levelled", "inertial", "vector", "interference"), _AIDED),
            "pair": "agonic.inertial.commands.fit_pair",
            "latency": "agonic.attitude.command",
            "network": "agonic.network.commands.fit_network",
        },
        "Heading": {"deviation": "agonic.headings.commands.fit_deviation"},
        "Missions": {"inflight": "agonic.inflight.commands.fit_inflight"},
        "Laboratory": {
            "thermal": "agonic.thermal.commands.fit:fit_chamber",
            **dict.fromkeys(("alignment", "north", "coil", "gravity", "remanence"), _FIT),
        },
    },
    "plan": {
        "Calibrate": dict.fromkeys(("calibration", "disturbers", "placement"), _PLAN),
        "Heading": {"swing": "agonic.headings.commands.plan_swing"},
        "Laboratory": {
            "thermal": "agonic.thermal.commands.plan:plan_chamber",
            "alignment": "agonic.alignment.commands.plan_alignment",
        },
    },
    "simulate": {
        "One sensor in motion": {
            **dict.fromkeys(_MOTIONS, _MOTION),
            "shots": "agonic.inertial.commands.simulate_shots",
        },
        "Vehicles and missions": {
            "vehicle": "agonic.cli.simulate",
            "rover": "agonic.cli.simulate",
            "orbit": "agonic.cli.simulate",
            **dict.fromkeys(("paper", "paper-space", "network", "nonaffine"), _NETWORK),
        },
        "Laboratory": {
            "campaign": "agonic.thermal.commands.simulate",
            **dict.fromkeys(("alignment", "north", "coil"), _SESSION),
        },
        "Fleet": {"fleet": "agonic.fleet.commands.simulate_fleet"},
    },
}
"""The kinds of a command and their modules, under the headings and in the order of its help; the
name of the function follows where it is another."""
