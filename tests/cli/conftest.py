import pytest


@pytest.fixture(autouse=True)
def no_warnings_in_subprocesses(monkeypatch):
    """Commands that tests start in processes of their own fail on warnings, as those in this process do."""
    monkeypatch.setenv("PYTHONWARNINGS", "error")
