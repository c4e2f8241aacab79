"""`agonic fit latency LOG`: how late a magnetometer's readings are."""

from __future__ import annotations

from agonic.console.options import Json, LogPath, SensorChoice
from agonic.console.sensors import open_sensors


def latency(
    log: LogPath,
    which: SensorChoice = SensorChoice(),
    method: str = "auto",
    limit_ms: float | None = None,
    as_json: Json = False,
) -> int:
    """The delay of the readings relative to the attitude or the gyro of the log.

    Options
    -------
    method : auto, attitude, tilt or gyro.
    limit_ms --limit MS : Largest latency sought, ms; default: 300, and 1000 where it lies beyond.
    """
    from typing import Any, cast

    from agonic.attitude.latency import fit_latency
    from agonic.console.output import print_json, say

    limit_s = None if limit_ms is None else limit_ms / 1000
    _, sensors = open_sensors(log, *which)
    fits = {
        samples.name: fit_latency(samples, method=cast(Any, method), limit_s=limit_s)
        for samples in sensors
    }
    if as_json:
        print_json(
            "agonic/fit-latency@1",
            {
                "log": str(log),
                "sensors": [
                    {
                        "sensor": name,
                        "latency_ms": 1000 * fit.latency_s,
                        "latency_sd_ms": 1000 * fit.sd_s,
                        "significant": fit.significant,
                        "known": fit.known,
                        "method": fit.method,
                        "n": fit.n,
                        "unit": fit.unit,
                        "residual_before": fit.residual_before,
                        "residual_after": fit.residual_after,
                        "status": fit.status,
                    }
                    for name, fit in fits.items()
                ],
            },
        )
    else:
        for name, fit in fits.items():
            say(f"{name}: {fit.status}")
            say(
                f"  {fit.n} readings; residual {fit.residual_before:.4g} {fit.unit} without, "
                f"{fit.residual_after:.4g} {fit.unit} with the latency"
            )
    return 0 if all(fit.known for fit in fits.values()) else 1
