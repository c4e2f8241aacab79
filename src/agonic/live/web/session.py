"""`Session`: a source read in the background, its sensors fitted, and the results written."""

from __future__ import annotations

import threading
import time
from typing import Any

from msgspec.structs import replace

from agonic.errors import AgonicError
from agonic.live.fit import REFIT_GROWTH
from agonic.live.streams import Chunk, Notice, Source
from agonic.live.streams.device import Device, Setting
from agonic.live.web.folder import SavedFits, write_results
from agonic.live.web.messages import Outcome, Sensor, Status, describe_read_back
from agonic.live.web.plan import Plan
from agonic.live.web.watch import RecentReadings, WatchedSensor, find_calibration_before
from agonic.recording.calibrated import Calibrated
from agonic.recording.document import Written

DIGEST_S = 0.2  # between two fits, and two statuses
RETRY_S = 1.0  # before a source whose driver failed is opened again


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
        self._status = Status(0, False, False, f"connecting to {source.name}", [])
        self._unsaved = ""
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
        self._digest_all()
        self._save()

    @property
    def closing_message(self) -> str:
        """What is left of the session when it is stopped, in words."""
        left = self._unfinished.closing_message(accepted=bool(self.written))
        return self.status.trouble or left

    @property
    def status(self) -> Status:
        """Where the session stands."""
        with self._lock:
            now, device = self._status, self.source.device
            return replace(
                now,
                trouble=now.trouble or self._unsaved,
                device="" if device is None else device.name,
                notes=now.notes + [one.left_out for one in now.sensors if one.left_out],
            )

    @property
    def version(self) -> int:
        """A number that grows with every change of the status."""
        return self._status.version

    def _change(self, **now: Any) -> None:
        """Go on to the next version of the status."""
        with self._lock:
            self._status = replace(self._status, version=self._status.version + 1, **now)

    @property
    def shown(self) -> list[RecentReadings]:
        """The points of each sensor, in the order of the status."""
        return [watched.shown for watched in list(self._watched.values())]

    def offer(self, sensor: str) -> None:
        """Show what would be written to the device for a sensor; "" takes an offer back."""
        if sensor and not any(o.sensor == sensor for o in self._status.outcomes):
            self.accept()
        offer, warnings, trouble = list[Setting](), tuple[str, ...](), ""
        try:
            if sensor:
                calibration = self._find_result(sensor).fit.calibration
                offer, warnings = self._device().changes(calibration)
        except AgonicError as error:
            sensor, trouble = "", str(error)
        says = ". ".join(warnings)
        with self._lock:
            trouble = trouble or self._status.trouble
            self._change(offered=sensor, offer=offer, device_says=says, trouble=trouble)

    def write(self, sensor: str) -> None:
        """Write to the device what was offered, and nothing else; read it back."""
        with self._lock:
            now = self._status
            if now.offered != sensor or now.busy or not now.offer:
                return
            self._change(busy=True)
        offer = now.offer
        try:
            calibration = self._find_result(sensor).fit.calibration
            read = self._device().write(offer, calibration)
            offer = [replace(one, read_back=read.get(one.name)) for one in offer]
            says = describe_read_back(offer)
        except (AgonicError, OSError) as error:
            says = f"not written: {error}"
        self._change(offered=sensor, offer=offer, device_says=says, busy=False)

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
            sensors = [watched.status() for watched in self._watched.values()]
            self._change(sensors=sensors, outcomes=[], trouble="", notes=[])

    def accept(self) -> list[Outcome]:
        """Calibrate from the readings so far and write the results, as `agonic calibrate` does."""
        with self._lock:
            if self._status.busy:
                return self._status.outcomes
            self._change(busy=True, trouble="")
            self._digest_all()
        self._consider_all()
        with self._lock:
            self._digest_all()
            seen = {n: one.seen for n, one in self._watched.items() if one.live.n}
        try:
            self.results, self.written, outcomes = write_results(self.plan, self.source, seen)
            trouble = ""
        except (AgonicError, OSError) as error:
            outcomes, trouble = [], str(error)
        except Exception as error:  # the page must hear of it rather than wait for ever
            outcomes, trouble = [], f"{type(error).__name__}: {error}"
        with self._lock:
            self._unsaved = ""
            for result in self.results:
                if result.verdict != "refused":
                    self._unfinished.finish(result.samples.name)
            accepted = self._status.accepted + 1
            self._change(
                outcomes=outcomes, trouble=trouble, busy=False, accepted=accepted, notes=[]
            )
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
        self._change(connected=said.connected, ended=said.ended, heard=said.text)

    def _take(self, chunk: Chunk) -> None:
        with self._lock:
            if self.plan.sensor not in (None, chunk.sensor):
                asked = f"only {self.plan.sensor} was asked for"
                self._note(f"{chunk.sensor} is received and not used: {asked}")
                return
            watched = self._watched.get(chunk.sensor)
            if watched is None:
                if len(self._watched) >= 8:
                    return
                given = dict(self.plan.before)
                before = find_calibration_before(self.plan.folder, chunk.sensor, given)
                watched = WatchedSensor(chunk, self.plan.params(chunk), before)
                self._watched[chunk.sensor] = watched
                live, note = self._unfinished.resume(watched.params)
                if live is not None:
                    watched.go_on(live)
                if note:
                    self._note(note)
            watched.take(chunk)

    def _save(self) -> None:
        """Write where it stands, beside the reading and fitting."""
        with self._lock:
            stands = {n: (one.params, one.live.state) for n, one in self._watched.items()}
        self._unsaved = self._unfinished.save(stands)
        self._change()

    def _digest(self) -> None:
        """Fit and save, again and again; what goes wrong is told, and it goes on."""
        while not self._stop.is_set():
            began = time.monotonic()
            try:
                self._digest_all()
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
            self._consider_all(REFIT_GROWTH)
            self._stop.wait(max(DIGEST_S, 2 * (time.monotonic() - began)))

    def _consider_all(self, growth: float = 1.0) -> None:
        """Fit beside accelerometer and gyro, of sensors that have grown so many times."""
        with self._fitting:
            for watched in list(self._watched.values()):
                if trouble := watched.consider(growth):
                    self._note(trouble)

    def _digest_all(self) -> None:
        with self._lock:
            self._change(sensors=[self._digest_one(one) for one in self._watched.values()])

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
            notes = self._status.notes
            if note not in notes and len(notes) < 16:
                self._change(notes=[*notes, note])


def _tell(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
