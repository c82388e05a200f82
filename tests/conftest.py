import os
import shutil
import signal
import tarfile
from pathlib import Path

import commonroad_documents as cr
import pytest

from interdrive import InputError, Scenario, read_scenario
from interdrive.files import scenario_folders
from interdrive.predictors import models
from interdrive.predictors.walenet import network

IN_CI = os.environ.get("CI") == "true"

# A shell starts its background jobs with Ctrl-C switched off, and the commands that tests interrupt would inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)
ROOT = Path(__file__).resolve().parent.parent


def _fail_if_skipped(report) -> None:
    """In CI everything that a test needs is there or is made, so a test that is skipped is one that rots."""
    if IN_CI and report.skipped and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"skipped, which is a failure in CI: {report.longrepr[2]}"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    report = yield
    _fail_if_skipped(report)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector):
    report = yield
    _fail_if_skipped(report)
    return report


@pytest.hookimpl(tryfirst=True)  # before `-m` chooses
def pytest_collection_modifyitems(items):
    """Tests that read all recorded scenarios are marked, and come first, so that one worker reads them for all."""
    for item in items:
        if {"recorded_scenarios", "real_recordings"} & set(getattr(item, "fixturenames", ())):
            item.add_marker("recorded")
    items.sort(key=lambda item: item.get_closest_marker("recorded") is None)


@pytest.fixture(scope="session")
def scenarios_folder() -> Path:
    """Folder of recorded scenarios, which are too many to ship: the first one that `INTERDRIVE_SCENARIOS` names."""
    folder = next(iter(scenario_folders()), ROOT.parent / "shared" / "scenarios")
    if not folder.is_dir():
        pytest.skip(f"no recorded scenarios in {folder}: set INTERDRIVE_SCENARIOS to their folder")
    return folder


@pytest.fixture(scope="session")
def inputs_folder() -> Path:
    """Folder of maps and recordings of other tools, which may not be shipped; `INTERDRIVE_INPUTS` says where it is."""
    folder = Path(os.environ.get("INTERDRIVE_INPUTS", ROOT.parent / "shared" / "inputs"))
    if not folder.is_dir():
        pytest.skip(f"no maps of other tools in {folder}: set INTERDRIVE_INPUTS to their folder")
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
def real_recordings(tmp_path_factory) -> dict[str, list[Path]]:
    """Windows of real recordings by place; `INTERDRIVE_REAL_RECORDINGS` says where their archive is."""
    archive = Path(os.environ.get("INTERDRIVE_REAL_RECORDINGS", ROOT.parent / "shared" / "real_recordings.tar.xz"))
    if not archive.is_file():
        pytest.skip(f"no real recordings in {archive}: set INTERDRIVE_REAL_RECORDINGS to their archive")
    folder = tmp_path_factory.mktemp("real_recordings")
    with tarfile.open(archive) as packed:
        packed.extractall(folder, filter="data")
    found: dict[str, list[Path]] = {}
    for path in sorted(folder.rglob("*.xml")):
        found.setdefault(path.parent.name, []).append(path)
    return found


@pytest.fixture(scope="session")
def published_walenet():
    """The network WALENET with its published weights, which are installed if they are not; skipped offline."""
    if not models.is_installed():
        try:
            models.install()
        except InputError as error:
            pytest.skip(f"the weights of walenet are not on this machine and cannot be installed now: {error}")
    return network()


@pytest.fixture
def read(tmp_path):
    """Reads a document from text."""
    return lambda text, name="test.xml": read_scenario(cr.saved(tmp_path, text, name))


@pytest.fixture
def ffmpeg(tmp_path_factory, monkeypatch) -> str:
    """The program ffmpeg, which is on the PATH of the test: the machine's, or that of the wheel imageio-ffmpeg."""
    program = shutil.which("ffmpeg")
    if program is None:
        try:
            import imageio_ffmpeg
        except ImportError:
            pytest.skip("no ffmpeg on the PATH and no imageio-ffmpeg: MP4 cannot be tested")
        place = tmp_path_factory.mktemp("bin")
        (place / "ffmpeg").symlink_to(imageio_ffmpeg.get_ffmpeg_exe())
        monkeypatch.setenv("PATH", f"{place}{os.pathsep}{os.environ['PATH']}")
        program = str(place / "ffmpeg")
    return program
