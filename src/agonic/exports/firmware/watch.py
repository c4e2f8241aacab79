"""The monitor of two whole compasses as C99: the same tests, in single precision."""

from __future__ import annotations

import numpy as np

from agonic.calibration import monitoring as m
from agonic.exports.firmware.c_text import fill_template, write_comment
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
        "about": write_comment(write_about(plan)),
        "block_s": round(m.BLOCK_S),
        "false_alarm": f"{params.false_alarm_h:g}",
        "block": m.BLOCK_S,
        "kept": m.KEPT,
        "longer": m.LENGTHS[1],
        "shorter": m.LENGTHS[0],
        "passing": float(m.PASSING),
        "field": params.field,
        "horizontal": float(params.horizontal),
        "sine": vertical / params.field,
        "quiet": m.QUIET,
        "both": m.BOTH**2,
        "turned": m.TURNED,
        "lasting": m.LASTING,
        "tails": m.TAILS,
        "log_odds": np.log(m.ODDS),
        "keep": 1.0 - 1.0 / m.MEMORY,
        "fade": 1.0 - 1.0 / m.NOISE_MEMORY,
        "prior_count": float(m.NOISE_PRIOR),
        "prior": np.array(params.prior_sd) ** -2.0,
        "noise": np.array(params.noise_sd) ** 2,
        "alarm": params.alarm,
    }
    parts = ("rows", "test", "block")
    return {
        f"{name}_watch.h": fill_template("watch/header.h.in", values),
        f"{name}_watch.c": "\n".join(fill_template(f"watch/{p}.c.in", values) for p in parts),
    }
