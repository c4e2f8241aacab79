"""A MotionCal device on a pseudo-terminal: it takes the packet, and tells what it keeps."""

import time

import numpy as np
import pytest

from agonic.live.streams import open_source
from agonic.live.web.plan import Plan
from agonic.live.web.session import Session
from agonic.reference import Reference
from tests.live.motioncal_device import Device


@pytest.mark.slow
@pytest.mark.parametrize(("wrong", "says"), [(0.0, "read back: the device has it"), (1.0, "V x")])
def test_the_packet_is_sent_after_the_offer_and_read_back(tmp_path, wrong, says):
    device = Device(wrong)
    plan = Plan(folder=tmp_path, reference=Reference.constant(50_000.0))
    session = Session(open_source(f"serial:{device.path}"), plan)
    session.start()
    try:
        until = time.monotonic() + 15
        while not session.status.sensors or session.status.sensors[0].n < 300:
            assert time.monotonic() < until
            time.sleep(0.05)
        assert session.status.device == "MotionCal device"
        session.offer("mag")
        assert device.kept is None
        assert [one.old for one in session.status.offer] == [None] * 10
        session.write("mag")
        made = session.results[0].fit.calibration
        np.testing.assert_allclose(device.kept[6:9], made.bias / 1000, rtol=1e-5)
        assert says in session.status.device_says
    finally:
        session.stop()
        device.close()
