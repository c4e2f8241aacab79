"""`Vehicle`: the compasses of a vehicle that speaks MAVLink, as they read before any correction.

ArduPilot sends its readings corrected, RAW_IMU too (GCS_Common.cpp, send_raw_imu); its parameters
are fetched and the correction is taken out as in a log. PX4 sends HIGHRES_IMU with its estimate of
the bias in flight, which telemetry does not report, and is refused.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from agonic.calibration.autopilots import ARDUPILOT
from agonic.calibration.base import Calibration
from agonic.errors import AgonicError, MissingExtraError
from agonic.exports.ardupilot import compute_ardupilot_parameters
from agonic.exports.targets import compass_number
from agonic.live.streams.device import ANSWER_S, Setting
from agonic.live.streams.events import Chunk, Clock, Event, Notice
from agonic.live.streams.links import Packet
from agonic.logs.ardupilot.compass import remove_correction
from agonic.logs.ardupilot.mavlink import TABLES
from agonic.logs.ardupilot.tlog import NO_AUTOPILOT, STACKS
from agonic.logs.rows.tracks import Table
from agonic.units import RAW

ASK_AGAIN_S = 0.5
ASKING_ROUNDS = 6
"""Rounds of asking by name before the whole list is asked for."""

LIST_S = 10.0
"""So long after the last parameter of a list no more will come."""


def list_wanted(slot: str) -> tuple[str, ...]:
    """The parameters that correct the compass of a slot: "" the first, then "2" and "3"."""
    vectors = ARDUPILOT.names(ARDUPILOT.slots.index(slot) + 1, *ARDUPILOT.parts[:3])
    return (*vectors, f"COMPASS_SCALE{slot}", f"COMPASS_DEV_ID{slot}", "COMPASS_MOTCT")


class Parameters:
    """What a vehicle has told; `ask` and `ask_all` send the requests."""

    def __init__(self, ask: Callable[[str], None], ask_all: Callable[[], None]) -> None:
        self.values: dict[str, float] = {}
        self._ask, self._ask_all = ask, ask_all
        self._rounds: dict[str, int] = {}
        self._asked_at: dict[str, float] = {}
        self._listed: set[int] = set()
        self._count = 0
        self._list_at: float | None = None

    def take(self, message: Any, now: float) -> None:
        """A PARAM_VALUE that came; one that is no number counts as not told."""
        value = float(message.param_value)
        if np.isfinite(value):
            self.values[str(message.param_id)] = value
        if self._list_at is not None and message.param_index < 65_535:
            self._listed.add(int(message.param_index))
            self._count, self._list_at = int(message.param_count), now

    def missing(self, slot: str) -> list[str]:
        """The parameters of a slot that are not known, nor known to be absent."""
        if self._count and len(self._listed) >= self._count:
            return [n for n in list_wanted(slot)[:3] if n not in self.values]
        return [name for name in list_wanted(slot) if name not in self.values]

    def pursue(self, slot: str, now: float) -> str:
        """Ask for what is missing when it is time to; a sentence where the vehicle stays silent."""
        missing = self.missing(slot)
        if not missing or now - self._asked_at.get(slot, -np.inf) < ASK_AGAIN_S:
            return ""
        self._asked_at[slot] = now
        self._rounds[slot] = self._rounds.get(slot, 0) + 1
        if self._rounds[slot] <= ASKING_ROUNDS:
            for name in missing:
                self._ask(name)
        elif self._list_at is None:
            self._list_at = now
            self._ask_all()
        elif now - self._list_at > LIST_S:
            self._list_at, self._rounds[slot] = None, 0
            return f"the vehicle does not send {', '.join(missing[:3])}"
        return ""

    @property
    def table(self) -> Table:
        """The parameters as a log has them."""
        return Table(
            np.zeros(len(self.values), np.int64),
            {
                "Name": np.array([name.encode() for name in self.values], dtype="S16"),
                "Value": np.array(list(self.values.values())),
            },
        )


SLOTS = {"RAW_IMU": "", "SCALED_IMU2": "2", "SCALED_IMU3": "3"}
OTHERS = {
    "HIGHRES_IMU": ("mG", 1e3),
    "SCALED_IMU": ("mG", 1.0),
    "SCALED_IMU2": ("mG", 1.0),
    "SCALED_IMU3": ("mG", 1.0),
    "RAW_IMU": (RAW, 1.0),
}
"""Of other autopilots, as they send: unit, and factor to it."""

LEARN = "COMPASS_LEARN"
"""Above zero the vehicle changes its calibration in flight; it is set to zero with a new one."""

RATE_HZ = 50
HEARTBEAT_S = 1.0

_PX4_SAYS = (
    "PX4 sends its readings corrected, with an estimate of the bias that telemetry does not "
    "report: they cannot be calibrated live; calibrate from the vehicle's own log (.ulg)"
)


class Vehicle:
    """Understands MAVLink; also a device that keeps a calibration (ArduPilot)."""

    def __init__(self) -> None:
        try:
            from pymavlink.dialects.v20 import ardupilotmega
        except ImportError:
            raise MissingExtraError("reading MAVLink", "mavlink") from None
        self._dialect = ardupilotmega
        self.stack, self._writing = "", False
        self.begin(lambda _: None)

    def begin(self, write: Callable[[bytes], None]) -> None:
        """A new connection: the vehicle is met anew."""
        wire = SimpleNamespace(write=lambda data: write(bytes(data)))
        self._link = self._dialect.MAVLink(wire, 255, 190)  # as a ground station
        self._link.robust_parsing = True
        self._system: tuple[int, int] | None = None
        self._clock, self._seen = Clock(), set[str]()
        self._beat_at = self._request_at = -np.inf
        self.parameters = Parameters(self._ask, self._ask_all)

    @property
    def name(self) -> str:
        """What a calibration can be written to."""
        return "ArduPilot vehicle" if self._system and self.stack == "ardupilot" else ""

    @property
    def device(self) -> Vehicle | None:
        """Itself, once it is known to be one that takes parameters."""
        return self if self.name else None

    def feed(self, received: Packet, now: float) -> list[Event]:
        """The readings in what was received, and what stands in their way."""
        found: dict[str, list[Any]] = {}
        events: list[Event] = []
        messages = self._link.parse_buffer(received.data) if received.data else None
        for message in messages or ():
            kind = message.get_type()
            if kind == "HEARTBEAT":
                events += self._met(message)
            elif self._system is None or message.get_srcSystem() != self._system[0]:
                continue
            elif kind == "PARAM_VALUE":
                self.parameters.take(message, now)
            elif kind in OTHERS:
                found.setdefault(kind, []).append(message)
        for kind, heard in found.items():
            events += self._readings(kind, heard, now)
        return events + self._tend(now)

    # ---- meeting the vehicle, and keeping it sending ---------------------------------------

    def _met(self, beat: Any) -> list[Event]:
        if self._system is not None or beat.autopilot == NO_AUTOPILOT:
            return []
        self._system = (beat.get_srcSystem(), beat.get_srcComponent())
        self.stack = STACKS.get(int(beat.autopilot), "")
        if self.stack == "px4":
            return [Notice(True, _PX4_SAYS)]
        kind = self.name or "vehicle"
        return [Notice(True, f"{kind} {self._system[0]} answers")]

    def _tend(self, now: float) -> list[Event]:
        """Heartbeats, and requests for what is missing."""
        events: list[Event] = []
        if now - self._beat_at > HEARTBEAT_S:
            self._beat_at = now
            self._link.heartbeat_send(6, NO_AUTOPILOT, 0, 0, 4)  # a ground station, active
        if self._system is None:
            return events
        if now - self._request_at > 5.0:
            self._request_at = now
            self._request()
        for slot in sorted(self._seen):
            refused = self.parameters.pursue(slot, now)
            if refused:
                events.append(
                    Notice(
                        True,
                        f"{refused}: its readings are corrected and cannot be taken back; "
                        "check the link, or calibrate from the vehicle's own log (.bin)",
                    )
                )
        return events

    def _request(self) -> None:
        """Have the readings sent often; old firmware knows streams only."""
        assert self._system is not None
        interval = 1e6 / RATE_HZ
        for name in SLOTS:
            number = getattr(self._dialect, f"MAVLINK_MSG_ID_{name}")
            self._link.command_long_send(*self._system, 511, 0, number, interval, 0, 0, 0, 0, 0)
        if self.name and LEARN not in self.parameters.values:
            self._ask(LEARN)
        if not self._seen:
            self._link.request_data_stream_send(*self._system, 1, RATE_HZ, 1)

    def _ask(self, name: str) -> None:
        assert self._system is not None
        self._link.param_request_read_send(*self._system, name.encode(), -1)

    def _ask_all(self) -> None:
        assert self._system is not None
        self._link.param_request_list_send(*self._system)

    # ---- readings ----------------------------------------------------------------------------

    def _readings(self, kind: str, heard: list[Any], now: float) -> list[Event]:
        if self._writing or self.stack == "px4":
            return []
        field = np.array([[m.xmag, m.ymag, m.zmag] for m in heard], dtype=float)
        answered = np.isfinite(field).all(axis=1) & field.any(axis=1)
        if not answered.any():
            return []
        told = [m for m, there in zip(heard, answered, strict=True) if there]
        own, field, motion = [_get_time(m) for m in told], field[answered], None
        if self.name or kind != "RAW_IMU":  # of others in counts
            motion = np.array([_get_motion(m, TABLES[kind][1]) for m in told])
        if not self.name:
            unit, factor = OTHERS[kind]
            time_s = self._clock.times(own, now, kind)
            return [Chunk(kind, time_s, field * factor, unit, motion=motion)]
        if kind not in SLOTS:
            return []
        slot = SLOTS[kind]
        self._seen.add(slot)
        if self.parameters.missing(slot):
            return []
        columns = {f"Mag{axis}": field[:, k] for k, axis in enumerate("XYZ")}
        found = remove_correction(
            Table(np.arange(len(field)), columns), self.parameters.table, slot
        )
        time_s = self._clock.times(own, now, kind)
        return [Chunk(kind, time_s, found.field, "nT", "b", found.device_id, motion)]

    # ---- writing -----------------------------------------------------------------------------

    def changes(self, calibration: Calibration) -> tuple[list[Setting], tuple[str, ...]]:
        """The parameters that a calibration sets, beside those in the vehicle."""
        number = compass_number(calibration.sensor)
        parameters, warnings = compute_ardupilot_parameters(calibration, compass=number)
        values = self.parameters.values
        wanted = {**parameters, LEARN: 0.0}
        return [Setting(name, values.get(name), new) for name, new in wanted.items()], warnings

    def write(
        self, changes: Sequence[Setting], calibration: Calibration
    ) -> Mapping[str, float | None]:
        """Set the parameters, and read every one of them back from the vehicle."""
        if self._system is None:
            raise AgonicError("the vehicle does not answer; nothing was written")
        values, names = self.parameters.values, [change.name for change in changes]
        self._writing = True
        try:
            for change in changes:
                self._link.param_set_send(*self._system, change.name.encode(), change.new, 9)
            time.sleep(0.2)
            for name in names:  # what is told from now on is read back
                values.pop(name, None)
            until = time.monotonic() + ANSWER_S
            while time.monotonic() < until:
                wrong = [c for c in changes if values.get(c.name) != float(np.float32(c.new))]
                if not wrong:
                    break
                for change in wrong:
                    if change.name in values:
                        self._link.param_set_send(
                            *self._system, change.name.encode(), change.new, 9
                        )
                        values.pop(change.name, None)
                    self._ask(change.name)
                time.sleep(0.3)
        finally:
            self._writing = False
        return {name: values.get(name) for name in names}


def _get_motion(message: Any, columns: Mapping[str, tuple[str, float]]) -> list[float]:
    """Acceleration, m/s², and rotation rate, rad/s, of a message; zeros stand for no gyro."""
    parts = [columns[f"{stem}{axis}"] for stem in ("Acc", "Gyr") for axis in "XYZ"]
    return [factor * float(getattr(message, name)) for name, factor in parts]


def _get_time(message: Any) -> float:
    """The vehicle's time of a reading, s."""
    if hasattr(message, "time_usec"):
        return float(message.time_usec) / 1e6
    return float(message.time_boot_ms) / 1e3
