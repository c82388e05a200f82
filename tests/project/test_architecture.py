"""The picture in ARCHITECTURE.md is the one that the layer checks use."""

import ast
import importlib
import re
import tomllib
from graphlib import TopologicalSorter
from pathlib import Path

import grimp

import interdrive as idr
from interdrive import _core
from interdrive.criticality import IMPACT_AREAS, MEASURES
from interdrive.run import ORDERS, PLAN_STATUS, SERVICES, VIA
from interdrive.run.assemble import OUTCOME_NAMES
from interdrive.scenario import KINDS, SIGNALS
from interdrive.scenario.control import TURNS
from interdrive.scenario.inspection import AREA_KINDS, PRECEDENCE

ROOT = Path(__file__).parents[2]
PICTURE = re.search(r"## The picture\n\n(.*?)\n\n", (ROOT / "ARCHITECTURE.md").read_text(), re.DOTALL)[1]
PYTHON, RUST = (
    [line.strip().split("  ")[0] for line in part.splitlines() if line.strip()]
    for part in re.split(r"\n    ---.*", PICTURE)
)


def test_the_python_part_is_what_import_linter_checks():
    with (ROOT / "pyproject.toml").open("rb") as file:
        contracts = tomllib.load(file)["tool"]["importlinter"]["contracts"]
    layers = next(contract["layers"] for contract in contracts if contract["type"] == "layers")
    assert layers == PYTHON


def test_no_file_imports_itself_in_a_circle():
    """Imports in functions and for type checkers count; import-linter compares packages with those beside them only."""
    graph = grimp.build_graph("interdrive", cache_dir=None)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    assert len(imports) > 200
    TopologicalSorter(imports).prepare()  # raises CycleError, which names the circle


def test_no_layer_has_an_exception():
    with (ROOT / "pyproject.toml").open("rb") as file:
        checks = tomllib.load(file)["tool"]["importlinter"]
    rules = [checks, *(contract for contract in checks["contracts"] if contract["type"] != "protected")]
    assert not any({"ignore_imports", "exclude_type_checking_imports"} & rule.keys() for rule in rules)


def test_type_checkers_see_the_names_that_the_package_offers():
    stub = ast.parse((ROOT / "python" / "interdrive" / "__init__.pyi").read_text())
    homes = {name.asname: statement.module for statement in stub.body for name in statement.names}
    assert sorted(homes) == idr.__all__
    for name, home in homes.items():
        assert getattr(idr, name) is getattr(importlib.import_module(home), name), name


def test_what_the_table_of_decisions_names_stands_where_it_says():
    """`file`: `name`, `name`; of `Class.method` and `Type::function` the last part counts."""
    table = (ROOT / "ARCHITECTURE.md").read_text().partition("## Where is it decided")[2].partition("## One step")[0]
    every = (
        path
        for folder in ("python/interdrive", "crates/core/src", "crates", "frontend/src", "benchmarks")
        for path in (ROOT / folder).rglob("*.*")
    )
    files = sorted(every, key=lambda path: len(path.parts))
    answers = re.findall(r"`([\w/]+\.(?:py|rs|ts))`(?:: ((?:`[\w.:]+`(?:, )?)+))?", table)
    assert len(answers) > 150
    for path, names in answers:
        named = next((file for file in files if file.as_posix().endswith(f"/{path}")), None)
        assert named is not None, path
        for name in re.findall(r"[\w.:]+", names):
            last = re.split(r"\.|::", name)[-1]
            assert re.search(rf"\b{last}\b", named.read_text()), f"{path} has no {name}"


def test_the_rust_part_is_the_order_in_lib_rs():
    lib = (ROOT / "crates" / "core" / "src" / "lib.rs").read_text()
    assert RUST[0].startswith("interdrive._core")
    assert [name for line in RUST[1:] for name in line.split(", ")] == re.findall(r"^pub mod (\w+);", lib, re.M)[::-1]


def test_no_module_of_the_package_imports_the_package_itself():
    """import-linter takes the compiled core for the package and cannot tell."""
    found = {
        names
        for path in (ROOT / "python" / "interdrive").rglob("*.py")
        for names in re.findall(r"^\s*from interdrive import (.*)", path.read_text(), re.M)
    }
    assert found == {"_core"}


#: The words of `interdrive check`, and what the core calls these reasons.
REASONS_IN_THE_CORE = {
    "by arrival": "arrival",
    "by signs": "sign",
    "left turns wait": "oncoming",
    "minor roads wait": "minor",
    "main road first": "main_road",
    "by side": "side",
    "lane that goes on first": "continues",
    "smaller turn first": "turn",
}


def test_codes_mean_the_same_on_both_sides_of_the_boundary():
    def snake(name: str) -> str:
        return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()

    ours = {
        "kind": KINDS,
        "outcome": OUTCOME_NAMES,
        "plan_status": PLAN_STATUS,
        "impact_area": IMPACT_AREAS,
        "service": SERVICES,
        "via": VIA,
        "signal": SIGNALS,
        "turn": TURNS,
        "area_kind": tuple({"crossing": "cross"}.get(kind, kind) for kind in AREA_KINDS),
        "precedence": tuple(REASONS_IN_THE_CORE[text] for text in PRECEDENCE),
        "order": ORDERS,
        "measure": tuple(measure.name for measure in MEASURES),
    }
    assert {what: tuple(map(snake, names)) for what, names in _core.CODES.items()} == ours
