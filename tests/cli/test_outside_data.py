"""What comes from outside (files, paths, environment, streams) is used, or refused in one line; it is never a bug."""

from __future__ import annotations

import copy
import json
import os
import random
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from interdrive import envs
from interdrive.cli import main

SHORT = ("--agents", "1", "--planner", "idm", "--set", "step.max_steps=2", "--quiet")

#: Values that no field expects: other types, other signs, too large, too deep, and what is no path.
NO_TYPE = (None, True, "", "x", "x" * 5000, [], {}, [[1, 2]], {"a": 1}, ["a", None])
NO_SIZE = (-1, 2**64, -(2**70), 1e308, 10**400, 0.5)
NO_PATH = ("\0", "a\0b", "~nosuchuser/x", "\ud800", "/", "..")
DEEP = json.loads("[" * 50 + "]" * 50)
HOSTILE = (*NO_TYPE, *NO_SIZE, *NO_PATH, DEEP)


def invoke(*arguments):
    """Exit code and the lines on stderr; a bug is the exception itself."""
    done = CliRunner().invoke(main, [str(one) for one in arguments])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.exit_code, done.stderr.splitlines()


def is_used_or_refused(*arguments):
    code, lines = invoke(*arguments)
    assert code in (0, 1, 2), (arguments, lines)
    if code == 2:
        assert len(lines) == 1, lines
        assert not [word for word in ("NoneType", "__init__", "object has no", "codec") if word in lines[0]], lines[0]


def refused(*arguments):
    code, lines = invoke(*arguments)
    assert (code, len(lines)) == (2, 1), lines
    return lines[0]


def places(value, above=()):
    """Paths to all values within a value; of lists to the first two."""
    yield above
    inside = value.items() if isinstance(value, dict) else enumerate(value[:2]) if isinstance(value, list) else ()
    for key, item in inside:
        yield from places(item, (*above, key))


def changed(value, place, new):
    if not place:
        return new
    value = copy.deepcopy(value)
    inner = value
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = new
    return value


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A run folder `run` and a batch `batch`, each of one short run."""
    folder = tmp_path_factory.mktemp("made")
    assert invoke("run", "t_junction", *SHORT, "--out", folder / "run") == (0, [])
    assert invoke("batch", "t_junction", *SHORT, "--workers", "1", "--out", folder / "batch")[0] == 0
    return folder


#: Reads a run folder in many ways; each place of run.json is tried by one of them.
READERS = (
    ("verify",),
    ("explain",),
    ("criticality", "--quiet", "--out", "c"),
    ("score",),
    ("solution", "--out", "s.xml"),
)


def test_any_field_of_run_json_with_any_value_is_read_or_refused(folders, here):
    file = folders / "run" / "run.json"
    good = file.read_text()
    chosen = random.Random(1)
    try:
        for place in chosen.sample(list(places(json.loads(good))), 40):
            file.write_text(json.dumps(changed(json.loads(good), place, chosen.choice(HOSTILE))))
            name, *options = chosen.choice(READERS)
            is_used_or_refused(name, file.parent, *options)
    finally:
        file.write_text(good)


@pytest.mark.parametrize("path", ["\0", "a\0b.xml", "~nosuchuser/x.xml", "x" * 5000, "/", "\ud800"])
def test_a_scenario_path_in_run_json_that_is_no_path_is_not_looked_for(folders, here, path):
    file = folders / "run" / "run.json"
    good = json.loads(file.read_text())
    try:
        file.write_text(json.dumps(changed(good, ("scenario", "path"), path)))
        for name, *options in READERS:
            is_used_or_refused(name, file.parent, *options)
    finally:
        file.write_text(json.dumps(good))


@pytest.mark.parametrize("content", [b"", b"[]", b"null", b'{"format": 1e999}', b"[" * 100_000, b"\xd6", b"9" * 5000])
@pytest.mark.parametrize("mark", ["run.json", "batch.json"])
def test_a_json_file_with_any_content_is_refused_by_its_name(here, mark, content):
    (here / "made").mkdir()
    (here / "made" / mark).write_bytes(content)
    line = refused("report", "made", "--quiet")
    assert "made" in line.partition(":")[2]


def test_a_field_of_batch_json_with_any_value_is_read_or_refused(folders, here):
    file = folders / "batch" / "batch.json"
    good = file.read_text()
    try:
        for place in places(json.loads(good)):
            for value in HOSTILE:
                file.write_text(json.dumps(changed(json.loads(good), place, value)))
                is_used_or_refused("compare", file.parent, "--out", "compared", "--samples", "1", "--quiet")
    finally:
        file.write_text(good)


@pytest.fixture(scope="module")
def policy(tmp_path_factory):
    """The bytes of a policy file: its header, decoded, and the weights behind it."""
    file = tmp_path_factory.mktemp("policy") / "good.safetensors"
    rng = np.random.default_rng(0)
    sizes = {"hidden.0": (4, 324), "action": (2, 4)}
    layers = {f"{name}.weight": rng.standard_normal(size).astype(np.float32) for name, size in sizes.items()}
    layers |= {f"{name}.bias": np.zeros(size[0], np.float32) for name, size in sizes.items()}
    envs.export_policy(file, layers)
    content = file.read_bytes()
    (size,) = struct.unpack("<Q", content[:8])
    return json.loads(content[8 : 8 + size]), content[8 + size :]


def write_policy(policy, metadata):
    head, body = policy
    text = json.dumps({**head, "__metadata__": {**head["__metadata__"], **metadata}}).encode()
    Path("p.safetensors").write_bytes(struct.pack("<Q", len(text)) + text + body)


def driven_by_the_policy():
    return refused("run", "t_junction", *SHORT, "--planner", "policy,file=p.safetensors", "--out", "r")


@pytest.mark.parametrize(
    ("name", "text", "why"),
    [
        ("actions", '["kinematic", {}, [-1]]', "expected numbers from 0 to 10000, not -1"),
        (
            "actions",
            f'["kinematic_grid", {{}}, [{2**64}, 1]]',
            "expected numbers from 0 to 10000, not 18446744073709551616",
        ),
        ("actions", '["kinematic", {}, [0.5]]', "expected numbers from 0 to 10000, not 0.5"),
        ("actions", '["kinematic", {}, [true]]', "expected numbers from 0 to 10000, not True"),
        ("actions", "[" * 100_000, "it is nested too deeply"),
        ("observation", "[" * 100_000, "it is nested too deeply"),
        ("observation", '{"a":' * 100_000, "it is nested too deeply"),
        ("observation", "[]", "expected a table of settings"),
        ("observation", '{"speed": 1}', "this version has no setting speed"),
        ("observation", '{"route": -1}', "route: must be 0 to 16, not -1"),
        ("observation", '{"route": 1e999}', "1e999 is not a JSON number"),
        ("actions", '["kinematic", [], []]', "expected a table of settings"),
        ("actions", '["kinematic", {"brake": "x"}, []]', "brake: expected a number, not x"),
        ("actions", '{"kinematic": 1}', "expected a name, a table and a list of numbers"),
        ("actions", "", "cannot be read as JSON"),
    ],
)
def test_metadata_of_a_policy_is_refused_by_file_and_field(here, policy, name, text, why):
    write_policy(policy, {name: text})
    line = driven_by_the_policy()
    assert f"p.safetensors: metadata {name}" in line
    assert why in line


def test_any_metadata_of_a_policy_with_any_value_is_used_or_refused(here, policy):
    told = {name: json.loads(policy[0]["__metadata__"][name]) for name in ("actions", "observation")}
    chosen = random.Random(2)
    for place in chosen.sample(list(places(told)), 12):
        if place:
            new = changed(told, place, chosen.choice(HOSTILE))
            write_policy(policy, {name: json.dumps(value) for name, value in new.items()})
            is_used_or_refused(
                *("run", "t_junction", *SHORT, "--planner", "policy,file=p.safetensors", "--out", "r", "--overwrite")
            )


ENTRIES = (
    "scenario",
    "agents",
    "planner",
    "predictor",
    "v2x",
    "seed",
    "threads",
    "out",
    "overwrite",
    "png",
)
VALUES = (
    *("1979-05-27", "07:32:00", "2020-01-01T00:00:00Z", "9" * 5000, "nan", "-inf", "-1", "1.5", "true", "[[[[]]]]"),
    *('""', '"x"', r'"\u0000"', '"~nosuchuser/x"', "{a = 1}", "[1, 'a']", "1e308", str(2**64)),
)


def test_any_entry_of_a_configuration_with_any_value_is_used_or_refused(here):
    chosen = random.Random(3)
    for _ in range(40):
        entry, value = chosen.choice(ENTRIES), chosen.choice(VALUES)
        entries = {"scenario": '"t_junction"', "agents": "1", "planner": '"idm"', "out": '"r"', entry: value}
        Path("c.toml").write_text("[run]\n" + "\n".join(f"{name} = {text}" for name, text in entries.items()))
        is_used_or_refused("run", "--config", "c.toml", "--quiet", "--set", "step.max_steps=2", "--overwrite")


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"[run]\n\n# \xd6\n", "byte 214 at line 3 is not UTF-8"),
        (b"\xff\xfe[\0", "byte 255 at line 1 is not UTF-8"),
        (b"a = " + b"[" * 100_000, "nested too deeply"),
        (b"a = " + b"{b=" * 100_000, "nested too deeply"),
        (b"[run]\nseed = " + b"9" * 5000, "not a configuration file"),
        (b"a.b.c", "not a configuration file"),
    ],
)
def test_a_configuration_that_is_no_toml_is_refused_by_its_name(here, content, why):
    Path("c.toml").write_bytes(content)
    for command in (("run", "t_junction"), ("batch", "t_junction", "--out", "b")):
        line = refused(*command, "--config", "c.toml")
        assert line.startswith("error: c.toml: ")
        assert why in line
    if why != "not a configuration file":
        assert why in refused("predict-eval", "t_junction", "--split", "c.toml", "--quiet")


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "t_junction", "--planner", "policy,file=~nosuchuser/x"),
        ("run", "t_junction", "--predictor", "neural,weights=~nosuchuser/x"),
        ("run", "~nosuchuser/x"),
        ("run", "t_junction", "--config", "~nosuchuser/x"),
        ("predict-eval", "t_junction", "--split", "~nosuchuser/x"),
        ("benchmark", "idm", "--scenarios", "~nosuchuser/x", "--out", "b"),
        ("run", "a\0b"),
        ("run", "t_junction", "--out", "a\0b"),
        ("run", "t_junction", "--planner", "policy,file=a\0b"),
        ("run", "t_junction", "--predictor", "neural,weights=a\0b"),
        ("report", "a\0b"),
        ("verify", "a\0b"),
        ("check", "a\0b"),
        ("batch", "a\0b", "--out", "b"),
        ("predict-eval", "a\0b"),
        ("criticality", "a\0b"),
        ("compare", "a\0b"),
        ("sql", "a\0b", "select 1"),
        ("score", "a\0b"),
    ],
)
def test_a_path_that_cannot_be_is_refused(here, arguments):
    refused(*arguments)


@pytest.mark.parametrize(
    "text",
    [
        "select timestamp 'infinity' as t",
        "select timestamptz '-infinity' as t",
        "select date 'infinity' as t",
        "select date '290000-01-01' as t",
        "select [timestamp 'infinity'] as t",
        "select {'a': date '-infinity'} as t",
    ],
)
@pytest.mark.parametrize("form", [(), ("--csv",)])
def test_a_value_that_python_cannot_hold_is_refused_by_its_column(folders, text, form):
    pytest.importorskip("duckdb")
    assert "column t: it has values that cannot be shown" in refused("sql", folders / "batch", text, *form)
    assert invoke("sql", folders / "batch", text.replace(" as t", "::text as t"), *form)[0] == 0


def test_a_query_may_be_about_any_type(folders):
    pytest.importorskip("duckdb")
    values = (
        *("interval 1 month", "'\\xAA'::blob", "uuid()", "map {'a': 1}", "union_value(a := 1)", "bitstring('1')"),
        *("1::hugeint * 10000000000", "'nan'::double", "'a'::enum('a')", "time '12:00'", "timetz '12:00+02'", "chr(0)"),
    )
    for value in values:
        is_used_or_refused("sql", folders / "batch", f"select {value} as x")
        is_used_or_refused("sql", folders / "batch", f"select {value} as x", "--csv")


def test_escapes_in_an_answer_are_shown_in_every_form(folders):
    pytest.importorskip("duckdb")
    for form in ((), ("--csv",)):
        done = CliRunner().invoke(
            main, ["sql", str(folders / "batch"), "select chr(27) || '[2J' || chr(8238) as t", *form]
        )
        assert r"\x1b[2J\u202e" in done.stdout
        assert "\x1b" not in done.stdout


def command(*arguments, **environment):
    return subprocess.run(
        [sys.executable, "-m", "interdrive", *map(str, arguments)],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize(
    "environment",
    [
        {"MPLBACKEND": "nosuch"},
        {"MPLBACKEND": "module://nosuch", "SOURCE_DATE_EPOCH": "yesterday"},
        {"MPLCONFIGDIR": "/proc/nosuch", "XDG_CACHE_HOME": "~nosuchuser/x"},
    ],
)
def test_figures_are_drawn_whatever_the_environment_says(folders, here, environment):
    done = command("plot", folders / "run", "--kind", "velocity", "--out", "v.pdf", "--quiet", **environment)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("arguments", "code"),
    [(("run", "nosuch"), 2), (("nosuch",), 2), (("planners",), 0), (("run", "t_junction", *SHORT), 0)],
)
def test_a_stderr_that_cannot_be_written_changes_no_exit_code(here, arguments, code):
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "interdrive", *arguments], stdout=subprocess.PIPE, stderr=full, check=False
        )
    assert done.returncode == code


def test_the_traceback_of_a_bug_reaches_no_terminal_as_a_command(here):
    Path("mine.py").write_text(
        "class Planner:\n    def plan(self, view, predictions):\n        raise ValueError('\\x1b[2J')\n"
    )
    done = command("run", "t_junction", "--agents", "1", "--planner", "mine:Planner", "--raise", "--out", "r")
    assert r"\x1b[2J" in done.stderr
    assert "\x1b" not in done.stderr + done.stdout
