"""`RetrainerParams` and `RetrainerState`: how a network is kept up to date, and where it stands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from math import inf, isfinite
from typing import Annotated, Literal, get_args

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.calibration.affine import Affine
from agonic.calibration.network import Along, Network, require_nodes
from agonic.calibration.sources import check_inputs
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError, check_choice
from agonic.maths.equation.network import Nodes
from agonic.maths.estimation.changes import cusum
from agonic.readable import Shown

Running = Affine | Thermal | Network
Why = Literal["period", "change", "settling"]

MAX_RETRAININGS = 1000
"""So many of the last retrainings are remembered."""
MIN_ROWS = 50
"""Readings without which nothing is trained; the base takes twelve numbers from them."""


@dataclass(frozen=True, kw_only=True)
class RetrainerParams:
    """How a network is kept up to date.

    Parameters
    ----------
    window_n : readings that a training sees at most; memory is bounded by it.
    window_s : seconds that it sees at most; None: as many as `window_n` readings last.
    every_n, every_s : readings or seconds from one retraining to the next; None: whenever all of
        the window is new.
    target : "vector", or "magnitude" where the attitude is not known.
    hidden, inputs, base, seed : of a network where there is none yet, as in `fit_network`; base is
        "affine", or None to leave everything to the network.
    bias_sd, matrix_sd : how far the base may move from one training to the next: the field that a
        bias adds, and an entry of the matrix, as shares of the field.
    shift_sd : the smallest change of the mean of the residual that counts as a change, in its
        standard deviations. alarm : how much of it has to add up (see
        `maths.estimation.changes.cusum`); 0: never.
    fewest : readings after a change before it is learned.
    misfit : a residual so many times what it was is that of a changed sensor, and a candidate whose
        unseen error is so many times that is rejected.
    furthest : likewise one that moves the field by more than this share of it.

    Examples
    --------
    >>> RetrainerParams(window_s=15.0).target
    'vector'
    """

    window_n: int = 3000
    window_s: float | None = None
    every_n: int | None = None
    every_s: float | None = None
    target: Along = "vector"
    hidden: Nodes = 3
    inputs: tuple[str, ...] = ("field",)
    base: Literal["affine"] | None = "affine"
    seed: int = 0
    bias_sd: float = 0.05
    matrix_sd: float = 0.002
    shift_sd: float = 2.0
    alarm: float = 10.0
    fewest: int = MIN_ROWS
    misfit: float = 3.0
    furthest: float = 0.1

    def __post_init__(self) -> None:
        check_choice("target", self.target, get_args(Along))
        object.__setattr__(self, "inputs", tuple(self.inputs))
        object.__setattr__(self, "hidden", require_nodes(self.hidden))
        check_inputs(self.inputs)
        if self.base is None and self.target == "magnitude":
            raise AgonicError('target="magnitude" determines a length only, so it needs a base')
        for name in (
            "window_s",
            "every_n",
            "every_s",
            "bias_sd",
            "matrix_sd",
            "shift_sd",
            "misfit",
            "furthest",
        ):
            value = getattr(self, name)
            if value is not None and not (value > 0 and isfinite(value)):
                raise AgonicError(f"{name} is {value}; it must be above zero")
        if not (self.alarm >= 0 and isfinite(self.alarm)):
            raise AgonicError(f"alarm is {self.alarm}; it must be zero or more")
        if self.fewest < MIN_ROWS:
            raise AgonicError(f"fewest is {self.fewest}; a training takes at least {MIN_ROWS}")
        if self.window_n < self.fewest:
            raise AgonicError(
                f"a window of {self.window_n} readings is shorter than the {self.fewest} that a "
                "training takes; make it longer"
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class Window:
    """The last readings: time (k,) s, raw (k, 3), the known field (k, 3) or magnitude (k, 1), nT,
    and the columns beside them."""

    time: Array
    raw: Array
    wanted: Array
    columns: Mapping[str, Array] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.time)

    def select(self, rows: slice | Index | Mask) -> Window:
        """Some of the rows."""
        return Window(
            time=self.time[rows],
            raw=self.raw[rows],
            wanted=self.wanted[rows],
            columns={name: values[rows] for name, values in self.columns.items()},
        )

    def with_rows(self, more: Window) -> Window:
        """These rows and then those."""
        if not len(self):
            return more
        return Window(
            time=np.concatenate([self.time, more.time]),
            raw=np.concatenate([self.raw, more.raw]),
            wanted=np.concatenate([self.wanted, more.wanted]),
            columns={n: np.concatenate([v, more.columns[n]]) for n, v in self.columns.items()},
        )


@dataclass(frozen=True, kw_only=True)
class Retraining:
    """One retraining: when, why, and what came of it.

    `time` s and `n` are those of the last reading it saw; `why` is "period", "change", or
    "settling", when more readings after a change were there; `onset` s is where that change began,
    None where the residual grew too little for one, so that readings from before still counted.
    `accepted` says whether the candidate replaced what was running, `reason` why, and `poisoned`
    that it was the readings that were at fault. `what` names the candidate, `rows` how many
    readings it was trained on, and `epochs` how long. The unseen rms errors on an axis, nT, of
    what was running and of the candidate are NaN where there were none.
    """

    time: Annotated[float, Shown(key="time_s")]
    n: Annotated[int, Shown()]
    why: Annotated[Why, Shown()]
    accepted: Annotated[bool, Shown()]
    reason: Annotated[str, Shown()]
    rows: Annotated[int, Shown()]
    what: Annotated[str, Shown(key="candidate")] = ""
    poisoned: Annotated[bool, Shown()] = False
    running_rms: Annotated[float, Shown(key="running_rms_nT")] = float("nan")
    candidate_rms: Annotated[float, Shown(key="candidate_rms_nT")] = float("nan")
    onset: Annotated[float | None, Shown(key="onset_s")] = None
    epochs: Annotated[int, Shown()] = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class RetrainerState:
    """Where a network that is kept up to date stands: everything that the next reading needs.

    `running` is what corrects now, None before the first training, and `window` the last readings;
    `n` readings were seen, the last at `time` s since `epoch`. `noise` (nT on an axis) and
    `correlation` are those of the residual while nothing changes, which the sums `watch` are taken
    with. After an alarm the change began with reading number `onset`, and is learned when `wait`
    readings after it are there; after that, again when the window holds `settling`. A fainter alarm
    is `early`: it brings the next retraining forward to when the window is full, which fills from
    reading `since_n` at `since_time` on. The next periodical retraining is due at reading `due_n`
    or at `due_time`. `covariance` (k, k) is that of the errors of what is running, as the last
    training left it, None before; reading `learned` is the first that no accepted training saw, and
    the `reservoir` keeps readings of before. `retrainings` are the last ones, `accepted` and
    `rejected` how many there were in all; `source` is the last reference.
    """

    running: Running | None
    window: Window
    reservoir: Window
    watch: cusum.Sums
    wait: int
    noise: Annotated[float | None, Shown(key="noise_nT")] = None
    correlation: float = 1.0
    n: Annotated[int, Shown()] = 0
    time: float = -inf
    epoch: datetime | None = None
    onset: int | None = None
    settling: int | None = None
    early: bool = False
    since_n: int = 0
    since_time: float = -inf
    due_n: float = inf
    due_time: float = inf
    covariance: Array | None = None
    learned: int = 0
    retrainings: tuple[Retraining, ...] = ()
    accepted: Annotated[int, Shown()] = 0
    rejected: Annotated[int, Shown()] = 0
    sensor: Annotated[str, Shown()] = "mag"
    reference_sd: float = 0.0
    source: str = ""
    unit: str = "nT"
    frame_in: str = "m"
    frame_out: str = "m"
    device_id: int | None = None

    @property
    def first(self) -> int:
        """The number of the first reading in the window."""
        return self.n - len(self.window)

    @property
    def changes(self) -> tuple[Retraining, ...]:
        """The retrainings that followed a change, of those that are remembered."""
        return tuple(one for one in self.retrainings if one.accepted and one.onset is not None)
