"""The MotionCal packet: bytes as a known device stores them."""

import struct

import numpy as np
import pytest

from agonic.calibration.affine import Affine
from agonic.errors import LogError, UnitError
from agonic.exports.motioncal import compute_crc16, encode_packet, make_packet, write_motioncal
from tests.exports.read_back import apply_motioncal, parse_motioncal

# A packet that a device took: kimxilxyong/Arduino, Projects/Callibration/
# WriteStaticCalibrationData/WriteStaticCalibrationData.ino (public domain).
GOLDEN = bytes.fromhex(
    "7554" + "00" * 24 + "2FAC9141 00B0ADBE 4A3E8E42 66EE2342"
    "1EF0823F F65F753F 52B4823F 482E96BC A07BE63C 4040213C 9D2E"
)
MATRIX = np.array([[1.2, 0.03, -0.02], [0.03, 1.1, 0.05], [-0.02, 0.05, 1.0]])
MAG = Affine(bias=[3000.0, -2000.0, 100.0], matrix=MATRIX, magnitude=48000.0)


def test_a_known_packet_is_read_and_written_byte_for_byte(tmp_path):
    path = tmp_path / "golden.bin"
    path.write_bytes(GOLDEN)
    packet = parse_motioncal(path)
    assert packet.offset == pytest.approx((18.209, -0.3392, 71.1217), abs=1e-3)
    assert packet.field == pytest.approx(40.983, abs=1e-3)
    assert packet.matrix[:3] == pytest.approx((1.0229, 0.9585, 1.0211), abs=1e-4)
    assert encode_packet(packet) == GOLDEN


def test_counts_are_tenths_of_a_microtesla_where_the_field_is_known(tmp_path):
    """A device multiplies its counts by 0.1 uT before it applies the packet."""
    counted = Affine(
        bias=[30.0, -20.0, 1.0], matrix=91.7 * MATRIX, unit_in="raw", magnitude=48000.0
    )
    written = write_motioncal(counted, tmp_path / "mag.bin")
    counts = np.array([[310.0, -140.0, 222.0]])
    found = apply_motioncal(parse_motioncal(written.path), 0.1 * counts)
    assert found == pytest.approx(counted.correct(counts) / 1000, rel=1e-5)
    assert "one is 101 nT" in written.warnings[-1]
    with pytest.raises(UnitError):
        write_motioncal(Affine(bias=[0] * 3, matrix=MATRIX, unit_in="raw", unit_out="raw"), "m.bin")


def test_crc_of_the_standard_check_string():
    assert compute_crc16(b"123456789") == 0x4B37  # CRC-16/MODBUS
    assert compute_crc16(GOLDEN) == 0


def test_numbers_stand_where_the_device_looks(tmp_path):
    data = write_motioncal(MAG, tmp_path / "mag.bin").path.read_bytes()
    assert len(data) == 68
    assert compute_crc16(data) == 0
    values = struct.unpack("<16f", data[2:66])
    assert values[:6] == (0,) * 6
    assert values[6:10] == pytest.approx((3.0, -2.0, 0.1, 48.0))
    assert values[10:] == pytest.approx((1.2, 1.1, 1.0, 0.03, -0.02, 0.05))


def test_apply_is_the_devices_arithmetic():
    packet = make_packet(MAG)[0]
    assert apply_motioncal(packet, [13.0, -2.0, 0.1]) == pytest.approx([12.0, 0.3, -0.2])


def test_an_unknown_field_is_said():
    unknown = Affine(bias=np.zeros(3), matrix=MATRIX)
    packet, warnings = make_packet(unknown)
    assert packet.field == 50.0
    assert any("50 uT" in w for w in warnings)
    assert make_packet(MAG)[1] == ()


@pytest.mark.parametrize(
    "damaged", [b"", GOLDEN[:-1], GOLDEN + b"\0", b"\0" * 68, GOLDEN[:40] + b"\1" + GOLDEN[41:]]
)
def test_damage_is_found(damaged, tmp_path):
    path = tmp_path / "mag.bin"
    path.write_bytes(damaged)
    with pytest.raises(LogError, match="not a MotionCal packet"):
        parse_motioncal(path)
