"""The version and the licences of a release stand in one place."""

import re
import tomllib
from pathlib import Path

import interdrive

ROOT = Path(__file__).parents[2]
VERSION = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]["package"]["version"]


def test_the_package_and_the_citation_have_the_version_of_cargo_toml():
    assert interdrive.__version__ == VERSION
    cited = re.search(r"^version: (.*)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
    assert cited
    assert cited[1] == VERSION


def test_every_crate_of_the_lock_file_that_is_compiled_in_has_its_licence_in_the_wheel():
    licences = (ROOT / "LICENSES-RUST.txt").read_text(encoding="utf-8")
    lock = tomllib.loads((ROOT / "Cargo.lock").read_text(encoding="utf-8"))
    versions = {package["name"]: package["version"] for package in lock["package"]}
    found = dict(re.findall(r"^={100}\n(\S+) (\S+) \(", licences, re.MULTILINE))
    assert {"rayon", "pyo3", "numpy"} <= found.keys()
    assert {name: versions[name] for name in found} == found
