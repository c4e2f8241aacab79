"""Verify a calibration on another recording of the same sensor, and only then export it.

python examples/verify_and_export.py
"""

import agonic as ag

reference = ag.Reference.constant(50_000)
monday = ag.simulate("hand", seed=5)
tuesday = ag.simulate("tumble", calibration=monday.truth, seed=6)

calibration = ag.fit_ellipsoid(monday.samples, reference).calibration
verification = ag.verify(calibration, tuesday.samples, reference)

for check in verification.checks:
    print("passed" if check.passed else "failed", check.name, f"{check.value:.3g} {check.unit}")

if verification.passed:
    export = ag.write_ardupilot(calibration, "compass.param")
    print(export.path.read_text())
    for warning in export.warnings:
        print("warning:", warning)
