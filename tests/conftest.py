import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def scenarios_folder() -> Path:
    """Folder of recorded scenarios, which are too many to ship; `INTERDRIVE_SCENARIOS` says where it is."""
    folder = Path(os.environ.get("INTERDRIVE_SCENARIOS", ROOT.parent / "shared" / "scenarios"))
    if not folder.is_dir():
        message = f"no recorded scenarios in {folder}: set INTERDRIVE_SCENARIOS to their folder"
        if os.environ.get("CI") == "true":
            pytest.fail(message)
        pytest.skip(message)
    return folder
