"""`Session`: a source read in the background, its sensors fitted, and the results written."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from typing import NamedTuple

from msgspec.structs import replace

from agonic.errors import AgonicError
from agonic.live.fit import GROWTH
from agonic.live.streams import Chunk, Notice, Source
from agonic.live.streams.device import Device, Setting
from agonic.live.web.messages import Outcome, Sensor, Status, describe_read_back
from agonic.live.web.plan import Plan
from agonic.live.web.results import write_results
from agonic.live.web.resume import SavedFits
from agonic.live.web.watch import RecentReadings, WatchedSensor, find_calibration_before
from agonic.recording.calibrated import Calibrated
from agonic.recording.document import Written


class DeviceOffer(NamedTuple):
    """The sensor, its settings in the device, and what is to be said of them."""

    sensor: str = ""
    settings: Sequence[Setting] = ()
    says: str = ""


DIGEST_S = 0.2  # between two fits, and two statuses
RETRY_S = 1.0  # before a source whose driver failed is opened again
MOST_SENSORS, MOST_NOTES = 8, 16


class Session:
    """Reads a source in a thread of its own; whoever shows it asks for `status` and `points`."""

    def __init__(self, source: Source, plan: Plan) -> None:
        self.source, self.plan = source, plan
        self._lock, self._stop = threading.RLock(), threading.Event()
        self._fitting = threading.Lock()
        self._threads: list[threading.Thread] = []
        self._watched: dict[str, WatchedSensor] = {}
        origin = source.name if source.lasting else ""
        self._unfinished = SavedFits(plan.folder, origin, fresh=plan.fresh)
        self._notes: list[str] = []
        self._heard = Notice(False, f"connecting to {source.name}")
        self._sensors: list[Sensor] = []
        self._version = self._accepted = 0
        self._outcomes: list[Outcome] = []
        self._busy, self._trouble, self._unsaved = False, "", ""
        self._offer = DeviceOffer()
        self.results: list[Calibrated] = []
        self.written: dict[str, Written] = {}

    def start(self) -> None:
        """Begin to read."""
        for task in (self._read, self._digest, self._consider):
            thread = threading.Thread(target=task, name=f"agonic-{task.__name__}", daemon=True)
            self._threads.append(thread)
            thread.start()

    def stop(self) -> None:
        """Stop reading, wait for it, and save where it stands."""
        self._stop.set()
        for thread in self._threads:
            thread.join(timeout=3.0)
        with self._lock:
            self._sensors = [self._digest_one(one) for one in self._watched.values()]
        self._save()

    @property
    def closing_message(self) -> str:
        """What is left of the session when it is stopped, in words."""
        left = self._unfinished.closing_message(accepted=bool(self.written))
        return self._trouble or self._unsaved or left

    @property
    def status(self) -> Status:
        """Where the session stands."""
        with self._lock:
            return Status(
                version=self._version,
                connected=self._heard.connected,
                ended=self._heard.ended,
                heard=self._heard.text,
                sensors=self._sensors,
                accepted=self._accepted,
                outcomes=self._outcomes,
                busy=self._busy,
                trouble=self._trouble or self._unsaved,
                device="" if self.source.device is None else self.source.device.name,
                offered=self._offer.sensor,
                offer=list(self._offer.settings),
                device_says=self._offer.says,
                notes=self._notes + [one.left_out for one in self._sensors if one.left_out],
            )

    @property
    def version(self) -> int:
        """A number that grows with every change of the status."""
        return self._version

    @property
    def shown(self) -> list[RecentReadings]:
        """The points of each sensor, in the order of the status."""
        return [watched.shown for watched in list(self._watched.values())]

    def offer(self, sensor: str) -> None:
        """Show what would be written to the device for a sensor; "" takes an offer back."""
        offered = DeviceOffer()
        if sensor and not any(o.sensor == sensor for o in self._outcomes):
            self.accept()
        try:
            if sensor:
                calibration = self._find_result(sensor).fit.calibration
                changes, warnings = self._device().changes(calibration)
                offered = DeviceOffer(sensor, changes, ". ".join(warnings))
            trouble = ""
        except AgonicError as error:
            trouble = str(error)
        with self._lock:
            self._offer, self._trouble = offered, trouble or self._trouble
            self._changed()

    def write(self, sensor: str) -> None:
        """Write to the device what was offered, and nothing else; read it back."""
        with self._lock:
            offered = self._offer
            if offered.sensor != sensor or self._busy or not offered.settings:
                return
            self._busy = True
            self._changed()
        try:
            calibration = self._find_result(sensor).fit.calibration
            read = self._device().write(offered.settings, calibration)
            listed = [replace(one, read_back=read.get(one.name)) for one in offered.settings]
            offered = DeviceOffer(sensor, listed, describe_read_back(listed))
        except (AgonicError, OSError) as error:
            offered = offered._replace(says=f"not written: {error}")
        with self._lock:
            self._offer, self._busy = offered, False
            self._changed()

    def _device(self) -> Device:
        device = self.source.device
        if device is None:
            raise AgonicError("nothing can be written to this source")
        return device

    def _find_result(self, sensor: str) -> Calibrated:
        for result in self.results:
            if result.samples.name == sensor and result.verdict != "refused":
                return result
        raise AgonicError(f"the calibration of {sensor} is refused, and is not written anywhere")

    def restart(self, sensor: str | None) -> None:
        """Forget the readings of a sensor, or of all."""
        with self._lock:
            for name, watched in self._watched.items():
                if sensor in (None, name):
                    watched.restart()
                    self._unfinished.begin(name)
            self._outcomes, self._trouble, self._notes = [], "", []
            self._sensors = [watched.status() for watched in self._watched.values()]
            self._changed()

    def accept(self) -> list[Outcome]:
        """Calibrate from the readings so far and write the results, as `agonic calibrate` does."""
        with self._lock:
            if self._busy:
                return self._outcomes
            self._busy, self._trouble = True, ""
            self._changed()
            self._sensors = [self._digest_one(one) for one in self._watched.values()]
        self._consider_all()
        with self._lock:
            self._sensors = [self._digest_one(one) for one in self._watched.values()]
            seen = {n: one.seen for n, one in self._watched.items() if one.live.n}
        try:
            self.results, self.written, outcomes = write_results(self.plan, self.source, seen)
            trouble = ""
        except (AgonicError, OSError) as error:
            outcomes, trouble = [], str(error)
        except Exception as error:  # the page must hear of it rather than wait for ever
            outcomes, trouble = [], f"{type(error).__name__}: {error}"
        with self._lock:
            self._outcomes, self._trouble, self._busy = outcomes, trouble, False
            self._unsaved = ""
            self._accepted += 1
            self._notes = []
            for result in self.results:
                if result.verdict != "refused":
                    self._unfinished.finish(result.samples.name)
            self._changed()
        return outcomes

    # ---- in the background ----------------------------------------------------------------

    def _read(self) -> None:
        """Read the source; one that goes on is opened again after whatever its driver raises."""
        while not self._stop.is_set():
            try:
                for event in self.source.events(self._stop):
                    if isinstance(event, Notice):
                        self._say(event)
                    elif isinstance(event, Chunk):
                        self._take(event)
                return
            except Exception as error:
                again = self.source.lasting and not isinstance(error, AgonicError)
                text = str(error) if isinstance(error, AgonicError) else f"stopped: {_tell(error)}"
                self._say(Notice(False, text + ("; trying again" * again), ended=not again))
                if not again:
                    return
                self._stop.wait(RETRY_S)

    def _say(self, said: Notice) -> None:
        with self._lock:
            self._heard = said
            self._changed()

    def _take(self, chunk: Chunk) -> None:
        with self._lock:
            if self.plan.sensor not in (None, chunk.sensor):
                asked = f"only {self.plan.sensor} was asked for"
                self._note(f"{chunk.sensor} is received and not used: {asked}")
                return
            watched = self._watched.get(chunk.sensor)
            if watched is None:
                if len(self._watched) >= MOST_SENSORS:
                    return
                given = dict(self.plan.before)
                before = find_calibration_before(self.plan.folder, chunk.sensor, given)
                watched = WatchedSensor(chunk, self.plan.params(chunk), before)
                self._watched[chunk.sensor] = watched
                live, note = self._unfinished.resume(watched.params)
                if live is not None:
                    watched.go_on(live)
                if note:
                    self._notes.append(note)
            watched.take(chunk)

    def _save(self) -> None:
        """Write where it stands, beside the reading and fitting."""
        with self._lock:
            stands = {n: (one.params, one.live.state) for n, one in self._watched.items()}
        trouble = self._unfinished.save(stands)
        with self._lock:
            self._unsaved = trouble
            self._changed()

    def _digest(self) -> None:
        """Fit and save, again and again; what goes wrong is told, and it goes on."""
        while not self._stop.is_set():
            began = time.monotonic()
            try:
                with self._lock:
                    self._sensors = [self._digest_one(one) for one in self._watched.values()]
                    self._changed()
                if self._unfinished.due():
                    self._save()
            except Exception as error:
                self._note(f"the fits stopped ({_tell(error)}) and were started again")
            # a slow machine fits less often rather than falls behind
            self._stop.wait(max(DIGEST_S - (time.monotonic() - began), 0.1 * DIGEST_S))

    def _consider(self) -> None:
        """Make the fits that take seconds, a third of the time at most."""
        while not self._stop.is_set():
            began = time.monotonic()
            self._consider_all(GROWTH)
            self._stop.wait(max(DIGEST_S, 2 * (time.monotonic() - began)))

    def _consider_all(self, growth: float = 1.0) -> None:
        """Fit beside accelerometer and gyro, of sensors that have grown so many times."""
        with self._fitting:
            for watched in list(self._watched.values()):
                if trouble := watched.consider(growth):
                    self._note(trouble)

    def _digest_one(self, watched: WatchedSensor) -> Sensor:
        """Fit what has come of a sensor; one that begins anew leaves its saved readings aside."""
        status, trouble = watched.proceed()
        if trouble:
            aside = self._unfinished.leave(watched.name) if not watched.live.n else ""
            self._note(trouble + aside)
        return status

    def _note(self, note: str) -> None:
        """Say something once."""
        with self._lock:
            if note not in self._notes and len(self._notes) < MOST_NOTES:
                self._notes.append(note)
                self._changed()

    def _changed(self) -> None:
        self._version += 1


def _tell(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
