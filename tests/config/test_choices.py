"""A planner, settings and a view per agent: how they are spelled, what is stored, what is refused."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from click.testing import CliRunner
from drivers import Straight

from interdrive import ConstantVelocity, Frenet, InputError, Simulation, SimulationSettings, ViewSettings
from interdrive.cli import main
from interdrive.config.binding import bind
from interdrive.config.plugins import DEFAULT_PLANNER, Choice, read_choice
from interdrive.config.specs import read_planner
from interdrive.planners import PlannerSettings
from interdrive.results import read_results
from interdrive.testing import Car, problem, straight_road, world


@dataclass
class Steady(Straight):
    """Keeps a share of its speed.

    Attributes:
        share: Of the present speed.
        name: Not used.
    """

    share: float = 1.0
    name: str = ""
    calls: list[int] = field(default_factory=list, init=False)

    def plan(self, view, predictions):
        self.calls.append(view.time_step)
        plan = super().plan(view, predictions)
        return type(plan)(plan.x, plan.y, plan.orientation, plan.velocity * self.share)


if TYPE_CHECKING:
    from elsewhere import Memory


@dataclass
class Forgetful(Steady):
    """Has a field whose type is not known at run time."""

    memory: Memory | None = field(default=None, init=False)


@dataclass
class Demanding(Straight):
    """Needs to be told how fast [m/s]."""

    speed: float

    def __post_init__(self):
        if self.speed < 0:
            raise ValueError("only forwards")


def two_lanes():
    problems = [
        problem(100, 20.0, goal=(90.0, 0.0), time_step=(0, 90)),
        problem(200, 12.0, 3.5, velocity=12.0, goal=(110.0, 3.5), time_step=(0, 90)),
    ]
    return world(straight_road(300.0, lanes=2), cars=[Car(7, 60.0, velocity=6.0)], problems=problems)


def simulation(planner="frenet", **options):
    options = {"agents": [100, 200], "threads": 1} | options
    return Simulation(two_lanes(), planner=planner, **options)


def stored(planner="frenet", **options):
    """What run.json would say, through JSON."""
    return json.loads(json.dumps(simulation(planner, **options).record().settings))


@pytest.mark.parametrize(
    ("text", "chosen", "settings"),
    [
        ("frenet", "frenet", {}),
        ("frenet,level=1, lazy = false", "frenet", {"level": "1", "lazy": "false"}),
        ("a.b:C,levels=[1, 2],view.sensor_radius=40", "a.b:C", {"levels": "[1, 2]", "view.sensor_radius": "40"}),
        ("view.occlusion=true", None, {"view.occlusion": "true"}),
    ],
)
def test_a_choice_is_a_name_and_settings(text, chosen, settings):
    assert read_choice(text, "planner") == Choice(chosen, settings)


@pytest.mark.parametrize(
    ("text", "chosen"),
    [
        ("mine.py:Mine", "mine:Mine"),
        ("./mine.py:Mine,share=2", "mine:Mine"),
        ("planners/mine.py:Mine", "planners.mine:Mine"),
        ("mine:Mine", "mine:Mine"),
        ("idm", "idm"),
    ],
)
def test_a_file_below_the_working_folder_is_its_module(text, chosen):
    assert read_choice(text, "planner").chosen == chosen


def test_a_table_says_the_same_as_a_text():
    table = {"planner": "frenet", "level": 1, "weights": {"prediction": 0.5}, "view": {"sensor_radius": 40.0}}
    assert read_choice(table, "planner") == Choice(
        "frenet", {"level": 1, "weights.prediction": 0.5, "view.sensor_radius": 40.0}
    )


@pytest.mark.parametrize("text", ["", ",level=1", "frenet,level", "frenet,", "frenet,=1", "frenet,level=1,level=2"])
def test_a_malformed_choice_is_refused_in_one_line(text):
    with pytest.raises(InputError) as refused:
        read_choice(text, "planner")
    assert str(refused.value).startswith(f"planner {text!r}: ")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "given",
    [
        Frenet(level=1),
        "frenet,level=1",
        {"planner": "frenet", "level": 1},
        {"planner": Frenet(level=1)},
        {"planner": Frenet(), "level": "1"},
        read_planner("frenet,level=1", PlannerSettings()),
    ],
)
def test_every_spelling_drives_and_stores_the_same(given):
    reference = stored({100: Frenet(level=1), "default": "frenet,level=0"})
    assert stored({100: given, "default": "frenet,level=0"}) == reference
    assert reference["planner"] == {
        "100": {"planner": "frenet", "level": 1},
        "200": {"planner": "frenet", "level": 0},
    }
    assert reference["repeatable"]


def test_settings_of_a_choice_are_stored_with_it_and_a_view_for_all_where_set_puts_it():
    run = stored("frenet,level=1,view.sensor_radius=50", predictor="constant_velocity,position_sigma=0.3")
    assert run["planner"] == {"planner": "frenet", "level": 1}
    assert run["predictor"] == {"predictor": "constant_velocity", "position_sigma": 0.3}
    assert run["settings"]["planner.frenet.level"] == Frenet().level
    assert (run["settings"]["view.sensor_radius"], run["views"]) == (50.0, {})
    given = stored(Frenet(level=1), predictor=ConstantVelocity(position_sigma=0.3))
    assert given["settings"] == run["settings"] | {"view.sensor_radius": 80.0}
    assert [given[what] for what in ("planner", "predictor")] == [run[what] for what in ("planner", "predictor")]


def test_what_set_says_holds_for_planners_that_are_named_but_not_for_records():
    settings = bind(SimulationSettings(), {"planner.frenet.level": 1})
    assert stored({100: "frenet", 200: Frenet()}, settings=settings)["planner"] == {
        "100": "frenet",
        "200": {"planner": "frenet", "level": Frenet().level},
    }


def test_what_an_agent_is_not_told_is_as_in_the_settings_of_the_run():
    settings = bind(SimulationSettings(), {"planner.rollout.horizon": 2.0, "view.sensor_radius": 60.0})
    made = simulation({100: "rollout,margin_width=0.2,view.sensor_radius=40"}, settings=settings)
    run = made.record().settings
    assert run["planner"] == {"100": {"planner": "rollout", "margin_width": 0.2}, "200": DEFAULT_PLANNER}
    assert list(run["views"]) == ["100"]
    assert run["views"]["100"]["sensor_radius"] == 40.0
    made.step()
    horizons = {len(row[row == row]) for row in made.record().plans.x}
    assert horizons == {21}


def test_a_choice_without_a_name_is_the_default_with_its_own_settings():
    run = stored({"default": "frenet,level=1", 200: "lazy=false"})
    assert run["planner"]["200"] == {"planner": "frenet", "level": 1, "lazy": False}


def test_the_default_is_only_for_agents_that_are_not_named():
    run = stored({"default": "frenet,view.sensor_radius=30", 200: "frenet"})
    assert run["planner"] == "frenet"
    assert list(run["views"]) == ["100"]


def test_views_may_be_given_as_settings_or_as_their_fields():
    given = stored(views={100: ViewSettings(sensor_radius=40.0), "default": {"sensor_radius": "50"}})
    assert {agent: view["sensor_radius"] for agent, view in given["views"].items()} == {"100": 40.0, "200": 50.0}


def test_each_agent_sees_as_far_as_it_is_told():
    seen = {}

    class Looking(Straight):
        def plan(self, view, predictions):
            seen.setdefault(view.ego.id, view.ids.tolist())
            return super().plan(view, predictions)

    simulation(Looking, views={100: ViewSettings(sensor_radius=20.0)}).step()
    assert seen == {100: [200], 200: [7, 100]}


def test_a_plug_in_that_is_a_dataclass_takes_settings():
    run = simulation({100: "drivers:Straight", 200: "test_choices:Steady,share=0.98"}).run()
    assert run.settings["planner"]["200"] == {"planner": "test_choices:Steady", "share": 0.98}
    assert run.outcomes.planner == ("drivers:Straight", "test_choices:Steady")
    row = run.states.participant_id.tolist().index(200)
    assert run.states.velocity[row, 1] == pytest.approx(0.98 * 12.0)


def test_an_object_of_a_plug_in_is_stored_by_its_settings_but_not_by_what_it_remembers():
    given = Steady(share=0.9)
    given.calls.append(5)
    run = stored({100: given, "default": "frenet"})
    assert run["planner"]["100"] == {"planner": "test_choices:Steady", "share": 0.9, "name": ""}
    assert run["repeatable"]


def test_only_the_types_of_given_settings_must_be_known():
    assert stored("test_choices:Forgetful,share=0.9")["planner"] == {"planner": "test_choices:Forgetful", "share": 0.9}


def test_an_object_for_all_is_copied_once_per_agent_and_once_to_check_it():
    class Counted(Straight):
        copies = 0

        def __deepcopy__(self, memory):
            Counted.copies += 1
            return Counted()

    simulation(Counted())
    assert Counted.copies == 3


def test_the_examples_of_the_documentation_run(tmp_path, monkeypatch):
    text = (Path(__file__).parents[2] / "docs" / "how_to" / "planner_per_agent.md").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    configuration, *_ = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    (tmp_path / "run.toml").write_text(configuration)
    done = CliRunner().invoke(main, ["run", "--config", "run.toml", "--out", "made"])
    assert done.exit_code == 0, done.output
    made = read_results("made").info["settings"]
    assert made["planner"]["1001"] == {"planner": "idm", "time_gap": 2.0}
    assert made["planner"]["1002"] == {"planner": "rollout", "weights.offset": 1.0}
    ((agent, view),) = made["views"].items()
    assert (agent, view["sensor_radius"], view["occlusion"]) == ("1001", 40.0, True)
    assert made["settings"]["planner.rollout.horizon"] == 4.0
    for example in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        exec(compile(example, "docs", "exec", dont_inherit=True), {"__name__": "example"})


def test_a_setting_without_a_default_may_be_given():
    assert stored("test_choices:Demanding,speed=3")["planner"] == {"planner": "test_choices:Demanding", "speed": 3.0}
    with pytest.raises(InputError, match="speed: this setting has no default and must be given"):
        simulation("test_choices:Demanding")


def test_what_has_no_name_cannot_be_repeated():
    class Local(Straight):
        pass

    assert stored(Straight)["repeatable"]
    assert not stored(Straight())["repeatable"]
    assert not stored(Local)["repeatable"]
    assert not stored({100: lambda: Local()})["repeatable"]  # noqa: PLW0108


def test_what_is_stored_makes_the_same_run():
    planner = {100: Frenet(level=1), 200: "test_choices:Steady,share=0.99,view.sensor_radius=30"}
    first = simulation(planner, views={100: ViewSettings(sensor_radius=25.0)}).run()
    settings = json.loads(json.dumps(first.settings))
    again = simulation(
        settings["planner"],
        predictor=settings["predictor"],
        views=settings["views"],
        settings=bind(SimulationSettings(), {k: str(v) for k, v in settings["settings"].items()}),
    ).run()
    assert again.digest == first.digest
    assert again.settings == first.settings


def test_a_planning_problem_may_be_named_by_its_own_id():
    scenario = world(
        straight_road(300.0, lanes=2),
        cars=[Car(7, 20.0, velocity=6.0), Car(9, 60.0, 3.5, velocity=6.0)],
        problems=[problem(100, 20.0, velocity=6.0, goal=(90.0, 0.0), time_step=(0, 90))],
    )
    made = Simulation(scenario, agents=[100, 9], planner={100: "drivers:Straight"}, threads=1)
    assert made.record().settings["planner"] == {"7": "drivers:Straight", "9": DEFAULT_PLANNER}
    with pytest.raises(InputError, match="agent 7: a planner is given for it twice"):
        Simulation(scenario, agents=[100, 9], planner={100: "frenet", 7: "frenet"}, threads=1)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            {"planner": {7: "frenet"}},
            "agent 7: a planner is given for it, but it is not an agent (agents are 100, 200); add it to --agents",
        ),
        ({"views": {55: ViewSettings()}}, "agent 55: a view is given for it, but it is not an agent"),
        (
            {"planner": {100: "frenet,horizn=2"}},
            "agent 100: planner frenet: horizn: no such setting; did you mean",
        ),
        ({"planner": {100: "frenet,horizon=long"}}, "planner frenet: horizon: expected a number [s], not 'long'"),
        ({"planner": {100: "frenet,level=9"}}, "agent 100: planner frenet: level: must be 0 to 4"),
        ({"planner": {100: "frent"}}, "agent 100: unknown planner 'frent': did you mean frenet?"),
        ({"planner": {100: "frenet,view.sensr_radius=2"}}, "agent 100: view.sensr_radius: no such setting"),
        (
            {"planner": {100: "frenet,view.sensor_radius=-2"}},
            "agent 100: view.sensor_radius: must be positive, not -2.0",
        ),
        (
            {"planner": {100: "drivers:Straight,gain=2"}},
            "agent 100: planner drivers:Straight: gain: this object has no settings",
        ),
        ({"planner": "test_choices:Steady,shar=2"}, "shar: no such setting; did you mean share?"),
        ({"planner": "test_choices:Steady,calls=[2]"}, "calls: no such setting"),
        (
            {"planner": {100: "test_choices:Demanding,speed=-3"}},
            "agent 100: planner test_choices:Demanding: cannot be made (ValueError: only forwards)",
        ),
        ({"planner": {100: 3}}, "agent 100: 3 is not a planner"),
        ({"planner": {3.5: "frenet"}}, "a planner is given for 3.5, which is not an agent id"),
        ({"views": {100: 40.0}}, "agent 100: a view must be ViewSettings or a mapping of its fields, not 40.0"),
        ({"views": 40.0}, "a view per agent must be a mapping from agent ids, not 40.0"),
        (
            {"predictor": "constant_velocity,position_sigm=1"},
            "predictor constant_velocity: position_sigm: no such setting",
        ),
    ],
)
def test_an_impossible_choice_is_refused_in_one_line(options, words):
    with pytest.raises(InputError) as refused:
        simulation(**options)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)
