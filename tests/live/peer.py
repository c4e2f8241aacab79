"""A vehicle played by pymavlink in a process of its own: `python peer.py PORT AUTOPILOT [LOST]`.

It corrects its readings as ArduPilot does and answers for its parameters; the one named LOST it
never tells. What is set it prints.
"""

import socket
import sys
import time

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as dialect

PARAMETERS = {
    "COMPASS_OFS_X": -120.0,
    "COMPASS_OFS_Y": 80.0,
    "COMPASS_OFS_Z": 33.5,
    "COMPASS_DIA_X": 1.05,
    "COMPASS_DIA_Y": 0.97,
    "COMPASS_DIA_Z": 1.01,
    "COMPASS_ODI_X": 0.02,
    "COMPASS_ODI_Y": -0.01,
    "COMPASS_ODI_Z": 0.03,
    "COMPASS_SCALE": 1.1,
    "COMPASS_DEV_ID": 97539.0,
    "COMPASS_MOTCT": 0.0,
    "COMPASS_LEARN": 3.0,
}
RAW_BIAS = np.array([250.0, -100.0, 60.0])  # mG
FIELD = 500.0  # mG


def corrected(raw, values):
    """ArduPilot's M (SCALE (raw + OFS))."""
    get = values.__getitem__
    xx, yy, zz = (get(f"COMPASS_DIA_{a}") for a in "XYZ")
    xy, xz, yz = (get(f"COMPASS_ODI_{a}") for a in "XYZ")
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    offset = np.array([get(f"COMPASS_OFS_{a}") for a in "XYZ"])
    return matrix @ (get("COMPASS_SCALE") * (raw + offset))


class Wire:
    def __init__(self, address):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setblocking(False)
        self.address = address

    def write(self, data):
        self.socket.sendto(data, self.address)

    def read(self):
        try:
            return self.socket.recv(4096)
        except (BlockingIOError, ConnectionRefusedError):
            return b""


def main(port, autopilot, lost=""):
    wire, values = Wire(("127.0.0.1", port)), dict(PARAMETERS)
    link = dialect.MAVLink(wire, 7, 1)
    link.robust_parsing = True
    rng, names = np.random.default_rng(3), [n for n in values if n != lost]
    began = beat = time.monotonic()
    link.heartbeat_send(2, autopilot, 0, 0, 4)

    def tell(name):
        if name in values and name != lost:
            count = len(values)
            link.param_value_send(name.encode(), values[name], 9, count, names.index(name))

    while True:
        time.sleep(0.01)
        for message in link.parse_buffer(wire.read()) or ():
            kind = message.get_type()
            if kind == "PARAM_REQUEST_READ":
                tell(message.param_id)
            elif kind == "PARAM_REQUEST_LIST":
                for name in names:
                    tell(name)
            elif kind == "PARAM_SET" and message.param_id in values:
                values[message.param_id] = message.param_value
                print(message.param_id, message.param_value, flush=True)
                tell(message.param_id)
        now = time.monotonic()
        if now - beat > 0.5:
            beat = now
            link.heartbeat_send(2, autopilot, 0, 0, 4)
        u = rng.normal(size=3)
        raw = RAW_BIAS + FIELD * u / np.linalg.norm(u)
        sent = np.round(corrected(raw, values)).astype(int)
        micros = int(1e6 * (now - began)) + 1
        link.raw_imu_send(micros, 0, 0, 0, 0, 0, 0, *sent.tolist())
        link.highres_imu_send(micros, 0, 0, 0, 0, 0, 0, *(sent / 1e3).tolist(), 0, 0, 0, 0, 0xFFFF)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), *sys.argv[3:])
