"""What is no log is named in one line, with what to do: documents of agonic, pictures, folders."""

from zipfile import ZipFile

import numpy as np
import pytest

import agonic as ag
from agonic.errors import LogError
from agonic.logs.read import open_log, read

TABLE = "time_s,mag_x_nT,mag_y_nT,mag_z_nT\n" + "".join(f"{k},1,{k},3\n" for k in range(9))
GIVEN = {
    "": "the file is empty",
    "[[compass]]\ncalibration = 'mag.json'\n": "a set-up of compasses, no log: agonic heading",
    "files = 'station-{station:02d}.csv'\n[[sensor]]\nname = 'a'\n[[station]]\n": "fit thermal",
    "unit = 'uT'\n[columns]\nx = 'mx'\n": "name the log that it lies beside",
    "[tool]\nname = 'x'\n": "a file of settings",
    '<!DOCTYPE html>\n<meta name="generator" content="agonic">': "a report of agonic, no log",
    '{"schema": "agonic/fit@1", "sensors": []}': r"a result of agonic \(agonic/fit\), no log",
    "compass_deg,magnetic_deg\n0,10\n90,95\n": "a compass swing, no log: agonic fit deviation",
    "source,sha256,bias_x,residual_rms\na,b,1,2\n": "the table of a fleet, no log: agonic history",
    "%PDF-1.7\n": "a PDF document, no log; agonic reads tables",
    "\x89PNG\r\n\x1a\n": "a PNG picture",
    "FEA1\0\0\0\0": "an old Feather file",
}


@pytest.mark.parametrize("content", GIVEN)
def test_what_is_no_log(tmp_path, content):
    (tmp_path / "given").write_bytes(content.encode("latin-1"))
    with pytest.raises(LogError, match=GIVEN[content]) as caught:
        open_log(tmp_path / "given")
    assert len(str(caught.value)) < 350
    assert "\n" not in str(caught.value)


def test_a_calibration(tmp_path):
    fit = ag.fit_ellipsoid(ag.simulate("tumble", n=300, seed=1).samples)
    ag.save(fit.calibration, tmp_path / "mag.json")
    with pytest.raises(LogError, match="this is a calibration, no log: agonic report CAL"):
        open_log(tmp_path / "mag.json")


def test_folders(tmp_path):
    with pytest.raises(LogError, match="no files in it"):
        open_log(tmp_path)
    for name in "ab":
        (tmp_path / f"{name}.csv").write_text(TABLE)
    with pytest.raises(LogError, match=r"a folder of 2 files \(a.csv, b.csv\).*agonic fleet"):
        open_log(tmp_path)
    with ZipFile(tmp_path / "c.zip", "w") as archive:
        archive.writestr("a.csv", TABLE)
        archive.writestr("b.csv", TABLE)
    with pytest.raises(LogError, match=r"an archive of 2 files .*; unpack it, then name one"):
        open_log(tmp_path / "c.zip")
    (tmp_path / "campaign.toml").write_text("files = 'a.csv'\n")
    with pytest.raises(LogError, match="a chamber campaign: agonic fit thermal FOLDER"):
        open_log(tmp_path)


def test_an_archive_of_one_log_is_that_log(tmp_path):
    """Of any kind, not only a table."""
    field = np.random.default_rng(1).normal(0, 3e4, (50, 3))
    np.save(tmp_path / "mag_nT.npy", field)
    with ZipFile(tmp_path / "log.zip", "w") as archive:
        archive.write(tmp_path / "mag_nT.npy", "monday/mag_nT.npy")
    np.testing.assert_allclose(read(tmp_path / "log.zip", unit="nT").field, field)
    with ZipFile(tmp_path / "inner.zip", "w") as archive:
        archive.writestr("a.csv", TABLE)
    with ZipFile(tmp_path / "outer.zip", "w") as archive:
        archive.write(tmp_path / "inner.zip", "inner.zip")
    with pytest.raises(LogError, match="an archive within an archive"):
        read(tmp_path / "outer.zip")
