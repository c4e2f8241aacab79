"""Calibrate one magnetometer of a recording, look at the evidence, and save the result.

    python examples/calibrate_from_python.py

The recording is simulated, so that the truth is known. With your own, start at `ag.read`.
"""

import agonic as ag
from agonic.simulation import with_outliers

made = ag.simulate("hand", noise=200.0, defects=[with_outliers(0.02)], seed=3)
ag.write_csv(made.samples, "recording.csv")

samples = ag.read("recording.csv")
reference = ag.Reference.constant(50_000, source="measured beside the sensor")
result = ag.calibrate(samples, reference)
fit = result.fit

print(f"{result.verdict}: {result.status}")
for finding in fit.findings:
    print(f"  {finding.severity} {finding.name}: {finding.sentence}")
for check in result.verification.checks:
    print(f"  {check.name}: {check.value:.3g} {check.unit}")

print("bias, nT   ", fit.calibration.bias.round(1))
print("sd, nT     ", fit.sd[:3].round(1))
print("truth, nT  ", made.truth.bias.round(1))
print(f"heading to {fit.coverage.heading_sd_deg:.3f}°")

if fit.ok:
    ag.save(fit.calibration, "recording.json")
