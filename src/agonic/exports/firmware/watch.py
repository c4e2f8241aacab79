"""The monitor of two whole compasses as C99: the same tests, in single precision."""

from __future__ import annotations

import numpy as np

from agonic.calibration import monitoring as m
from agonic.exports.firmware.c_text import (
    fill_template,
    write_array,
    write_comment,
    write_integer,
    write_literal,
)
from agonic.exports.firmware.plan import Plan
from agonic.exports.firmware.sources import write_about


def write_watch(plan: Plan, name: str) -> dict[str, str]:
    """The text of `{name}_watch.h` and `{name}_watch.c`; none where there are not two compasses."""
    if not plan.watched:
        return {}
    horizontal, vertical = plan.setup.horizontal, plan.setup.vertical
    assert horizontal is not None
    assert vertical is not None
    params = m.derive_monitor_params(plan.setup, float(np.hypot(horizontal, vertical)), horizontal)
    values = {
        "name": name,
        "GUARD": name.upper(),
        "about": write_comment(write_about(plan)),
        "false_alarm": f"{params.false_alarm_h:g}",
        "block": write_literal(m.BLOCK_S),
        "kept": str(m.KEPT),
        "longer": str(m.LENGTHS[1]),
        "shorter": str(m.LENGTHS[0]),
        "passing": write_literal(m.PASSING),
        "field": write_literal(params.field),
        "horizontal": write_literal(params.horizontal),
        "sine": write_literal(vertical / params.field),
        "quiet": write_literal(m.QUIET),
        "both": write_literal(m.BOTH**2),
        "turned": write_literal(m.TURNED),
        "lasting": write_literal(m.LASTING),
        "tails": write_literal(m.TAILS),
        "log_odds": write_literal(np.log(m.ODDS)),
        "keep": write_literal(1.0 - 1.0 / m.MEMORY),
        "fade": write_literal(1.0 - 1.0 / m.NOISE_MEMORY),
        "prior_count": write_literal(m.NOISE_PRIOR),
        "prior": write_array(np.array(params.prior_sd) ** -2.0),
        "noise": write_array(np.array(params.noise_sd) ** 2),
        "alarm": write_array(params.alarm),
    }
    values["block_s"] = write_integer(m.BLOCK_S)
    parts = ("rows", "test", "block")
    return {
        f"{name}_watch.h": fill_template("watch/header.h.in", values),
        f"{name}_watch.c": "\n".join(fill_template(f"watch/{p}.c.in", values) for p in parts),
    }
