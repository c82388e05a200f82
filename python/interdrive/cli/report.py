"""Output of the commands: tables, counts, notes, progress. Loads rich."""

from __future__ import annotations

from collections import Counter
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.cells import cell_len
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeRemainingColumn
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from interdrive.cli.terminal import visible
from interdrive.criticality import MEASURES, agent_harm, measure_named
from interdrive.run import OUTCOMES
from interdrive.run.goals import said_seconds, said_time
from interdrive.run.reasons import said_count

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from rich.console import ConsoleOptions, RenderableType

    from interdrive.array_types import Floats
    from interdrive.config.plugins import Listed
    from interdrive.criticality import Criticality, CriticalMoment
    from interdrive.runs import Run
    from interdrive.scenario.inspection import Inspection, Junction
    from interdrive.studies import CaseStudy
    from interdrive.studies.cooperation import CooperationStudy
    from interdrive.studies.runtime import RuntimeStudy

#: If there are more rows than this, only those of agents that did not reach their goal are shown.
_ROWS_MAX, NOTES_MAX = 40, 12
#: No more junctions than this are listed.
_JUNCTIONS_MAX = 12

STYLES = {
    "goal_reached": "green",
    "goal_reached_late": "yellow",
    "time_limit": "yellow",
    "goal_missed": "yellow",
    "infeasible": "red",
    "collision": "bold red",
    "planner_error": "bold red",
}


class _Output(Console):
    """Escapes characters that a terminal would interpret, and leaves a closed pipe to the command's exit code."""

    def render_str(self, text: str, **options: Any) -> Text:  # noqa: ANN401 - rich's signature
        """Every text passes here before it is laid out."""
        return super().render_str(visible(text), **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterator[Segment]:
        """Everything that is not plain text (progress bars) passes here."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else visible(text), style, control)

    def on_broken_pipe(self) -> None:
        raise BrokenPipeError


def output() -> Console:
    """The console to which commands print."""
    console = _Output(highlight=False)
    if not console.is_terminal:
        console.width = 120
    return console


def table_of(headings: Sequence[str], right: Sequence[str] = (), *, tight: bool = False, title: str = "") -> Table:
    """A table without lines.

    Args:
        headings: Of its columns.
        right: Headings of the columns that are flush right.
        tight: One space between columns instead of two.
        title: Above it.
    """
    padding = (0, 1, 0, 0) if tight else (0, 1)
    table = Table(box=None, header_style="bold", pad_edge=False, padding=padding)
    table.title, table.title_justify = escape(title) or None, "left"
    for heading in headings:
        table.add_column(escape(heading), justify="right" if heading in right else "left")
    return table


#: Words of headings that are longer go on in the next line, such as names of planners.
_HEADING_WORD = 16

#: Wider tables have their headings in several lines.
_WIDE = 110


def print_table(console: Console, table: Table, names: int) -> None:
    """Prints a table in which nothing is cut: what is too wide follows below, beside the names of its rows again.

    Columns in which every cell is empty are left out. Headings stand in one line if there is room for all of them.

    Args:
        console: Where.
        table: Its cells are markup; texts may break between words, numbers never do.
        names: So many columns at the left name the rows; long names go on in the next line.
    """
    gap = table.padding[1] + table.padding[3]
    texts = [[Text.from_markup(str(cell)).plain for cell in column.cells] for column in table.columns]
    filled = [not column or any(text.strip() for text in column) for column in texts]
    left_names = [k for k in range(names) if filled[k]] or [0]
    others = [k for k in range(names, len(texts)) if filled[k]]
    widths, headings = [], []
    for column, said in zip(table.columns, texts, strict=True):
        whole = said if column.justify == "right" else [word for text in said for word in text.split()]
        heading = Text.from_markup(str(column.header)).plain
        headings.append(min(cell_len(heading), 2 * _HEADING_WORD))
        widths.append(
            max([1, *(min(_HEADING_WORD, cell_len(word)) for word in heading.split()), *map(cell_len, whole)])
        )
        column.overflow, column.no_wrap = "fold", False
    for k in left_names:
        longest = max([widths[k], headings[k], *map(cell_len, texts[k])])
        widths[k] = min(longest, max(8, console.width // (2 * names)))
    in_one_line = [max(pair) for pair in zip(widths, headings, strict=True)]
    if sum(in_one_line[k] + gap for k in (*left_names, *others)) - gap <= min(console.width, _WIDE):
        widths = in_one_line
    left = sum(widths[k] + gap for k in left_names)
    # A text without spaces may be wider than the terminal: it alone breaks anywhere.
    for k in others:
        if table.columns[k].justify != "right":
            widths[k] = min(widths[k], max(8, console.width - left))
    blocks: list[list[int]] = [[]]
    for k in others:
        if blocks[-1] and left + sum(widths[i] + gap for i in (*blocks[-1], k)) - gap > console.width:
            blocks.append([])
        blocks[-1].append(k)
    for block in blocks:
        part = Table(box=None, header_style="bold", pad_edge=False, padding=table.padding)
        if block is blocks[0]:
            part.title, part.title_justify = table.title, table.title_justify
        chosen = [*left_names, *block]
        for k in chosen:
            column = table.columns[k]
            part.add_column(
                column.header,
                justify=column.justify,
                style=column.style,
                overflow="fold",
                min_width=widths[k],
                max_width=widths[k] if k < names or column.justify == "right" else None,
            )
        for cells, row in zip(zip(*(table.columns[k].cells for k in chosen), strict=True), table.rows, strict=True):
            part.add_row(*cells, style=row.style)
        console.print(part)


def errors() -> Console:
    """The console on which commands show progress."""
    return _Output(stderr=True)


class Report:
    """Progress of a command, on stderr; shown only if stderr is a terminal."""

    def __init__(self, bar: Progress) -> None:
        """Starts without a known total."""
        self._bar = bar
        self._task = bar.add_task("", total=None)

    def say(self, text: str) -> None:
        """Shows work that cannot be counted."""
        # A task that was counted once cannot go back to not being counted.
        self._bar.remove_task(self._task)
        self._task = self._bar.add_task(escape(text), total=None)

    def step(self, time_step: int, driving: int, agents: int, last: int) -> None:
        """Shows that a time step was simulated; `last` is the latest possible one."""
        text = f"step {time_step}" + (f", {driving} of {agents} agents drive" if agents else "")
        self._bar.update(self._task, description=text, completed=time_step, total=max(last, time_step))

    def counted(self, text: str, done: int, total: int) -> None:
        """Shows the number of finished items."""
        self._bar.update(self._task, description=escape(text), completed=done, total=total)

    def setup(self, text: str, done: int, total: int) -> None:
        """Shows what is prepared, counted if the total is known."""
        if total:
            self.counted(text, done, total)
        else:
            self.say(text)

    def frames(self, name: str) -> Callable[[int, int], None]:
        """A counter for the frames of a film."""
        return lambda done, total: self._bar.update(
            self._task, description=f"drawing {name}", completed=done, total=total
        )


@contextmanager
def progress(*, quiet: bool) -> Iterator[Report]:
    """A progress bar that disappears at the end."""
    console = errors()
    columns = SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn(compact=True)
    with Progress(*columns, console=console, transient=True, disable=quiet or not console.is_terminal) as bar:
        yield Report(bar)


def print_run(run: Run, folder: Path, harms: Floats | None = None) -> None:
    """Prints the outcome table, counts, notes, speed, and the path of the results.

    Args:
        run: The run.
        folder: Where it is.
        harms: Harm of each agent; None: from its states.
    """
    console = output()
    ended = run.outcomes
    shown = list(range(len(ended.agent_id)))
    if len(shown) > _ROWS_MAX:
        shown = [row for row in shown if ended.outcome[row] != "goal_reached"][:_ROWS_MAX]
    if shown:
        print_table(console, _outcome_table(run, shown, agent_harm(run).harm if harms is None else harms), 1)
    hidden = len(ended.agent_id) - len(shown)
    if hidden:
        console.print(f"{hidden} more in outcomes.parquet", style="dim")
    counts = Counter(ended.outcome)
    parts = [f"[{STYLES.get(name, '')}]{counts[name]} {name}[/]" for name in (*OUTCOMES, "running") if counts[name]]
    agents = said_count(len(ended.agent_id), "agent") + ": " if parts else "no agents"
    console.print(f"{escape(run.scenario.name)}, {agents}" + ", ".join(parts))
    print_notes(console, run.notes, "run.json")
    console.print(_speed(run))
    print_folder(console, folder)


def _outcome_table(run: Run, rows: Sequence[int], harms: Floats) -> Table:
    ended = run.outcomes
    several = len(set(ended.planner)) > 1
    table = table_of(
        (
            "agent",
            "outcome",
            "time [s]",
            "with",
            "impact [m/s]",
            "harm",
            "off lanelets [m]",
            "reason",
            *["planner"] * several,
        ),
        right=("agent", "time [s]", "impact [m/s]", "harm", "off lanelets [m]"),
    )
    for row in rows:
        partner = (
            "road edge" if ended.off_road[row] else str(ended.partner_id[row]) if ended.partner_id[row] >= 0 else ""
        )
        impact = f"{ended.impact_speed[row]:.1f}" if np.isfinite(ended.impact_speed[row]) else ""
        cells = [
            str(ended.agent_id[row]),
            f"[{STYLES.get(ended.outcome[row], '')}]{ended.outcome[row]}[/]",
            said_time(run, int(ended.time_step[row])),
            partner,
            impact,
            f"{harms[row]:.3f}" if np.isfinite(harms[row]) else "",
            f"{ended.off_lanelets[row]:.2f}" if ended.off_lanelets[row] > 0.0 else "",
            escape(ended.reason[row]),
        ]
        table.add_row(*cells, *([escape(ended.planner[row])] if several else []))
    return table


def print_page(path: Path, size: int) -> None:
    """Prints the path and size of a page."""
    output().print(f"{escape(str(path))} ({size / 1e6:.1f} MB); open it in a browser", soft_wrap=True)


def print_differences(one: str, other: str) -> None:
    """Prints which settings of the runs in two folders differ."""
    from interdrive.report.differences import differing_settings  # noqa: PLC0415 - loaded when asked for
    from interdrive.results.information import read_information  # noqa: PLC0415

    console = output()
    differ = differing_settings(*(read_information(Path(folder)) for folder in (one, other)))
    if not differ:
        console.print("both runs have the same settings")
        return
    table = table_of(("setting", one, other))
    for row in differ:
        table.add_row(*map(escape, row))
    print_table(console, table, 1)


def print_criticality(found: Criticality, name: str, folder: Path) -> None:
    """Prints the most critical moment of every measure, notes, and the path of the tables."""
    console = output()
    table = table_of(
        ("measure", "", "most critical", "vehicle", "with", "time [s]", "path or conflict area"),
        right=("most critical", "time [s]"),
    )
    quiet = []
    for measure in MEASURES:
        moment = found.most_critical(measure.name)
        if moment is None:
            quiet.append(measure.name)
            continue
        partner = str(moment.partner_id) if moment.partner_id >= 0 else ""
        value, time = measure.text(moment.value, 3), said_seconds(moment.time_step, found.dt)
        table.add_row(measure.name, measure.title, value, str(moment.participant_id), partner, time, moment.path)
    if table.row_count:
        print_table(console, table, 1)
    if quiet and len(found.participant_id):
        console.print(f"no conflict in {', '.join(quiet)}", style="dim")
    vehicles = said_count(len(found.participant_id), "vehicle")
    console.print(f"{escape(name)}, {vehicles} judged at {int(found.present.any(axis=0).sum())} time steps")
    print_notes(console, found.notes, "Criticality.notes")
    print_folder(console, folder)


def print_pairs(pairs: Sequence[tuple[str, float, CriticalMoment]]) -> None:
    """Prints the most critical moments of pairs: scenario, its time between steps [s], and the moment."""
    console = output()
    headings = ("scenario", "vehicle", "with", "time [s]", "measure", "value", "path or conflict area")
    table = table_of(headings, right=("time [s]", "value"))
    for name, dt, moment in pairs:
        value = measure_named(moment.measure).text(moment.value, 3)
        ids, time = (str(moment.participant_id), str(moment.partner_id)), said_seconds(moment.time_step, dt)
        table.add_row(escape(name), *ids, time, moment.measure, value, moment.path)
    if table.row_count:
        print_table(console, table, 3)
    else:
        console.print("no two vehicles were in conflict")


def print_notes(console: Console, notes: Sequence[str], where: str) -> None:
    """Prints the first notes, and where to find the others."""
    for note in notes[:NOTES_MAX]:
        console.print(f"note: {escape(note)}", style="dim", soft_wrap=True)
    if len(notes) > NOTES_MAX:
        console.print(f"{said_count(len(notes) - NOTES_MAX, 'more note')} in {where}", style="dim")


def print_folder(console: Console, folder: Path) -> None:
    """Prints where the results are."""
    console.print(f"results in {escape(str(folder))}", soft_wrap=True)


def _speed(run: Run) -> str:
    """Median time of a step, without the recording for figures, and its ratio to real time."""
    steps, index = np.unique(run.timings.time_step, return_inverse=True)
    if not len(steps):
        return "no step was simulated"
    is_record = np.fromiter((phase == "record" for phase in run.timings.phase), np.bool_, len(index))
    counted = np.where(is_record, 0.0, run.timings.seconds)
    seconds = float(np.median(np.bincount(index, weights=counted)))
    factor = run.scenario.dt / seconds if seconds > 0 else float("inf")
    return f"{len(steps)} steps, {1000 * seconds:.1f} ms per step (median), {factor:.3g} times real time"


def print_verdict(stored: Mapping[str, Any], repeated: Mapping[str, Any], *, equal: bool) -> None:
    """Prints whether the digests are equal; if not, what else differs."""
    console = output()
    if equal:
        console.print(f"[green]equal[/]: digest {stored['digest']}", soft_wrap=True)
        return
    console.print(
        f"[bold red]different[/]: digest {repeated['digest']}, in run.json {stored['digest']}", soft_wrap=True
    )
    for group in ("versions", "platform"):
        for name, now in repeated[group].items():
            then = stored.get(group, {}).get(name)
            if then != now:
                console.print(f"{name}: now {now}, then {then}", soft_wrap=True, markup=False)


def print_inspection(found: Inspection, junctions: Sequence[Junction], refusals: Mapping[int, str]) -> None:
    """Prints the contents of a scenario, its junctions, and the reasons why vehicles cannot be agents (by id)."""
    console = output()
    least, largest = found.speed_limits
    limits = f"{largest:.1f} m/s" if least == largest else f"{least:.1f} to {largest:.1f} m/s"
    limits = "none stated" if np.isnan(least) else limits
    kinds = ", ".join(f"{count} {kind.replace('_', ' ')}" for kind, count in found.kinds) or "none"
    static = f" ({found.n_static} static)" if found.n_static else ""
    able = [number for number in found.candidates.ids.tolist() if number not in refusals]
    table = Table(box=None, show_header=False, pad_edge=False, title=escape(found.name), title_justify="left")
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    table.add_row("benchmark id", escape(found.benchmark_id))
    table.add_row("time", f"{said_count(found.n_steps, 'step')} of {found.dt:g} s, {found.duration:.1f} s in all")
    size = "{:.0f} m by {:.0f} m".format(*found.extent)
    table.add_row("roads", f"{said_count(found.n_lanelets, 'lanelet')}, {found.lane_length:.0f} m of lanes, {size}")
    table.add_row("speed limits", limits)
    counts = (
        (found.n_traffic_lights, "traffic light"),
        (found.n_stop_lines, "stop line"),
        (found.n_stop_signs, "stop sign"),
        (found.n_crosswalks, "crosswalk"),
    )
    controls = [said_count(n, what) for n, what in counts if n]
    if found.n_turns_on_red:
        controls.append(f"{said_count(found.n_turns_on_red, 'right turn')} on red")
    if found.n_priority_signs:
        controls.append(f"signs of priority at the end of {said_count(found.n_priority_signs, 'lanelet')}")
    table.add_row("control", ", ".join(controls) or "none")
    for number, junction in enumerate(junctions[:_JUNCTIONS_MAX], start=1):
        parts = [f"{n} {name}" for counts in (junction.kinds, junction.reasons) for name, n in counts]
        place = f"{junction.n_lanelets} lanelets about ({junction.x:.0f}, {junction.y:.0f})"
        table.add_row(f"junction {number}", f"{place}; areas: {', '.join(parts)}")
    if len(junctions) > _JUNCTIONS_MAX:
        table.add_row("", f"and {len(junctions) - _JUNCTIONS_MAX} more junctions")
    table.add_row("traffic", kinds + static)
    for problem in found.planning_problems:
        start = f"({problem.x:.1f}, {problem.y:.1f}), {problem.velocity:.1f} m/s"
        on = (
            f", lanelet {', '.join(map(str, problem.start_lanelet_ids))}"
            if problem.start_lanelet_ids
            else ", off every lanelet"
        )
        table.add_row(f"problem {problem.id}", f"from {start}{on}; to {problem.goal}")
    table.add_row(
        "can be agents",
        f"{said_count(len(able), 'vehicle')}: {', '.join(map(str, able))}" if able else "no recorded vehicle",
    )
    console.print(table)
    _print_reasons(console, refusals)
    print_notes(console, found.map_notes, "Inspection.map_notes")
    print_notes(console, found.notes, "Scenario.notes")
    console.print()


def _print_reasons(console: Console, refusals: Mapping[int, str]) -> None:
    """Prints which vehicles cannot become agents and why; those with the same reason share a row."""
    groups: dict[str, list[str]] = {}
    for number, reason in refusals.items():
        groups.setdefault(reason, []).append(str(number))
    if not groups:
        return
    table = table_of(("cannot be agents", "because"))
    for reason, numbers in groups.items():
        table.add_row(", ".join(numbers), escape(reason))
    print_table(console, table, 1)


def print_text(text: str) -> None:
    """Prints a text unchanged."""
    output().print(text, markup=False, soft_wrap=True)


def print_plugins(found: Sequence[Listed]) -> None:
    """Prints name, source and a one-line description of each plug-in."""
    table = table_of(("name", "from", "description"))
    for item in found:
        table.add_row(escape(item.name), escape(item.source), escape(item.text), style="" if item.is_usable else "dim")
    print_table(output(), table, 1)


def print_settings(rows: Sequence[tuple[str, Any, str, str]]) -> None:
    """Prints name, default, unit and meaning of settings."""
    table = table_of(("setting", "default", "unit", "meaning"))
    for name, value, unit, text in rows:
        plain = f"{value:.6g}" if isinstance(value, float) else str(value)
        plain = plain.lower() if value is None or isinstance(value, bool) else plain
        table.add_row(name, escape(plain), escape(unit), escape(text))
    print_table(output(), table, 1)


def print_study(studies: Sequence[CaseStudy], notes: Sequence[str], folder: Path) -> None:
    """Prints the table of the paper, one block per case, and a summary in words."""
    from interdrive.studies import MEASURES, reading, study_table  # noqa: PLC0415 - needs the simulation

    console = output()
    for study in studies:
        headings = [measure.heading for measure in MEASURES]
        table = table_of(
            ("other vehicle", *headings, "collided", f"agent {study.agent}", f"vehicle {study.other}"),
            right=headings,
            tight=True,
            title=f"{study.scenario.name}: agent {study.agent} ({study.planner}), other vehicle {study.other}",
        )
        for row in study_table([study]).to_pylist():
            values = [row[measure.column.name] for measure in MEASURES]
            table.add_row(
                row["degree"].replace("_", "-"),
                *(measure.text(value) for measure, value in zip(MEASURES, values, strict=True)),
                "[bold red]yes[/]" if row["collided"] else "no",
                *(
                    f"[{STYLES.get(outcome, '')}]{outcome}[/]" if outcome else "recorded"
                    for outcome in (row["agent_outcome"], row["other_outcome"])
                ),
            )
        print_table(console, table, 1)
        console.print(escape(reading(study)), style="dim")
        console.print()
    print_notes(console, notes, "")
    print_folder(console, folder)


def print_cooperation(study: CooperationStudy, folder: Path) -> None:
    """Prints the summary by variant, notes, and the path of the tables."""
    from interdrive.studies.cooperation import summary_table  # noqa: PLC0415

    console = output()
    numbers = ("in time", "change", "time lost [s]", "collisions", "deadlocks")
    table = table_of(("variant", *numbers), right=numbers, tight=True)
    for row in summary_table(study).to_pylist():
        reached = (f"{100 * row['reached']:.1f} %", f"{100 * row['reached_change']:+.1f}", f"{row['time_lost']:+.2f}")
        table.add_row(row["variant"], *reached, f"{row['collisions']:g}", f"{row['deadlocks']:g}")
    print_table(console, table, 1)
    print_notes(console, study.notes, "cooperation.json")
    print_folder(console, folder)


def print_runtime(study: RuntimeStudy, folder: Path) -> None:
    """Prints milliseconds per step, growth, notes, and the path of the tables."""
    from interdrive.studies.runtime import growth, step_rows  # noqa: PLC0415
    from interdrive.studies.runtime.summary import QUIET, STEP_PARTS  # noqa: PLC0415

    console, several = output(), study.threads
    numbers = ("agents", "1 thread", f"{several} threads", "ratio", "99 %", *STEP_PARTS, "Python")
    title = f"milliseconds per step, median (quartiles); parts with {several} threads"
    table = table_of(("scenario", *numbers), right=numbers, tight=True, title=title)
    before = ""
    for row in step_rows(study):
        table.add_row(escape(row[0]) if row[0] != before else "", *row[1:])
        before = row[0]
    print_table(console, table, 2)
    grown = growth(study, several)
    if grown is not None:
        console.print(
            f"\ntown, {several} threads: time grows with the number of agents to the power of {grown.exponent:.2f}; "
            f"{grown.to_linear:.2f} times linear from {grown.agents[0]} to {grown.agents[-1]} agents"
        )
    notes = study.notes
    if study.machine["load"] > QUIET * study.machine["cores"]:
        notes = (f"the machine was busy (load {study.machine['load']:.1f} before): all times are too long", *notes)
    print_notes(console, notes, "runtime.json")
    print_folder(console, folder)
