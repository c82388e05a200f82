import os
from pathlib import Path

import pytest

import commonroad_documents as cr
from interdrive import InputError, Scenario, _core, read_scenario
from interdrive.predictors.models import WALENET

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


@pytest.fixture(scope="session")
def recorded_scenarios(scenarios_folder) -> dict[str, Scenario | InputError]:
    """Every recorded scenario by its path in the folder, read once; the error of those that are refused."""
    found: dict[str, Scenario | InputError] = {}
    for path in sorted(scenarios_folder.glob("*/*.xml")):
        try:
            found[str(path.relative_to(scenarios_folder))] = read_scenario(path)
        except InputError as error:
            found[str(path.relative_to(scenarios_folder))] = error
    assert found, f"{scenarios_folder} holds no scenarios"
    return found


@pytest.fixture(scope="session")
def published_walenet() -> _core.Walenet:
    """The network WALENET with its published weights, which are installed if they are not; skipped offline."""
    if not WALENET.is_installed():
        try:
            WALENET.install()
        except InputError as error:
            message = f"the weights of walenet are not on this machine and cannot be installed now: {error}"
            if os.environ.get("CI") == "true" and "no connection" not in str(error):
                pytest.fail(message)
            pytest.skip(message)
    return _core.Walenet(WALENET.weights().tensors)


@pytest.fixture
def read(tmp_path):
    """Reads a document from text."""
    return lambda text, name="test.xml": read_scenario(cr.saved(tmp_path, text, name))
