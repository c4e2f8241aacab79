"""The wires: serial ports, UDP and TCP, each read and written in bytes."""

from __future__ import annotations

import os
import select
import socket
import sys
from contextlib import suppress
from typing import Any, NamedTuple

from agonic.errors import AgonicError, MissingExtraError

WAIT_S = 0.05
"""How long a read waits for bytes."""

MOST_BYTES = 65_536


class Packet(NamedTuple):
    """Bytes, and who sent them where several can; `whole` where they are a datagram."""

    data: bytes
    origin: str = ""
    whole: bool = False


def list_ports() -> list[tuple[str, str]]:
    """The serial ports of this machine: device, and what is plugged in."""
    try:
        from serial.tools.list_ports import comports
    except ImportError:
        raise MissingExtraError("reading a serial port", "live") from None
    return sorted((port.device, port.description or "") for port in comports())


class SerialLink:
    """A serial port, at a speed in baud."""

    hint = "; check its speed in baud and what the device sends"

    def __init__(self, device: str, baud: int) -> None:
        self.name, self.device, self.baud = f"serial port {device}", device, baud
        self._port: Any = None

    def open(self) -> None:
        """Open the port; `OSError` where it is not there."""
        try:
            import serial
        except ImportError:
            raise MissingExtraError("reading a serial port", "live") from None
        self._port = serial.Serial(self.device, self.baud, timeout=WAIT_S, write_timeout=2.0)

    def read(self) -> Packet | None:
        """What has come, at once when something has."""
        try:
            waiting = self._port.in_waiting
            data = self._port.read(min(max(waiting, 1), MOST_BYTES))
        except TypeError as error:  # pyserial, when the port is gone while it waits
            raise OSError(str(error)) from error
        return Packet(data) if data else None

    def write(self, data: bytes) -> None:
        """Send bytes."""
        self._port.write(data)

    def close(self) -> None:
        """Let go of the port."""
        if self._port is not None:
            with suppress(OSError):
                self._port.close()


class StandardInput:
    """What is piped into the program; `EOFError` where it has ended."""

    name, hint = "standard input", ""

    def open(self) -> None:
        """Nothing is to be opened."""

    def read(self) -> Packet | None:
        """What has come, at once when something has."""
        if not select.select([sys.stdin], [], [], WAIT_S)[0]:
            return None
        data = os.read(sys.stdin.fileno(), MOST_BYTES)
        if not data:
            raise EOFError
        return Packet(data)

    def write(self, data: bytes) -> None:
        """Nobody hears."""

    def close(self) -> None:
        """It stays open for others."""


class _SocketLink:
    """What UDP and TCP have in common."""

    _socket: socket.socket | None = None

    def close(self) -> None:
        """Stop listening, or hang up."""
        if self._socket is not None:
            self._socket.close()


class UdpLink(_SocketLink):
    """A UDP port that is listened on; what is written goes to who was heard last."""

    def __init__(self, host: str, port: int) -> None:
        self.name, self._address = f"UDP port {port}", (host, port)
        self.hint = f"; for senders on other machines listen on udp://0.0.0.0:{port}"
        if host not in ("127.0.0.1", "::1"):
            self.hint = ""
        self._peer: Any = None

    def open(self) -> None:
        """Listen; `AgonicError` where the port is taken."""
        family = socket.AF_INET6 if ":" in self._address[0] else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.settimeout(WAIT_S)
        try:
            self._socket.bind(self._address)
        except OSError as error:
            raise AgonicError(
                f"cannot listen on {self._address[0]}:{self._address[1]}: "
                f"{error.strerror or error}; stop what else listens there, or take another port"
            ) from None

    def read(self) -> Packet | None:
        """The next datagram."""
        assert self._socket is not None
        try:
            data, self._peer = self._socket.recvfrom(MOST_BYTES)
        except TimeoutError:
            return None
        return Packet(data, f"{self._peer[0]}:{self._peer[1]}", whole=True)

    def write(self, data: bytes) -> None:
        """Send bytes to who was heard last."""
        if self._socket is not None and self._peer is not None:
            self._socket.sendto(data, self._peer)


class TcpLink(_SocketLink):
    """A TCP server that is connected to."""

    hint = ""

    def __init__(self, host: str, port: int) -> None:
        self.name, self._address = f"{host}:{port}", (host, port)

    def open(self) -> None:
        """Connect; `OSError` where nobody answers."""
        self._socket = socket.create_connection(self._address, timeout=2.0)
        self._socket.settimeout(WAIT_S)

    def read(self) -> Packet | None:
        """What has come; `ConnectionError` where the other end has closed."""
        assert self._socket is not None
        try:
            data = self._socket.recv(MOST_BYTES)
        except TimeoutError:
            return None
        if not data:
            raise ConnectionError("the other end closed the connection")
        return Packet(data)

    def write(self, data: bytes) -> None:
        """Send bytes."""
        if self._socket is not None:
            self._socket.sendall(data)


Link = SerialLink | StandardInput | UdpLink | TcpLink
"""A wire: `open` and `read` raise `OSError` where it is cut."""
