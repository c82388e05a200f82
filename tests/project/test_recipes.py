"""The recipes for containers and conda ask for what the package asks for."""

import re
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "releases"))

from container import TRIALS, in_root, steps_of  # noqa: E402

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
#: Names on conda-forge that differ; this one leaves out the windows of matplotlib.
CALLED = {"matplotlib": "matplotlib-base"}


def needed():
    """Requirements of the package by their names on conda-forge."""
    found = {}
    for line in PROJECT["dependencies"]:
        name, bounds = re.fullmatch(r"([\w-]+)(.*)", line).groups()
        found[CALLED.get(name, name)] = bounds
    return found


def stated(lines):
    """Requirements of a recipe by name."""
    return {name: "".join(bounds) for name, *bounds in (line.split(" ") for line in lines)}


def test_the_conda_recipe_has_the_version_the_requirements_and_the_python_of_the_package():
    recipe = yaml.safe_load((ROOT / "releases/conda/recipe.yaml").read_text(encoding="utf-8"))
    version = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]["package"]["version"]
    assert recipe["context"]["version"] == version
    assert stated(recipe["requirements"]["run"]) == {**needed(), "python": PROJECT["requires-python"]}
    backend = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]["requires"]
    host = stated(recipe["requirements"]["host"])
    assert [f"maturin{host['maturin']}"] == backend
    assert recipe["about"]["license"] == PROJECT["license"]
    assert all((ROOT / name).is_file() for name in recipe["about"]["license_file"])
    assert (ROOT / "releases/conda" / recipe["source"]["path"]).resolve() == ROOT


def test_the_conda_environment_has_the_requirements_of_the_package():
    lines = yaml.safe_load((ROOT / "releases/conda/environment.yaml").read_text(encoding="utf-8"))["dependencies"]
    from_index = next(line["pip"] for line in lines if isinstance(line, dict))
    found = stated(line for line in (*lines, *from_index) if isinstance(line, str))
    assert found == {**needed(), "python": PROJECT["requires-python"], "pip": "", "interdrive": ""}


def test_the_container_has_a_python_that_the_package_takes_and_copies_the_wheel():
    steps = steps_of((ROOT / "Dockerfile").read_text(encoding="utf-8"))
    assert steps[0] == ("FROM", "debian:bookworm-slim"), "its Python is 3.11"
    assert PROJECT["requires-python"] == ">=3.11"
    assert ("COPY", "dist/*.whl /opt/wheels/") in steps
    assert steps[-1] == ("ENTRYPOINT", '["interdrive"]')
    ignored = (ROOT / ".dockerignore").read_text(encoding="utf-8").split()
    assert ignored == ["*", "!dist/*.whl"], "nothing else is sent to docker"


def test_what_is_tried_in_the_container_are_commands_that_exist(tmp_path, monkeypatch):
    from click.testing import CliRunner

    from interdrive.cli import main

    monkeypatch.chdir(tmp_path)
    for trial in TRIALS:
        assert CliRunner().invoke(main, list(trial)).exit_code == 0


def test_a_step_that_an_empty_root_cannot_do_is_named(tmp_path):
    with pytest.raises(SystemExit, match="HEALTHCHECK: this step is not known here"):
        in_root(tmp_path, [("HEALTHCHECK", "NONE")])
    with pytest.raises(SystemExit, match="only debian can be made here"):
        in_root(tmp_path, [("FROM", "alpine:3")])
