"""What all tests share."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

# The same examples every time, and none failed for the machine being busy.
settings.register_profile("steady", derandomize=True, deadline=None)
settings.load_profile("steady")


@pytest.fixture(scope="session")
def recordings() -> Path:
    """The folder of real recordings; tests that need it are skipped where it is absent."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "recordings"
    folder = Path(os.environ.get("AGONIC_RECORDINGS", beside))
    if not folder.is_dir():
        pytest.skip("recordings not found: set AGONIC_RECORDINGS")
    return folder
