"""A run shows itself, gives its tables, figures and page, and goes to other tools."""

import gc
import pickle
import re
import weakref
import webbrowser
from dataclasses import replace

import pytest

import interdrive as idr
from interdrive.results import read_results
from interdrive.run import States
from interdrive.runs import RunInterrupted, reopen


@pytest.fixture(scope="module")
def run():
    return idr.simulate("t_junction", agents=2, threads=1)


def test_every_object_that_a_user_meets_is_one_line(run, tmp_path):
    seen = []

    class Looks:
        def plan(self, view, predictions):
            ego = view.ego
            seen.extend(map(repr, [view, ego, ego.route, ego.goal, ego.vehicle, predictions]))
            raise RuntimeError("enough")

    simulation = idr.Simulation("t_junction", agents=1, planner=Looks)
    simulation.run()
    folder = run.save(tmp_path / "run")
    shown = [
        repr(run), repr(run.scenario), repr(run.scenario.obstacles), repr(run.criticality()), repr(simulation),
        repr(read_results(folder)), repr(run.agents[0]), repr(run.scenario.planning_problems[0]), *seen,
        *(repr(getattr(run, part)) for part in ("outcomes", "states", "plans", "timings", "violations")),
    ]  # fmt: skip
    assert len(shown) == 19
    assert [line for line in shown if len(line) > 160 or "\n" in line or " object at " in line] == []
    assert re.fullmatch(r"<Run of t_junction: (\d \w+(, )?)+; \d+\.\d s>", repr(run))


def test_a_notebook_shows_the_outcomes_of_a_run_and_escapes_them(run):
    page = run._repr_html_()
    assert page.count("<tr>") == 1 + len(run.agents)
    assert "&lt;Run of t_junction" in page
    assert f"<td>{run.agents[0].id}</td>" in page


def test_notebooks_show_the_parts_of_a_run_as_tables(run):
    page = run.outcomes._repr_html_()
    assert page.startswith("<p>&lt;Outcomes: ")
    assert page.count("<tr>") == 1 + len(run.agents)
    assert "<th>outcome</th>" in page
    assert "<th>traceback</th>" not in page, "columns without any value are left out"
    assert f"<p>{run.states.to_arrow().num_rows - 20} more rows</p>" in run.states._repr_html_()
    assert type(run.outcomes).empty()._repr_html_() is None, "without a run there is no table"


def test_notebooks_show_scores_with_reasons_and_criticality_with_units(run):
    scored = idr.score(run, panel=None)
    page = scored._repr_html_()
    assert page.count("<tr>") == 1 + len(run.agents)
    row = scored.row(run.agents[0].id)
    assert f"<td>{100 * scored.score[row]:.4g}</td>" in page
    measured = run.criticality()
    page = measured._repr_html_()
    assert page.count("<tr>") == 1 + len(run.agents)
    assert "<th>ttc [s]</th>" in page
    assert f"<td>{measured.extremes['dce'].value[0]:.4g}</td>" in page


def test_a_notebook_shows_the_measures_of_an_evaluation():
    found = idr.evaluate_predictors("lane_merge", "constant_velocity", every=100)
    assert found._repr_html_().startswith("<p>&lt;PredictionEvaluation of constant_velocity on 1 files&gt;</p><table>")
    row = next(row for row in found.table.to_pylist() if row["category"] == "all samples")
    assert f"<td>{row['fde_3']:.4g}</td>" in found._repr_html_()


def test_a_notebook_shows_the_table_of_a_case_study():
    study = idr.case_study("lane_merge", agent=2001, other=1004, settings={"step.max_steps": 3})
    assert repr(study) == "<CaseStudy of lane_merge: agent 2001, other 1004, planner rollout>"
    assert study._repr_html_().count("<tr>") == 1 + 3


def test_parts_of_a_run_are_the_tables_of_its_folder(run, tmp_path):
    stored = read_results(run.save(tmp_path / "run"))
    for name in ("outcomes", "states", "plans"):
        assert getattr(run, name).to_arrow().equals(getattr(stored, name)), name
    frame = run.states.to_pandas()
    assert len(frame) == run.states.valid.sum()
    assert run.outcomes.to_polars()["outcome"].to_list() == list(run.outcomes.outcome)
    assert idr.load(tmp_path / "run").states.to_pandas().equals(frame)


def test_a_run_that_was_sent_to_another_process_still_has_its_tables(run):
    sent = pickle.loads(pickle.dumps(run))
    assert sent.outcomes.to_arrow().equals(run.outcomes.to_arrow())


def test_a_run_is_freed_with_its_last_reference(run):
    single = replace(run, notes=("another",))
    assert run.states.to_arrow().num_rows == single.states.to_arrow().num_rows
    gone = weakref.ref(single)
    gc.disable()
    try:
        del single
        assert gone() is None
    finally:
        gc.enable()


def test_an_interrupted_run_can_be_sent_reopened_and_says_so(run, tmp_path):
    stopped = pickle.loads(pickle.dumps(RunInterrupted(replace(run, finished=False)))).run
    folder = stopped.save(tmp_path / "run")
    assert [one.finished for one in (stopped, idr.load(folder), reopen(folder))] == [False] * 3
    assert repr(reopen(folder)).endswith(" s, interrupted>")


def test_arrays_without_a_run_say_that_they_have_no_table(run):
    with pytest.raises(TypeError, match="States that belong to no run have no table"):
        States(**{name: value for name, value in vars(run.states).items() if name != "_as_table"}).to_arrow()


@pytest.mark.parametrize("kind", ["run", "trajectories", "velocity", "criticality", "scene@3.5"])
def test_a_run_draws_every_kind_of_figure(run, kind):
    figure = run.plot(kind)
    assert figure.axes
    assert any(axes.has_data() for axes in figure.axes)


def test_a_figure_that_does_not_exist_is_refused_with_those_that_do(run):
    with pytest.raises(
        idr.InputError, match="the kinds are run, trajectories, velocity, criticality, messages, scene@SECONDS"
    ):
        run.plot("speed")


@pytest.mark.parametrize(("wrong", "words"), [({"columns": 3}, "columns must be 1"), ({"agents": [7]}, "agent 7 ")])
def test_an_impossible_figure_is_one_line(run, wrong, words):
    with pytest.raises(idr.InputError, match=words):
        run.plot("run", **wrong)


def test_the_page_of_a_run_opens_in_the_browser_and_inline_in_a_notebook(run, monkeypatch):
    opened = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    page = run.show()
    assert opened == [page.path.as_uri()]
    assert page.path.read_text(encoding="utf-8").startswith("<!doctype html>")
    assert page._repr_html_().startswith('<iframe srcdoc="&lt;!doctype html')


@pytest.mark.parametrize(
    ("cells", "shown"),
    [
        (("run.show()",), 1),
        (("page = run.show()",), 1),
        (("run.show()", "1 + 1"), 1),
        (("page = run.show()", "page"), 2),
        (("run.show(); None",), 1),
        (("page = run.show()\npage",), 1),
    ],
)
def test_a_notebook_shows_the_page_once_in_a_cell(run, cells, shown):
    interactive = pytest.importorskip("IPython.core.interactiveshell")
    capture = pytest.importorskip("IPython.utils.capture")
    shell = interactive.InteractiveShell.instance(user_ns={"run": run})
    shell.kernel = None  # a terminal has none
    values = []  # what the notebook shows because it is the value of a cell
    shell.displayhook.write_format_data = lambda data, *_: values.append(data)
    pages = 0
    try:
        shell.push({"run": run})
        for cell in cells:
            with capture.capture_output() as captured:
                shell.run_cell(cell, store_history=True).raise_error()
            pages += sum("text/html" in output.data for output in captured.outputs)
        pages += sum("text/html" in data for data in values)
    finally:
        interactive.InteractiveShell.clear_instance()
    assert pages == shown


def test_a_film_is_written_where_it_is_wanted(run, tmp_path):
    assert run.animation(tmp_path / "run.gif", fps=2.0).read_bytes().startswith(b"GIF8")


def test_a_run_becomes_objects_of_commonroad_io(run, capsys):
    scenario, problems = run.to_commonroad()
    assert {obstacle.obstacle_id for obstacle in scenario.dynamic_obstacles} >= {agent.id for agent in run.agents}
    assert len(problems.planning_problem_dict) == len(run.scenario.planning_problems)
    again = idr.scenario_from_commonroad(scenario, problems)
    assert again.lanelets.ids.tolist() == run.scenario.lanelets.ids.tolist()
    one = next(iter(problems.planning_problem_dict.values()))
    alone = idr.simulate((scenario, one), agents=1, settings={"step.max_steps": 1}, threads=1)
    assert [problem.id for problem in alone.scenario.planning_problems] == [one.planning_problem_id]
    with pytest.raises(idr.InputError, match="str is neither a PlanningProblemSet nor a PlanningProblem"):
        idr.scenario_from_commonroad(scenario, "problem")
    assert capsys.readouterr().out == ""


def test_criticality_is_judged_for_a_name_and_for_a_loaded_run(run, tmp_path):
    assert len(idr.criticality.evaluate("t_junction").participant_id) == 7
    loaded = idr.load(run.save(tmp_path / "run"))
    assert idr.criticality.evaluate(loaded).participant_id.tolist() == [agent.id for agent in run.agents]
