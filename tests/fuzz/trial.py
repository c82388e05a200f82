"""What is done with one file: check, a run of 20 steps, save, read again, criticality, report; and what must hold."""

from __future__ import annotations

import contextlib
import io
import json
import re
import traceback
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import interdrive as idr
from interdrive.cli import main
from interdrive.files.scenario_file import losses
from interdrive.scenario.native import core_road, core_scenario

if TYPE_CHECKING:
    from collections.abc import Callable
    from random import Random

N_STEPS = 20
ACCEPTED, REFUSED, FAILED = "accepted", "refused", "failed"
#: Weighted: the default planner and predictor are used most. Some need a recording, which no planning problem has.
_PLANNERS = ("rollout", "rollout", "rollout", "frenet", "idm", "idm_mobil")
_WITH_RECORDING = (*_PLANNERS, "recorded", "velocity_adjusting")
_PREDICTORS = ("neural", "neural", "lane_following", "constant_velocity", "ground_truth")

#: A refusal names one of these, an element in angle brackets, or a field of a message (`planning_problems[0].goal`).
_AN_ELEMENT = re.compile(
    r"<\w+>|\w+\[\d+\]\.\w+|the encoding|byte \d+ at line \d+|"
    r"\w+ -?\d+ has |lanelet|obstacle|planning ?problem|traffic ?(light|sign)|intersection|location|map|"
    r"agent|vehicle|participant|time step size|root element|document type|CommonRoad version|XML|protobuf|"
    r"cannot be read|the file|file is empty",
    re.IGNORECASE,
)
_OF_WRONG_CODE = (AssertionError, AttributeError, LookupError, NameError, TypeError, ZeroDivisionError)


class Broken(Exception):  # noqa: N818 - not an error of a program but a verdict
    """Something that must hold does not; the text says what."""


def tried(path: Path, folder: Path, random: Random, on_stage: Callable[[str], None]) -> tuple[str, str]:
    """Does everything with a file, in this process.

    Args:
        path: The file.
        folder: An empty folder for what is written.
        random: Chooses planner, predictor and what is done rarely.
        on_stage: Told what begins.

    Returns:
        The verdict; the line of the refusal, or the traceback of the failure.
    """
    try:
        return _tried(path, folder, random, on_stage)
    except BaseException:  # noqa: BLE001 - panics of the core are none of Exception, and interrupts come from nowhere
        return FAILED, traceback.format_exc()


def _tried(path: Path, folder: Path, random: Random, on_stage: Callable[[str], None]) -> tuple[str, str]:
    on_stage("check")
    refusal = _command("check", path)
    on_stage("read")
    try:
        scenario = idr.read_scenario(path)
    except idr.InterdriveError as error:
        if not refusal:
            raise Broken(f"check accepts what read_scenario refuses: {error}") from error
        _judge_line(f"error: {error}", path)
        _judge_cause(error)
        return REFUSED, refusal
    on_stage("run")
    planner = random.choice(_PLANNERS if scenario.planning_problems else _WITH_RECORDING)
    predictor = random.choice(_PREDICTORS)
    try:
        simulation = idr.Simulation(scenario, agents="all", planner=planner, predictor=predictor, threads=1)
    except idr.InterdriveError as error:
        if not refusal:
            raise Broken(f"check accepts what a simulation refuses: {error}") from error
        _judge_line(f"error: {error}", path)
        return REFUSED, refusal
    if refusal:
        raise Broken(f"check refuses what a simulation accepts: {refusal}")
    target = folder / "run"
    if random.random() < 0.3:
        on_stage("run by command")
        settings = ("--set", f"step.max_steps={N_STEPS}", "--threads", "1", "--quiet")
        line = _command("run", path, "--planner", planner, "--predictor", predictor, *settings, "--out", target)
        if line and "max_steps" not in line and "can become an agent" not in line:
            raise Broken(f"check accepts what run refuses: {line}")
        if line:
            return ACCEPTED, ""
        there = len(idr.load(target).states.participant_id)
    else:
        for _ in range(N_STEPS):
            if simulation.is_done:
                break
            simulation.step()
        run = simulation.record()
        there = int(run.states.valid.any(axis=1).sum())
        on_stage("save")
        idr.save(run, target)
    on_stage("read again")
    try:
        again = idr.read_scenario(target / "scenario.xml")
        core_scenario(again, core_road(again, replace(simulation.settings.road, open_end_length=0.0)))
    except idr.InterdriveError as error:
        raise Broken(f"accepted and saved, but refused when read again: {error}") from error
    found = len(again.obstacles.ids)
    if there != found:
        raise Broken(f"{there} participants were there, {found} are in the saved scenario")
    on_stage("criticality")
    _must("criticality", target, "--threads", "1", "--quiet")
    if random.random() < 0.2:
        on_stage("criticality of the recording")
        _must("criticality", path, "--threads", "1", "--quiet", "--out", folder / "recorded")
    on_stage("report")
    _must("report", target, "--quiet")
    _judge_page((target / "report.html").read_text(encoding="utf-8"))
    if random.random() < 0.05:
        on_stage("plot")
        _must("plot", target, "--kind", "velocity", "--out", folder / "velocity.png")
    return ACCEPTED, ""


def tried_source(
    path: Path, folder: Path, random: Random, options: dict[str, str], on_stage: Callable[[str], None]
) -> tuple[str, str]:
    """Converts a source of another tool, in this process; a file that was converted is read as the same scenario.

    Args:
        path: The file or folder.
        folder: An empty folder for what is written.
        random: Chooses whether it is also run.
        options: How it is read.
        on_stage: Told what begins.

    Returns:
        As `tried`.
    """
    try:
        return _tried_source(path, folder, random, options, on_stage)
    except BaseException:  # noqa: BLE001 - as above
        return FAILED, traceback.format_exc()


def _tried_source(
    path: Path, folder: Path, random: Random, options: dict[str, str], on_stage: Callable[[str], None]
) -> tuple[str, str]:
    on_stage("convert")
    target = folder / "new.xml"
    given = (f"--{name}={value}" for name, value in options.items())
    refusal = _command("convert", path, "--out", target, *given, judge=_judge_source_line)
    if refusal:
        if list(folder.iterdir()):
            raise Broken(f"refused, but written: {refusal}")
        return REFUSED, refusal
    on_stage("read again")
    scenario = idr.read_source(path, raw=True, **options)
    lost = losses(scenario, target.read_bytes())
    if lost:
        raise Broken(f"the converted file is another scenario: {lost[0]}")
    if random.random() < 0.1:
        on_stage("run")
        settings = ("--set", "step.max_steps=5", "--threads", "1", "--quiet", "--planner", "idm")
        predicted = ("--predictor", "constant_velocity")
        _command("run", target, *settings, *predicted, "--out", folder / "run")
    return ACCEPTED, ""


def _must(*arguments: object) -> None:
    line = _command(*arguments)
    if line:
        raise Broken(f"{arguments[0]} refuses a run that was saved: {line}")


def _command(*arguments: object, judge: Callable[[str, object], None] | None = None) -> str:
    """Runs a command of the command line; its line on stderr if it refuses, "" if all is right."""
    out, err = io.StringIO(), io.StringIO()
    code: object = None
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main.main([str(argument) for argument in arguments], prog_name="interdrive")
        except SystemExit as stop:
            code = stop.code
    said = err.getvalue()
    if any(character < " " and character not in "\n\t" for character in out.getvalue() + said):
        raise Broken(f"{arguments[0]} prints control characters: {said[-2000:]!r}")
    if code in (0, None, 1):
        return ""
    if code != 2:
        raise Broken(f"{arguments[0]} ends with exit code {code}: {said}")
    (judge or _judge_line)(said, arguments[1])
    return said.strip()


def _judge_line(said: str, path: object) -> None:
    """A refusal is one line of readable length that names the file."""
    line = said.removesuffix("\n")
    name = str(path).rpartition("/")[2]
    if not line.startswith("error: ") or "\n" in line or len(line) > 1000:
        raise Broken(f"a refusal is not one line: {said[:2000]!r}")
    if not _AN_ELEMENT.search(line.partition(name)[2] or line):
        raise Broken(f"a refusal does not name what is wrong: {line}")
    if name not in line and name.partition(".")[0].partition("_T-1")[0] not in line:
        raise Broken(f"a refusal does not name {name}: {line}")


def _judge_source_line(said: str, path: object) -> None:
    """A refusal of a source is one line of readable length that names the file, or one beside it, and what is wrong."""
    line, given = said.removesuffix("\n"), Path(str(path))
    named = {given.name, *(one.name for one in (given if given.is_dir() else given.parent).iterdir()), ".csv", ".osm"}
    if not line.startswith("error: ") or "\n" in line or len(line) > 1000:
        raise Broken(f"a refusal is not one line: {said[:2000]!r}")
    causes = [line.partition(name)[2] for name in named if name in line]
    if not causes or max(map(len, causes)) < len(": broken"):
        raise Broken(f"a refusal does not name file and cause: {line}")


def _judge_page(page: str) -> None:
    """What the page of a report reads is JSON, which knows no NaN."""
    header = page.partition('id="header">')[2].partition("</script>")[0]

    def refuse(word: str) -> None:
        raise Broken(f"the page of the report holds {word}, which is not JSON")

    if not json.loads(header, parse_constant=refuse):
        raise Broken("the page of the report holds nothing")


def _judge_cause(error: BaseException) -> None:
    """Reading takes any exception for damage; in interdrive's own code those of wrong code are bugs."""
    cause = error.__cause__
    if not isinstance(cause, _OF_WRONG_CODE) or f"({type(cause).__name__}:" not in str(error):
        return
    owners = [frame.filename.rpartition("site-packages/")[2] for frame in traceback.extract_tb(cause.__traceback__)]
    known = [name for name in owners if name.startswith("commonroad/") or "/interdrive/" in name]
    if known and not known[-1].startswith("commonroad/"):
        raise Broken(f"interdrive's own code fails: {error}") from cause
