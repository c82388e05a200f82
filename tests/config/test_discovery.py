"""What can be chosen by name: built-in, installed entry points, module:object; listed without crashes."""

import sys

import numpy as np
import pytest
from click.testing import CliRunner

from interdrive import InputError, Simulation, simulate
from interdrive.cli import main
from interdrive.config.plugins import find, listed, versions
from interdrive.errors import MissingExtraError
from interdrive.planners import NATIVE
from interdrive.testing import problem, straight_road, world

MODULE = '''"""Planners of a distribution."""
from dataclasses import dataclass, field
import numpy as np
from interdrive import Trajectory

@dataclass
class Cautious:
    """Drives slower than it could.

    Attributes:
        share: Of the present speed it keeps this.
        gap: Distance to a leader [m].
    """

    gap: float
    share: float = 0.99
    memory: list = field(default_factory=list, init=False)

    def plan(self, view, predictions):
        ego, time = view.ego, np.arange(31) * view.dt
        speed = self.share * ego.velocity
        return Trajectory(ego.x + speed * time, np.full(31, ego.y), np.zeros(31), np.full(31, speed))

class Lucky:
    """Expects nothing."""

    def predict(self, scene):
        raise RuntimeError("luck is not a method")

def ordinary():
    """Makes a cautious one."""
    return Cautious(gap=2.0)
'''


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Two distributions that offer planners and predictors, some of which cannot be used."""

    def distribution(name, entry_points, metadata=""):
        folder = tmp_path / f"{name}-1.2.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n{metadata}")
        (folder / "entry_points.txt").write_text(entry_points)

    (tmp_path / "careful.py").write_text(MODULE)
    (tmp_path / "breaks.py").write_text("import sys\nsys.exit('no licence')\n")
    (tmp_path / "lacks.py").write_text("import a_library_that_does_not_exist\n")
    distribution(
        "careful",
        "[interdrive.planners]\ncautious = careful:Cautious\nbreaks = breaks:Planner\nlacks = lacks:Planner\n"
        "frenet = careful:Cautious\ntwice = careful:Cautious\n[interdrive.predictors]\nlucky = careful:Lucky\n",
        "Provides-Extra: lacks\nRequires-Dist: a-library-that-does-not-exist>=2 ; extra == 'lacks'\n",
    )
    distribution("another", "[interdrive.planners]\ntwice = careful:ordinary\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    yield tmp_path
    for module in ("careful", "breaks", "lacks"):  # no name of a module that other tests import
        sys.modules.pop(module, None)


def invoke(*arguments):
    return CliRunner().invoke(main, list(arguments))


def test_native_planners_come_first_and_each_has_one_line(installed):
    found = listed(NATIVE, "planner")
    assert [item.name for item in found[: len(NATIVE)]] == list(NATIVE)
    assert {item.source for item in found[: len(NATIVE)]} == {"built-in"}
    for item in found:
        assert item.text, item.name
        assert "\n" not in item.text


def test_what_is_installed_is_listed_with_its_source_and_what_is_wrong_with_it(installed):
    found = {(item.name, item.source): item for item in listed(NATIVE, "planner")}
    cautious = found["cautious", "careful 1.2"]
    assert (cautious.text, cautious.is_usable) == ("Drives slower than it could.", True)
    assert "pip install careful[lacks]" in found["lacks", "careful 1.2"].text
    assert "SystemExit: no licence" in found["breaks", "careful 1.2"].text
    assert "hidden by the built-in planner" in found["frenet", "careful 1.2"].text
    assert not any(found[name, "careful 1.2"].is_usable for name in ("lacks", "breaks", "frenet"))


def test_a_name_leads_to_its_object_and_only_that_is_imported(installed):
    assert find("cautious", tuple(NATIVE), "planner").__name__ == "Cautious"
    assert "lacks" not in sys.modules
    assert "breaks" not in sys.modules


@pytest.mark.parametrize(
    ("name", "kind", "words"),
    [
        ("cautios", InputError, "did you mean cautious?"),
        ("breaks", InputError, "planner breaks: its entry point cannot be loaded (SystemExit: no licence)"),
        ("lacks", MissingExtraError, "planner lacks needs the extra: pip install careful[lacks]"),
        (
            "twice",
            InputError,
            "offered by another 1.2 and careful 1.2: write it as careful:ordinary or",
        ),
    ],
)
def test_a_name_that_cannot_be_used_is_refused_in_one_line(installed, name, kind, words):
    with pytest.raises(kind) as refused:
        find(name, tuple(NATIVE), "planner")
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_planner_is_made_of_distributions_whose_versions_are_known(installed):
    assert versions("cautious", "planner") == {"careful": "1.2"}
    assert versions("lacks", "planner") == {"a-library-that-does-not-exist": "", "careful": "1.2"}
    assert versions("numpy:ndarray", "planner") == {"numpy": np.__version__}
    assert versions("frenet_of_none", "planner") == versions("no_such_module:Planner", "planner") == {}


def test_an_installed_planner_drives_with_its_settings(installed):
    scenario = world(straight_road(), problems=[problem(100, 20.0, goal=(60.0, 0.0), time_step=(0, 90))])
    run = simulate(scenario, planner="cautious,gap=3,share=0.98", threads=1)
    assert run.settings["planner"] == {"planner": "cautious", "gap": 3.0, "share": 0.98}
    assert run.states.velocity[0, 1] == pytest.approx(0.98 * run.states.velocity[0, 0])


def test_the_command_lists_planners_and_the_settings_of_one(installed):
    done = invoke("planners")
    assert done.exit_code == 0, done.output
    lines = {line.split()[0]: line for line in done.stdout.splitlines() if line[:1].strip()}
    assert {*NATIVE, "cautious", "lacks", "breaks"} <= lines.keys()
    assert "built-in" in lines["idm"]
    assert "careful 1.2" in lines["cautious"]
    done = invoke("planners", "cautious")
    assert "Drives slower than it could." in done.stdout
    rows = [line.split(maxsplit=1) for line in done.stdout.splitlines() if line.startswith(("gap", "share"))]
    assert [row[0] for row in rows] == ["gap", "share"]
    assert rows[0][1].strip() == "must be given  Distance to a leader [m]."
    assert rows[1][1].split(maxsplit=1)[0] == "0.99"
    assert "memory" not in done.stdout


def test_the_command_shows_native_records_functions_and_module_objects(installed):
    shown = invoke("planners", "frenet").stdout
    assert "Werling" in shown
    assert "weights.prediction" in shown
    assert "[m/s]" in shown
    assert "It has no settings." in invoke("planners", "careful:ordinary").stdout
    assert "share" in invoke("planners", "careful:Cautious").stdout


def test_predictors_have_the_same_command(installed):
    listing = invoke("predictors").stdout
    for name in ("constant_velocity", "lane_following", "ground_truth", "lucky"):
        assert f"\n{name} " in listing
    assert "position_sigma" in invoke("predictors", "lane_following").stdout
    assert "It has no settings." in invoke("predictors", "ground_truth").stdout


@pytest.mark.parametrize(
    ("command", "name"), [("planners", "frent"), ("predictors", "lane_folowing"), ("planners", "a:b")]
)
def test_a_wrong_name_is_one_line(command, name):
    done = invoke(command, name)
    assert (done.exit_code, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("given", ["mine", "mine.py", "./mine.py"])
def test_the_name_of_a_file_is_answered_with_the_class_in_it(given, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text("class Route: ...\nclass Pursuit:\n    def plan(self, view, predictions): ...\n")
    with pytest.raises(InputError, match=r"did you mean mine:Pursuit\?"):
        Simulation("t_junction", agents=1, planner=given)


def test_a_file_that_cannot_be_parsed_is_answered_with_the_form(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text("class (")
    with pytest.raises(InputError, match=r"write it as mine:CLASS"):
        Simulation("t_junction", agents=1, planner="mine")
