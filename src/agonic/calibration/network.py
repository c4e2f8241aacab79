"""`Network`: a network of one or two hidden layers on top of an affine or thermal calibration."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array, Mask
from agonic.calibration.affine import Affine
from agonic.calibration.base import Correction, Validity, lock_arrays, require_covariance
from agonic.calibration.interference import Interference
from agonic.calibration.schema_fields import (
    DeviceId,
    Frame,
    NotNegative,
    Row,
    Rows,
    Sensor,
    Unit,
    described,
    stored,
)
from agonic.calibration.sources import check_inputs, measure_width, stack_inputs
from agonic.calibration.thermal import Thermal
from agonic.calibration.timing import Timing
from agonic.errors import AgonicError, AgonicWarning, FrameError, UnitError
from agonic.maths.equation import network as kernel
from agonic.maths.estimation import domain
from agonic.provenance import Provenance

Along = Literal["vector", "magnitude"]
MOST_HIDDEN = 64


@dataclass(frozen=True, kw_only=True, eq=False)
class Network(Correction):
    """The correction field = base(raw) + g(x) · (middle + half · V [tanh(U [x, 1]), 1]).

    With a second hidden layer it is V [tanh(W [tanh(U [x, 1]), 1]), 1].
    x are the inputs, scaled to −1…1 over the readings it was trained on; g is 1 there, falls to 0
    at twice the distance that training rows have from the stored `centres`, and the correction is
    never longer than `bound`: far away the base is all that is left. A network with one output
    corrects along the field only. Without a base the network gives the whole field; there is then
    nothing to fall back to, g is 1, and only the warning is left.

    Parameters
    ----------
    base : an `Affine` (or `Interference`), a `Thermal`, or None.
    inputs : names of what goes in: "field" (the readings), "temperature", "temperature_rate",
        "current_A", "throttle", "second", or a disturber's column, as "motor1_duty".
    input_middle, input_half : (i,) x = (input − middle) / half.
    output_middle, output_half : (o,) and a number, nT; o is 3, or 1 along the field.
    hidden : (h, i+1) U: the weights of each node and, last, its constant.
    second : (k, h+1) W: the nodes of a second hidden layer, likewise; None: there is one layer.
    output : (o, h+1) V, likewise, or (o, k+1).
    covariance : (m, m) of U row by row, then W, then V; or None where it is not known.
    centres, reach : (k, i) points among the inputs it was trained on, and the largest distance of
        a training row from them, in x.
    bound : nT, the longest correction; None without a base.
    misfit : nT, standard deviation on an axis of what the base leaves (without a base: of the
        field), which is what may be wrong outside.
    unmodelled : nT, standard deviation on an axis of what the network itself leaves inside.
    base_sd_ratio : standard errors of the base inside, over those it has by itself: less than 1
        where it was fitted with the network, whose smaller residuals tell better.
    held : inputs that are no longer taken from the samples but stay at a value (see `at`).

    The others as in `Affine`.

    Examples
    --------
    >>> flat = Affine(bias=[100.0, 0.0, 0.0], matrix=np.eye(3))
    >>> bent = Network(
    ...     base=flat, inputs=("field",), input_middle=np.zeros(3), input_half=np.full(3, 1e4),
    ...     output_middle=np.zeros(3), output_half=50.0, hidden=[[1.0, 0.0, 0.0, 0.0]],
    ...     output=[[1.0, 0.0], [0.0, 0.0], [0.0, 0.0]], centres=[[0.0, 0.0, 0.0]], reach=1.0,
    ...     bound=60.0,
    ... )
    >>> bent.correct([[10_000.0, 0.0, 0.0]]).round(3)  # 50 tanh(1) more than the base
    array([[9938.08,    0.  ,    0.  ]])
    """

    kind: ClassVar[str] = "network"

    base: Affine | Thermal | None
    inputs: Annotated[
        tuple[str, ...],
        described(
            "What goes in, in order: field (the reading, unit_in), temperature, "
            "temperature_rate, current_A, throttle, second, or a column such as motor1_duty.",
            min_length=1,
        ),
    ]
    input_middle: Annotated[Array, stored(Row, "x = (input − middle) / half.")]
    input_half: Annotated[Array, stored(Row, "x = (input − middle) / half.")]
    output_middle: Annotated[Array, stored(Row, "Three, or one along the field, unit_out.")]
    output_half: Annotated[float, described("From output 0 to 1, unit_out.", gt=0)]
    hidden: Annotated[Array, stored(Rows, "U: a row a node, its constant last.", min_length=1)]
    output: Annotated[Array, stored(Rows, "V: a row an output, its constant last.", min_length=1)]
    centres: Annotated[Array, stored(Rows, "Points that cover the training, in x.", min_length=1)]
    reach: Annotated[
        float,
        described("g(x) is 1 so far from the nearest centre, 0 at twice as far.", gt=0),
    ]
    second: Annotated[
        Array | None,
        stored(Rows | None, "W: the nodes of a second hidden layer; null: there is one."),
    ] = None
    bound: Annotated[NotNegative | None, described("The longest correction, unit_out.")] = None
    misfit: Annotated[
        NotNegative | None, described("What the base leaves on an axis, sd, unit_out.")
    ] = None
    unmodelled: Annotated[
        NotNegative, described("What the network leaves inside on an axis, sd, unit_out.")
    ] = 0.0
    base_sd_ratio: Annotated[
        NotNegative, described("Standard errors of the base inside, over its own.")
    ] = 1.0
    covariance: Annotated[Array | None, stored(Rows | None, "Of U row by row, then W, then V.")] = (
        None
    )
    held: Annotated[
        Mapping[str, float],
        stored(dict[str, float], "Inputs that stay at a value instead of being read."),
    ] = field(default_factory=dict)
    unit_in: Unit = "nT"
    unit_out: Unit = "nT"
    magnitude: Annotated[
        NotNegative | None,
        described("Field magnitude it was trained in, in unit_out."),
    ] = None
    noise: Annotated[
        NotNegative | None,
        described("Standard deviation of what is left on an axis, in unit_out."),
    ] = None
    sensor: Sensor = "mag"
    device_id: DeviceId = None
    frame_in: Frame = "m"
    frame_out: Frame = "m"
    validity: Validity = field(default_factory=Validity)
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        object.__setattr__(self, "inputs", tuple(self.inputs))
        check_inputs(self.inputs)
        i, (h, o) = (
            sum(measure_width(name) for name in self.inputs),
            (len(self.hidden), len(self.output)),
        )
        if o not in (1, 3) or (o == 1 and self.base is None):
            raise AgonicError(f"{o} outputs: a network gives three, or one along a base's field")
        last = h if self.second is None else len(self.second)
        lock_arrays(
            self,
            input_middle=(i,),
            input_half=(i,),
            output_middle=(o,),
            hidden=(h, i + 1),
            second=(last, h + 1),
            output=(o, last + 1),
            centres=(len(np.asarray(self.centres)), i),
        )
        lock_arrays(self, covariance=(self.shape.size,) * 2)
        if not (self.reach > 0 and self.output_half > 0 and (self.input_half > 0).all()):
            raise AgonicError("reach and half ranges of a network must be above zero")
        self._meet_base()

    def _meet_base(self) -> None:
        """The base starts and ends where the network does, and has a bound."""
        if self.base is None:
            return
        if self.bound is None:
            raise AgonicError("a network on a base needs a bound, nT")
        if (self.base.frame_in, self.base.frame_out) != (self.frame_in, self.frame_out):
            raise FrameError(
                "a network and its base must share their axes",
                left=self.base.frame_in + self.base.frame_out,
                right=self.frame_in + self.frame_out,
            )
        if (self.base.unit_in, self.base.unit_out) != (self.unit_in, self.unit_out):
            raise UnitError(
                f"a network and its base must share their units: {self.base.unit_in} to "
                f"{self.base.unit_out}, and {self.unit_in} to {self.unit_out}"
            )

    @property
    def needs(self) -> tuple[str, ...]:
        """The columns of the samples that it takes beside the readings."""
        own = [name for name in self.inputs if name != "field" and name not in self.held]
        return tuple(dict.fromkeys((*(() if self.base is None else self.base.needs), *own)))

    @property
    def timing(self) -> dict[str, Timing]:
        """How the columns that its base takes go with what they do."""
        return self.base.timing if isinstance(self.base, Interference) else {}

    @property
    def shape(self) -> kernel.Shape:
        """How many inputs, hidden nodes and outputs."""
        return kernel.shape_of(self.layers)

    @property
    def layers(self) -> kernel.Layers:
        """U and V, or U, W and V."""
        if self.second is None:
            return self.hidden, self.output
        return self.hidden, self.second, self.output

    @property
    def weights(self) -> Array:
        """All weights (m,), in the order of `covariance`; what a later training starts from."""
        return kernel.join(*self.layers)

    @property
    def target(self) -> Along:
        """Its reference: "vector" corrects all components, "magnitude" along the field only."""
        return "vector" if len(self.output) == 3 else "magnitude"

    @property
    def sd(self) -> Array | None:
        """Standard deviations of the weights (m,)."""
        return None if self.covariance is None else np.sqrt(np.diag(self.covariance))

    def correct(self, raw: ArrayLike, **columns: ArrayLike) -> Array:
        """The calibrated field of readings (…, 3) beside the columns that it needs.

        Parameters: raw (…, 3) in `unit_in`; columns (…) that are named in `needs`.

        Warns (`AgonicWarning`) of readings outside what it was trained on.
        """
        field, inside = self.evaluated(raw, columns)
        if (inside < 0.5).any():
            warnings.warn(self._beyond(inside < 0.5), AgonicWarning, stacklevel=2)
        return field

    def evaluated(self, raw: ArrayLike, columns: Mapping[str, ArrayLike]) -> tuple[Array, Array]:
        """The calibrated field (…, 3), and the share g (…) of the correction that is in it.

        Parameters: raw (…, 3) in `unit_in`; columns (…) that are named in `needs`.
        """
        x = self.scaled(raw, columns)
        inside = self._inside(x)
        added = self._bound(self.output_middle + self.output_half * kernel.forward(self.layers, x))
        if self.base is None:
            return added, inside
        field = self._apply_base(raw, columns)
        if len(self.output) == 1:
            added = added * _unit(field)
        return np.asarray(field + inside[..., None] * added), inside

    def uncertainty(self, raw: ArrayLike, **columns: ArrayLike) -> Array:
        """Covariance (n, 3, 3) of the calibrated field that the calibration itself contributes.

        Parameters: raw (n, 3) in `unit_in`; columns (n,) that are named in `needs`.

        With J = ∂correction/∂weights, P the directions that the network corrects (all, or along the
        field), and q `base_sd_ratio`:

            K C_base K + g² P (J C Jᵀ + unmodelled² I) P + (1 − g)² misfit² I,   K = I − (1 − q) g P

        Outside the base is all there is, and may err by what the network corrected inside.
        """
        covariance = require_covariance(self.covariance)
        rows = np.atleast_2d(np.asarray(raw, dtype=np.float64))
        x = np.broadcast_to(self.scaled(rows, columns), (len(rows), self.shape.inputs))
        g = self._inside(x)[:, None, None]
        jacobian = self.output_half * kernel.jacobian(self.layers, x)
        own = jacobian @ covariance @ np.swapaxes(jacobian, 1, 2)
        own = own + self.unmodelled**2 * np.eye(len(self.output))
        if self.base is None:
            return np.asarray(own + _isotropic((1 - g) * (self.misfit or 0.0)))
        along = _unit(self._apply_base(rows, columns))[:, :, None]
        onto = np.eye(3) if len(self.output) == 3 else along * np.swapaxes(along, 1, 2)
        left = np.eye(3) - (1.0 - self.base_sd_ratio) * g * onto
        below = self.base.uncertainty(rows, **self._for_base(columns))
        added = own if len(self.output) == 3 else onto * own
        return np.asarray(
            left @ below @ left + g**2 * added + _isotropic((1 - g) * (self.misfit or 0.0))
        )

    def outside(self, raw: ArrayLike, **columns: ArrayLike) -> Mask:
        """Which readings (…) are so far from the training that half the correction is gone.

        Parameters: raw (…, 3) in `unit_in`; columns (…) that are named in `needs`.
        """
        return np.asarray(self._inside(self.scaled(raw, columns)) < 0.5)

    def inside(self, raw: ArrayLike, **columns: ArrayLike) -> Array:
        """The share g (…) of the correction that is applied: 1 where it was trained, 0 far away.

        Parameters: raw (…, 3) in `unit_in`; columns (…) that are named in `needs`.
        """
        return self._inside(self.scaled(raw, columns))

    def at(self, temperature_C: float) -> Network:
        """The network that this is while the temperature stays at a value, °C."""
        values = {"temperature": float(temperature_C), "temperature_rate": 0.0}
        fixed = {name: value for name, value in values.items() if name in self.inputs}
        base = self.base.at(temperature_C) if isinstance(self.base, Thermal) else self.base
        return replace(self, base=base, held={**self.held, **fixed})

    def scaled(self, raw: ArrayLike, columns: Mapping[str, ArrayLike]) -> Array:
        """The inputs x (…, i), from readings (…, 3) and the columns beside them.

        Parameters: raw (…, 3) in `unit_in`; columns (…) by name.
        """
        x = stack_inputs(self.inputs, raw, {**columns, **self.held})
        return np.asarray((x - self.input_middle) / self.input_half)

    @property
    def equation(self) -> str:
        """The correction in words that hold for this calibration."""
        kind = f"{self.shape.said} (tanh) of {', '.join(self.inputs)}"
        if self.base is None:
            return f"field [{self.unit_out}] = network(x), {kind}, without a base"
        along = "" if len(self.output) == 3 else " along the field"
        return (
            f"{self.base.equation}, and added to it{along} g(x) * network(x), {kind}, at most "
            f"{self.bound:.6g} {self.unit_out}, g from 1 where it was trained to 0 outside"
        )

    def _inside(self, x: Array) -> Array:
        return domain.taper(domain.compute_distances(x, self.centres), self.reach)

    def _bound(self, added: Array) -> Array:
        if self.bound is None or self.base is None:
            return added
        length = np.linalg.norm(added, axis=-1, keepdims=True)
        return np.asarray(added * np.minimum(1.0, self.bound / np.maximum(length, 1e-300)))

    def _apply_base(self, raw: ArrayLike, columns: Mapping[str, ArrayLike]) -> Array:
        assert self.base is not None
        return self.base.correct(raw, **self._for_base(columns))

    def _for_base(self, columns: Mapping[str, ArrayLike]) -> dict[str, ArrayLike]:
        needed = () if self.base is None else self.base.needs
        return {name: columns[name] for name in needed if name in columns}

    def _beyond(self, beyond: Mask) -> str:
        back = "there it is a guess" if self.base is None else "there only its base corrects"
        return (
            f"{int(beyond.sum())} of {beyond.size} readings lie outside what the network of "
            f"{self.sensor} was trained on; {back}"
        )


def require_nodes(hidden: kernel.Nodes) -> kernel.Nodes:
    """The nodes of one hidden layer or of two, or an error."""
    nodes = (hidden,) if isinstance(hidden, int) else tuple(hidden)
    if not 1 <= len(nodes) <= 2 or not all(1 <= count <= MOST_HIDDEN for count in nodes):
        said = ", ".join(map(str, nodes)) or "nothing"
        raise AgonicError(
            f"hidden is {said}; a network has one or two hidden layers of 1 to {MOST_HIDDEN} nodes"
        )
    return nodes[0] if len(nodes) == 1 else (nodes[0], nodes[1])


def _unit(field: Array) -> Array:
    size = np.linalg.norm(field, axis=-1, keepdims=True)
    return np.asarray(field / np.maximum(size, 1e-300))


def _isotropic(sd: Array) -> Array:
    """Covariances (n, 3, 3) of independent axes with standard deviations (n, 1, 1)."""
    return np.asarray(sd**2 * np.eye(3))
