"""What all tests share: where the recorded data are, and how hypothesis behaves."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest
from hypothesis import settings

pytest_plugins = ["bag_fixtures"]  # bags made without ROS, for every room that reads them

# A shell starts background jobs with SIGINT ignored, and every program a test starts would inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# A busy machine must not turn a slow example into a failure, nor a new example a run of tests that nobody touched:
# examples are the same in every run, and `make campaign` looks for others.
settings.register_profile("suite", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None, max_examples=1000, print_blob=True)
settings.load_profile("suite")


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the recorded data: GBAS_DATA, or shared/data beside the repository.

    Without it tests skip on a user's machine and fail in continuous integration.
    """
    folder = Path(os.environ.get("GBAS_DATA") or Path(__file__).resolve().parents[2] / "shared" / "data")
    if not folder.is_dir():
        problem = f"no recorded data at {folder}; set GBAS_DATA"
        if os.environ.get("CI"):
            pytest.fail(problem)
        pytest.skip(problem)
    return folder
