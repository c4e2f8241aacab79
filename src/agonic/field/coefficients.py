"""Gauss coefficients, and the two file formats that they are published in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agonic.arrays import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class GaussCoefficients:
    """Coefficients that are linear in time between epochs.

    From `starts[i]` (i,), a decimal year, to the next epoch and at last to `until`, the
    coefficients are value[i] + (year − starts[i]) · rate[i]; `value`, `rate` (i, 2, N+1, N+1) hold
    g and h, Schmidt semi-normalised, by degree and order, in nT and nT/year.
    """

    starts: Array
    until: float
    value: Array
    rate: Array


def read_shc(text: str) -> GaussCoefficients:
    """The SHC format of the Swarm mission and the IGRF: one column for each epoch. After comments,
    a line of lowest and highest degree and number of epochs, then the epochs, then a line for each
    coefficient: degree, order (negative for h), and its value at each epoch."""
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    top = int(lines[0].split()[1])
    epochs = np.array(lines[1].split(), dtype=np.float64)
    table = np.array([line.split() for line in lines[2:]], dtype=np.float64)
    degree, order = table[:, 0].astype(int), table[:, 1].astype(int)
    nodes = np.zeros((len(epochs), 2, top + 1, top + 1))
    nodes[:, (order < 0).astype(int), degree, np.abs(order)] = table[:, 2:].T
    rate = np.diff(nodes, axis=0) / np.diff(epochs)[:, None, None, None]
    return GaussCoefficients(
        starts=epochs[:-1], until=float(epochs[-1]), value=nodes[:-1], rate=rate
    )


def read_cof(text: str) -> GaussCoefficients:
    """The COF format of the World Magnetic Model: one epoch, valid for five years. After a line
    with the epoch, a line for each degree and order: g, h, and their yearly change; a line of nines
    ends the file."""
    header, *lines = text.splitlines()
    rows = [line.split() for line in lines if line.strip() and not line.startswith("9999")]
    table = np.array(rows, dtype=np.float64)
    degree, order = table[:, 0].astype(int), table[:, 1].astype(int)
    both = np.zeros((2, 2, degree.max() + 1, degree.max() + 1))
    both[:, :, degree, order] = table[:, 2:6].T.reshape(2, 2, -1)
    epoch = float(header.split()[0])
    return GaussCoefficients(
        starts=np.array([epoch]), until=epoch + 5.0, value=both[:1], rate=both[1:]
    )
