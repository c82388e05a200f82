"""Every public name is in the reference, with a docstring that names its arguments and fields and says what raises."""

import ast
import dataclasses
import importlib
import inspect
import re
import textwrap
from pathlib import Path

import pytest

import interdrive

REFERENCE = Path(__file__).parents[2] / "docs" / "reference"
PAGE = (REFERENCE / "python.md").read_text(encoding="utf-8")
MODULES = re.findall(r"^modules/(\w+)$", PAGE, re.MULTILINE)
#: What others raise through a function, and what a protocol makes of its constructor.
INHERITED = {"TypeError"}


def public(name):
    """The names of a module of the reference; `errors` has classes only."""
    module = importlib.import_module(f"interdrive.{name}")
    classes = [each for each, thing in vars(module).items() if inspect.isclass(thing)]
    return [(each, getattr(module, each)) for each in getattr(module, "__all__", classes)]


def words(text):
    return set(re.findall(r"\w+", text))


def documentation(thing):
    """The docstring of a function, or those of a class, of its bases, and of its constructor."""
    if not inspect.isclass(thing):
        return inspect.getdoc(thing) or ""
    known = [base.__doc__ for base in thing.__mro__[:-1]]
    return "\n".join(filter(None, [*known, vars(thing).get("__init__", thing).__doc__]))


def parameters(thing):
    try:
        found = inspect.signature(thing).parameters
    except (TypeError, ValueError):
        return set()
    return {name for name in found if name not in ("self", "cls", "args", "kwargs") and not name.startswith("_")}


def raised(function):
    """The errors that the text of a function raises itself."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    except (OSError, TypeError):
        return set()
    calls = [node.exc for node in ast.walk(tree) if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call)]
    return {call.func.id for call in calls if isinstance(call.func, ast.Name) and call.func.id.endswith("Error")}


def members(thing):
    """Public methods and properties of a class, as functions where they have text."""
    for name, member in vars(thing).items():
        function = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
        if not name.startswith("_") and (callable(function) or inspect.isgetsetdescriptor(function)):
            yield name, function, isinstance(member, property)


def gaps(name, thing):
    """What the documentation of a name lacks."""
    text = documentation(thing)
    if not text:
        return [f"{name}: no docstring"]
    fields = {each.name for each in dataclasses.fields(thing)} if dataclasses.is_dataclass(thing) else parameters(thing)
    wanted = {each for each in fields if not each.startswith("_")} if not issubclass_of_error(thing) else set()
    found = [f"{name}: {each}" for each in sorted(wanted - words(text))]
    found += [
        f"{name}: raises {each}"
        for each in sorted(raised(thing) - INHERITED - words(text))
        if not inspect.isclass(thing)
    ]
    for each, function, is_property in members(thing) if inspect.isclass(thing) else ():
        said = inspect.getdoc(function) or inspect.getdoc(getattr(thing, each)) or ""
        lacking = (set() if is_property else parameters(function)) | (raised(function) - INHERITED)
        found += [f"{name}.{each}: {one}" for one in (sorted(lacking - words(said)) if said else ["no docstring"])]
    return found


def issubclass_of_error(thing):
    return inspect.isclass(thing) and issubclass(thing, Exception)


def test_the_reference_has_every_name_of_the_package():
    named = set(re.findall(r"^\.\. auto\w+:: interdrive\.(\w+)$", PAGE, re.MULTILINE))
    packages = {"batch_report", "criticality", "plots", "reference_drivers", "report"}
    assert set(interdrive.__all__) - named - packages - {"__version__"} == set()


@pytest.mark.parametrize("name", MODULES)
def test_the_page_of_a_module_has_every_name_of_it(name):
    text = (REFERENCE / "modules" / f"{name}.md").read_text(encoding="utf-8")
    assert f".. automodule:: interdrive.{name}\n   :members:" in text
    excluded = set(re.findall(r"\w+", "".join(re.findall(r":exclude-members: (.*)", text))))
    assert excluded <= set(re.findall(r"^\.\. auto\w+:: interdrive\.(\w+)$", PAGE, re.MULTILINE))


@pytest.mark.parametrize("name", ["", *MODULES])
def test_docstrings_name_arguments_and_fields_and_say_what_raises(name):
    things = [(each, getattr(interdrive, each)) for each in interdrive.__all__] if not name else public(name)
    documented = [(each, thing) for each, thing in things if inspect.isclass(thing) or inspect.isfunction(thing)]
    assert documented
    assert [gap for each, thing in documented for gap in gaps(each, thing)] == []


def test_a_docstring_without_an_argument_is_found():
    def drive(speed, heading):
        """Drives at a speed."""
        raise ValueError(f"{speed} {heading}")

    assert gaps("drive", drive) == ["drive: heading", "drive: raises ValueError"]
