"""Vehicles of random parts."""

import numpy as np

from agonic.placement.layout import Layout, Part, Region, Wire


def make_layout(seed: int) -> Layout:
    """A vehicle of 2 to 8 dipoles, one to three wires, a plate and a mast that are allowed."""
    rng = np.random.default_rng(seed)
    parts = [
        Part(
            name=f"part {k}",
            position_m=tuple(rng.uniform([-0.25, -0.25, -0.02], [0.25, 0.25, 0.06])),
            position_sd_m=rng.uniform(0.001, 0.005),
            moment_A_m2=tuple(rng.normal(size=3) * 0.03),
            moment_sd_A_m2=rng.uniform(0.001, 0.005),
            induced_m3=tuple(np.abs(rng.normal(size=3)) * 5e-6),
            induced_sd_m3=1e-6,
        )
        for k in range(rng.integers(2, 9))
    ]
    wires = [
        Wire(
            name=f"wire {k}",
            points_m=np.cumsum(rng.normal(size=(4, 3)) * [0.08, 0.08, 0.01], axis=0).tolist(),
            current_A=(1.0, rng.uniform(5.0, 20.0)),
            position_sd_m=0.002,
        )
        for k in range(rng.integers(1, 4))
    ]
    plate = Region(
        name="plate", corner_m=(-0.2, -0.1, -0.1), edges_m=[(0.4, 0.0, 0.0), (0.0, 0.2, 0.0)]
    )
    mast = Region(name="mast", corner_m=(0.1, 0.0, -0.1), edges_m=[(-0.02, 0.0, -0.15)])
    return Layout(name=f"vehicle {seed}", regions=[plate, mast], parts=parts, wires=wires)
