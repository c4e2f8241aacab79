"""Object storage: the same results as from the disk, against a local server of the S3 protocol."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest

import agonic as ag
from agonic.fleet.engine import Here
from agonic.fleet.run import run_fleet
from agonic.logs import parquet
from agonic.logs.remote import Remote, fetch, list_remote
from agonic.simulation import simulate
from tests.command_line import answer

pytest.importorskip("moto")
pytest.importorskip("flask")
BUCKET = "s3://magnetometers"


@pytest.fixture(scope="module")
def storage() -> Iterator[None]:
    """A server of the protocol with an empty bucket, as the environment names one."""
    import boto3
    from moto.server import ThreadedMotoServer

    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    address = f"http://{host}:{port}"
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (
            ("AWS_ACCESS_KEY_ID", "anybody"),
            ("AWS_SECRET_ACCESS_KEY", "anything"),
            ("AWS_DEFAULT_REGION", "us-east-1"),
            ("AWS_ENDPOINT_URL", address),
            ("NO_PROXY", "127.0.0.1"),
        ):
            patch.setenv(name, value)
        boto3.client("s3", endpoint_url=address).create_bucket(Bucket="magnetometers")
        yield
    server.stop()


def put(path: Path, key: str) -> str:
    """Copy a file into the bucket; its URL."""
    from pyarrow.fs import FileSystem

    system, at = FileSystem.from_uri(f"{BUCKET}/{quote(key)}")
    with path.open("rb") as source, system.open_output_stream(at) as target:
        shutil.copyfileobj(source, target)
    return f"{BUCKET}/{key}"


def write_parquet(path: Path, seed: int, n: int = 30_000) -> Path:
    import pyarrow as pa
    from pyarrow.parquet import write_table

    made = simulate("sphere", n=n, seed=seed).samples
    axes = {f"mag_{axis}_nT": made.field[:, k] for k, axis in enumerate("xyz")}
    write_table(pa.table({"time_s": np.arange(n) / 50.0 + seed * n, **axes}), path)
    return path


def test_a_log_is_read_as_from_the_disk(storage: None, tmp_path: Path) -> None:
    local = ag.write_csv(simulate("sphere", n=300, seed=1).samples, tmp_path / "board 7.csv")
    url = put(local, "day 1/board 7.csv")
    here, there = ag.read(local), ag.read(url)
    np.testing.assert_array_equal(here.field, there.field)
    assert here.source == there.source  # name, SHA-256 and count: the origin is the content


@pytest.mark.slow
def test_a_long_recording_is_fitted_where_it_lies(storage: None, tmp_path: Path) -> None:
    """No copy is made: only the columns that count are asked for."""
    files = [write_parquet(tmp_path / f"day{k}.parquet", seed=k) for k in (1, 2)]
    urls = [put(file, f"long/{file.name}") for file in files]
    reference = ag.Reference.constant(50_000)
    fits = [ag.fit_recording(ag.inflight.open_mission(of), reference) for of in (files, urls)]
    np.testing.assert_array_equal(fits[0].calibration.bias, fits[1].calibration.bias)
    assert fits[1].n == 60_000
    assert fits[0].calibration.provenance.inputs == fits[1].calibration.provenance.inputs


@pytest.mark.slow
def test_a_fleet_in_a_bucket_has_the_table_of_one_on_the_disk(
    storage: None, tmp_path: Path
) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    for seed in range(3):
        made = simulate("sphere", n=300, seed=seed).samples
        put(ag.write_csv(made, folder / f"board{seed}.csv"), f"fleet/a{seed}/board{seed}.csv")
    (folder / "notes.pdf").write_bytes(b"nothing")
    put(folder / "notes.pdf", "fleet/notes.pdf")
    local = run_fleet([folder], tmp_path / "local", engine=Here())
    remote = run_fleet([f"{BUCKET}/fleet"], tmp_path / "remote", engine=Here())
    for column in ("sensor", "verdict", "bias_x", "sha256"):
        assert local.population[column].tolist() == remote.population[column].tolist(), column
    assert remote.population["source"].tolist()[0] == f"{BUCKET}/fleet/a0/board0.csv"
    again = run_fleet([f"{BUCKET}/fleet/*/board*.csv"], tmp_path / "remote", engine=Here())
    assert (again.calibrated, again.resumed) == (0, 3)


def test_the_main_job_takes_a_url(
    storage: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    local = ag.write_csv(simulate("sphere", n=600, seed=2).samples, tmp_path / "board.csv")
    url = put(local, "board.csv")
    status, said = answer(capsys, "calibrate", url, "--field", "50000", "-o", str(tmp_path / "out"))
    assert (status, said["sensors"][0]["verdict"]) == (0, "good")
    assert (tmp_path / "out" / "report.html").exists()


def test_a_parquet_table_is_counted_by_its_footer(storage: None, tmp_path: Path) -> None:
    url = put(write_parquet(tmp_path / "day.parquet", seed=1, n=500), "day.parquet")
    assert parquet.count_rows(Remote(url)) == 500
    with fetch(url) as copy:
        assert copy.name == "day.parquet"
        kept = copy
    assert not kept.exists()


def test_what_is_not_there_is_said_with_its_address(storage: None, tmp_path: Path) -> None:
    with pytest.raises(ag.LogError, match=r"s3://magnetometers/none\.csv"):
        ag.read(f"{BUCKET}/none.csv")
    with pytest.raises(ag.LogError, match="no such file"):
        ag.inflight.open_mission([f"{BUCKET}/none.parquet"])
    with pytest.raises(ag.LogError, match="no such file or folder"):
        list_remote(f"{BUCKET}/nowhere")
    (tmp_path / "empty.csv").write_bytes(b"")
    with pytest.raises(ag.LogError, match=r"s3://magnetometers/empty\.csv: the file is empty"):
        ag.read(put(tmp_path / "empty.csv", "empty.csv"))


def test_other_storage_is_opened_by_fsspec(tmp_path: Path) -> None:
    fsspec = pytest.importorskip("fsspec")
    made = simulate("sphere", n=300, seed=1).samples
    local = ag.write_csv(made, tmp_path / "log.csv")
    with fsspec.open("memory://logs/log.csv", "wb") as stream:
        stream.write(local.read_bytes())
    np.testing.assert_array_equal(ag.read("memory://logs/log.csv").field, ag.read(local).field)
    with pytest.raises(ag.LogError, match="the storage says"):
        ag.read("nothing-of-the-kind://a/b.csv")
