"""Plan, record, check, calibrate and report: five sensors in a climatic chamber, end to end.

    python examples/thermal_campaign.py

The recordings are simulated after Nikolaev et al. 2023, so that the truth is known. With your own,
start at `read_campaign`.
"""

from pathlib import Path

import numpy as np

import agonic as ag
from agonic.thermal.plan.document import describe_plan

PUBLISHED = {
    "MMC5883MA-1": (5.44, 24.58, 1.11, 12.42),
    "MMC5883MA-2": (11.71, 2.43, 1.47, 5.98),
    "MPU-9255-1": (2.58, 1.40, 3.85, 1.18),
    "MPU-9255-2": (2.96, 4.89, 4.92, 2.81),
    "MPU-9255-3": (1.84, 1.19, 1.13, 1.63),
}  # largest of twelve standard deviations before over after: x, y, z, |B|

plan = ag.thermal.plan_thermal("2xMMC5883MA,3xMPU-9255", range_C=(-10, 50), rate_Hz=0.2)
Path("plan.html").write_text(describe_plan(plan).to_html(), encoding="utf-8")
print(f"{len(plan.stations)} stations, {plan.duration_s / 3600:.0f} h")

made = ag.thermal.simulate_campaign(plan, field_sd=50.0, seed=1)
ag.thermal.write_campaign(made.description, made.stations(), "recorded")

result = ag.thermal.calibrate_campaign(ag.thermal.read_campaign("recorded"))
for finding in result.findings:
    print(finding.severity, finding.sentence)
page = ag.thermal.campaign_page(
    result,
    title="Simulated campaign",
    beside=PUBLISHED,
    beside_words="published, of other sensors than these simulated ones",
)
Path("report.html").write_text(page, encoding="utf-8")

level = np.linspace(-10.0, 50.0, 61)
print("\nspread before / after: x, y, z, |B| (simulated; published of real sensors in brackets)")
for sensor in result.sensors:
    calibration = sensor.fit.calibration
    error = calibration.bias_at(level) - made.truth[sensor.name].bias_at(level)
    ratios = "  ".join(
        f"{ours:5.2f} ({theirs:5.2f})"
        for ours, theirs in zip(sensor.fit.spread.improvement, PUBLISHED[sensor.name], strict=True)
    )
    unseen = sensor.held_out.spread.improvement[3]
    rms = np.sqrt(np.mean(error**2))
    print(f"{sensor.name:12} {ratios}   |B| left out {unseen:5.2f}   bias to {rms:.0f} nT")

chamber = result.chamber_field
print(f"\nthe chamber's field changed by {chamber.common_sd:.0f} nT at a station; besides, nT:")
for share in chamber.shares:
    print(f"{share.name:12} noise {share.noise_sd:3.0f}   its own {share.own_sd:3.0f}")
