"""What a user passes in and gets back has a type."""

import importlib
import inspect
import re

import pytest

PUBLIC = (
    "interdrive", "interdrive.batch_report", "interdrive.batches", "interdrive.comparison", "interdrive.criticality",
    "interdrive.files",
    "interdrive.planners", "interdrive.plots", "interdrive.prediction_evaluation", "interdrive.predictors",
    "interdrive.report", "interdrive.results", "interdrive.run", "interdrive.runs", "interdrive.scenario",
    "interdrive.studies", "interdrive.testing",
)  # fmt: skip
#: They tell what anything given is.
TELLING = {"native_planner", "native_predictor"}


def annotations(name, thing):
    """Where, name and annotation of every parameter, return value and field."""
    yield from ((name, *pair) for pair in inspect.get_annotations(thing).items())
    if inspect.isclass(thing):
        for part, value in vars(thing).items():
            function = value.fget if isinstance(value, property) else getattr(value, "__func__", value)
            if inspect.isfunction(function) and (not part.startswith("_") or part == "__init__"):
                yield from annotations(f"{name}.{part}", function)


@pytest.mark.parametrize("module", PUBLIC)
def test_no_public_annotation_is_any_or_object(module):
    home = importlib.import_module(module)
    names = [name for name in home.__all__ if name not in TELLING]
    things = {name: thing for name in names if callable(thing := getattr(home, name))}
    found = [one for name, thing in things.items() for one in annotations(name, thing)]
    assert found
    untyped = re.compile(r"(?<!NDArray\[)\b(Any|object)\b")
    assert [one for one in found if untyped.search(str(one[2]))] == []
