"""The server of the live page: who may, how much, and that nobody slows the others."""

import asyncio
import json
import os
import socket
import struct
import urllib.error
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from agonic.live.web import messages
from agonic.live.web.watch import RecentReadings


def run(work):
    """What a coroutine gives, in a thread of its own: a browser may keep a loop in this one."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(lambda: asyncio.run(work())).result()


def plain(address, **headers):
    """Status of a request, `None` where nobody answers."""
    try:
        with urllib.request.urlopen(urllib.request.Request(address, headers=headers)) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        with error:
            return error.code
    except OSError:
        return None


def socket_of(address):
    parts = urlsplit(address)
    return f"ws://{parts.netloc}/socket" + (f"?{parts.query}" if parts.query else "")


async def heard(address, seconds, enough=lambda statuses, count: False, **options):
    """Statuses and the number of points that came until they were enough, or in so long."""
    statuses, count = [], 0
    async with connect(socket_of(address), max_size=None, **options) as one:
        until = asyncio.get_running_loop().time() + seconds
        while (left := until - asyncio.get_running_loop().time()) > 0:
            if enough(statuses, count):
                break
            try:
                said = await asyncio.wait_for(one.recv(), left)
            except TimeoutError:
                break
            if isinstance(said, bytes):
                count += (len(said) - 16) // 12
            else:
                statuses.append(json.loads(said))
    return statuses, count


def megabytes(process, kind="VmRSS"):
    """Memory that a process holds; with "VmHWM" the most that it ever held."""
    text = Path(f"/proc/{process.pid}/status").read_text()
    return int(next(line for line in text.splitlines() if line.startswith(kind)).split()[1]) / 1e3


def test_only_this_machine_and_its_own_pages(three_sensors):
    address = three_sensors
    assert plain(address) == 200
    assert plain(address, Host="evil.example") == 403  # a name that was pointed here
    assert plain(address + "report") == 404
    assert plain(address + "static/../app.py") == 404

    async def origins():
        await heard(address, 0.2)
        own = f"http://{urlsplit(address).netloc}"
        await heard(address, 0.2, origin=own)
        for foreign in ("http://evil.example", own.replace("http", "https"), "http://[", "null"):
            with pytest.raises(InvalidStatus) as refused:
                await heard(address, 0.2, origin=foreign)
            assert refused.value.response.status_code == 403
        with pytest.raises(InvalidStatus):
            await heard(address, 0.2, additional_headers={"Host": "evil.example"})

    run(origins)


def test_another_address_needs_its_secret(live):
    address = live("sim", "--listen", "127.0.0.1")
    bare = address.partition("?")[0]
    assert len(address.partition("token=")[2]) > 20
    assert (plain(address), plain(bare), plain(bare + "?token=guess")) == (200, 403, 403)

    async def both():
        statuses, *_ = await heard(address, 0.5)
        assert statuses[0]["type"] == "hello"
        with pytest.raises(InvalidStatus):
            await heard(bare, 0.2)

    run(both)


def deaf(address):
    """A client that asks for everything and reads nothing."""
    parts = urlsplit(address)
    one = socket.socket()
    one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    one.connect((parts.hostname, parts.port))
    one.sendall(
        f"GET /socket HTTP/1.1\r\nHost: {parts.netloc}\r\nUpgrade: websocket\r\nConnection: Upgrade"
        "\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n".encode()
    )
    return one


async def shout(address, lines):
    """Send so many malformed messages, over a new connection whenever it is let go."""
    sent = 0
    while sent < lines:
        async with connect(socket_of(address), max_size=None) as one:
            try:
                for k in range(21):  # that is one more than are borne
                    await one.send(os.urandom(50) if k % 2 else "[" * 2000)
                    sent += 1
                async for _ in one:
                    pass
            except ConnectionClosed:
                pass
    return sent


@pytest.mark.slow
def test_twenty_clients_a_deaf_one_and_ten_thousand_malformed_messages(sensor, live):
    address = live(f"tcp://127.0.0.1:{sensor.port}", "--field", "50000")

    def served(statuses, count):
        return len(statuses) > 8 and count > 250

    async def all_at_once():
        await heard(address, 0.7)
        before = megabytes(live.process)
        silent = [deaf(address) for _ in range(3)]
        loud = asyncio.gather(*(shout(address, 1000) for _ in range(10)))
        results = await asyncio.gather(*(heard(address, 60.0, served) for _ in range(20)))
        sent = await loud
        after = megabytes(live.process)
        for one in silent:
            one.close()
        return results, sum(sent), after - before

    results, sent, grown = run(all_at_once)
    assert sent >= 10_000
    for statuses, count in results:
        assert served(statuses, count)  # whoever else is deaf or loud
        versions = [s["version"] for s in statuses[1:]]
        assert versions == sorted(versions)
    assert grown < 40
    assert plain(address) == 200


def test_the_source_may_send_anything(sensor, live):
    address = live(f"tcp://127.0.0.1:{sensor.port}", "--field", "50000")

    async def through():
        await heard(address, 1.0)
        before = megabytes(live.process)
        sensor.send(*[b"8" * 1_000_000] * 400, b"\n")  # ten times what it may take
        sensor.send(os.urandom(2_000_000) + b"\n")
        statuses, count = await heard(address, 60.0, lambda s, n: len(s) > 8 and n > 100)
        return statuses, count, megabytes(live.process, "VmHWM") - before

    statuses, count, grown = run(through)
    assert grown < 40
    assert count > 100
    assert statuses[-1]["sensors"][0]["heading_sd_deg"] is not None


def test_messages_are_what_they_are_told_to_be():
    assert messages.parse_request('{"type":"accept"}') == messages.Accept()
    for wrong in ("", "[]", "null", '{"type":"write"}', b"\xff\xfe", "[" * 100_000, '{"type":1}'):
        assert messages.parse_request(wrong) is None
    rows = np.arange(6, dtype=np.float32).reshape(2, 3)
    data = messages.encode_points(1, 2, 5.0, rows)
    assert struct.unpack("<IId", data[:16]) == (1, 2, 5.0)
    np.testing.assert_array_equal(np.frombuffer(data[16:], "<f4").reshape(-1, 3), rows)


def test_the_ring_holds_the_latest():
    shown = RecentReadings(100)
    shown.add(np.arange(750.0).reshape(250, 3), 1.0)
    assert shown.total == 250
    np.testing.assert_array_equal(shown.since(245, 50)[:, 0], np.arange(735, 750, 3))
    assert len(shown.since(0, 1000)) == 100
    shown.add(np.array([[np.nan, 0, 0], [1e300, 0, 0]]), 2.0)
    assert shown.total == 251
