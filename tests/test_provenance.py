"""Where a result came from."""

import hashlib
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

import agonic as ag
from agonic.provenance import Input, hash_file


def test_a_file_is_known_by_its_bytes(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(b"time_s,mag_x_nT\n" * 100_000)
    assert hash_file(path) == hashlib.sha256(path.read_bytes()).hexdigest()


def test_an_array_is_known_by_its_numbers_not_its_layout() -> None:
    rows = np.arange(12.0).reshape(4, 3)
    known = Input.of_array("mag", rows)
    assert (known.name, known.count) == ("mag", 4)
    assert known == Input.of_array("mag", np.asfortranarray(rows))
    assert known == Input.of_array("mag", rows.astype(">f8"))
    assert known.sha256 != Input.of_array("mag", rows + 1e-9).sha256


def test_every_result_says_by_what_and_when_it_was_made() -> None:
    provenance = ag.Provenance()
    assert provenance.software == f"agonic {ag.__version__}"
    age = datetime.now(UTC) - datetime.fromisoformat(provenance.created)
    assert abs(age.total_seconds()) < 5
