"""A MotionCal device on a pseudo-terminal."""

import os
import pty
import struct
import threading
import time
import tty

from agonic.exports.motioncal import compute_crc16
from agonic.simulation import simulate


class Device:
    """Sends `Raw:` lines; a whole packet with a right CRC is kept and told in Cal1 and Cal2."""

    def __init__(self, wrong=0.0):
        self.ours, self.theirs = pty.openpty()
        tty.setraw(self.theirs)
        os.set_blocking(self.ours, False)
        self.path, self.kept, self._wrong = os.ttyname(self.theirs), None, wrong
        self._stop, self._heard = threading.Event(), b""
        self._field = simulate("sphere", n=3000, noise=100.0, seed=2).samples.field
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        k = 0
        while not self._stop.is_set():
            time.sleep(0.01)
            counts = ",".join(str(round(v / 100)) for v in self._field[k % 3000])
            k += 1
            try:
                os.write(self.ours, f"Raw:0,0,0,0,0,0,{counts}\r\n".encode())
                self._heard += os.read(self.ours, 4096)
            except BlockingIOError:
                pass
            start = self._heard.find(b"uT")
            packet = self._heard[start : start + 68] if start >= 0 else b""
            if len(packet) == 68 and compute_crc16(packet) == 0:
                self._heard = b""
                self.kept = struct.unpack("<16f", packet[2:-2])
                w = self.kept[10:]
                rows = (w[0], w[3], w[4], w[3], w[1], w[5], w[4], w[5], w[2])
                first = [*self.kept[:6], self.kept[6] + self._wrong, *self.kept[7:10]]
                for name, values in (("Cal1", first), ("Cal2", rows)):
                    told = ",".join(f"{v:.7g}" for v in values)
                    os.write(self.ours, f"{name}:{told}\r\n".encode())

    def close(self):
        self._stop.set()
        self._thread.join(2.0)
        os.close(self.ours)
        os.close(self.theirs)
