"""What all tests share: where the recorded data are, and how hypothesis behaves."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest
from hypothesis import settings

# A shell starts background jobs with SIGINT ignored, and every program a test starts would inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# A busy machine must not turn a slow example into a failure.
settings.register_profile("suite", deadline=None)
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
