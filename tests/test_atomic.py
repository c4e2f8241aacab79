"""Files are replaced whole or not at all."""

import os
import stat
import subprocess
import sys

import pytest

from agonic.atomic import replacing, write_atomically
from agonic.errors import AgonicError


def test_replaces_what_was_there_and_leaves_nothing_else(tmp_path):
    target = tmp_path / "cal.json"
    target.write_text("old")
    assert write_atomically(target, "new µT") == target
    assert target.read_bytes() == "new µT".encode()
    assert os.listdir(tmp_path) == ["cal.json"]


def test_a_crash_before_the_end_keeps_the_old_file(tmp_path, monkeypatch):
    target = tmp_path / "cal.json"
    target.write_text("old")

    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(AgonicError, match="No space left"):
        write_atomically(target, b"new")
    assert target.read_text() == "old"
    assert os.listdir(tmp_path) == ["cal.json"]


def test_follows_a_link_and_keeps_the_permissions(tmp_path):
    target, link = tmp_path / "real.json", tmp_path / "link.json"
    target.write_text("old")
    target.chmod(0o640)
    link.symlink_to(target)
    write_atomically(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"
    assert stat.S_IMODE(target.stat().st_mode) == 0o640


def test_says_what_is_in_the_way(tmp_path):
    with pytest.raises(AgonicError, match="there is no folder"):
        write_atomically(tmp_path / "missing" / "cal.json", "x")
    with pytest.raises(AgonicError, match="folder or a device"):
        write_atomically(tmp_path, "x")
    with pytest.raises(AgonicError, match="folder or a device"):
        write_atomically("/dev/null", "x")


def test_removes_what_killed_processes_left(tmp_path):
    script = (
        "import os, signal\n"
        "from agonic.atomic import replacing\n"
        f"with replacing({str(tmp_path / 'a.csv')!r}) as fresh:\n"
        "    fresh.write_text('half')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    subprocess.run([sys.executable, "-c", script], check=False)
    assert len(os.listdir(tmp_path)) == 1
    with replacing(tmp_path / "b.csv") as fresh:  # another process at work must not lose its own
        fresh.write_text("b")
        other = subprocess.run(
            [sys.executable, "-c", script.replace("os.kill", "print")], check=False
        )
        assert other.returncode == 0
    assert sorted(os.listdir(tmp_path)) == ["a.csv", "b.csv"]


@pytest.mark.parametrize("name", ["a" * 300, "a\0b"])
def test_names_that_no_file_can_have_are_one_line(tmp_path, name):
    with pytest.raises(AgonicError, match="cannot write"):
        write_atomically(tmp_path / name, "x")
