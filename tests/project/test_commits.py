"""Subjects of commits are imperative sentences that fit into one line of `git log`; see CONTRIBUTING.md."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
#: The last commit before the rule; only later ones are checked. A checkout without it has too little history.
BASE = "1ca8f9b6bc5bc4e15f72f0af989a4e3a9f2e2a6a"
LONGEST = 72
#: Endings of "Added", "Adding" and "Adds", and words that end so although they are imperative.
NOT_IMPERATIVE = re.compile(r"(ed|ing|s)$")
IMPERATIVE = re.compile(r"(eed|ss)$|^(Embed|Shed|Bring|Ping|String|Focus)$")


def git(*arguments: str, folder: Path = ROOT) -> str:
    """What git prints. Raises LookupError with its complaint."""
    done = subprocess.run(["git", *arguments], check=False, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise LookupError(f"git {' '.join(arguments)}: {done.stderr.strip() or 'no'}")
    return done.stdout


def later_subjects(base: str, folder: Path = ROOT) -> list[str]:
    """Subjects of the commits after `base`, without merges. Raises LookupError where the history is incomplete."""
    if git("rev-parse", "--is-shallow-repository", folder=folder).strip() == "true":
        raise LookupError("this clone is shallow, so the subjects of commits are unknown: git fetch --unshallow")
    git("merge-base", "--is-ancestor", base, "HEAD", folder=folder)
    return git("log", "--no-merges", "--format=%s", f"{base}..HEAD", folder=folder).splitlines()


def faults(subject: str) -> list[str]:
    """What is wrong with a subject."""
    first = subject.partition(" ")[0]
    wrong = {
        f"{len(subject)} characters, at most {LONGEST}": len(subject) > LONGEST,
        "begins with a small letter": not subject[:1].isupper(),
        f'"{first}" is not imperative': bool(NOT_IMPERATIVE.search(first)) and not IMPERATIVE.search(first),
        "ends with a full stop": subject.endswith("."),
        "names a topic before a colon": ": " in subject,
    }
    return [fault for fault, found in wrong.items() if found]


def test_subjects_of_commits_are_short_and_imperative():
    try:
        subjects = later_subjects(BASE)
    except (LookupError, FileNotFoundError) as missing:
        pytest.skip(str(missing))  # which is a failure in CI
    assert {subject: faults(subject) for subject in subjects if faults(subject)} == {}


@pytest.mark.parametrize(
    "subject", ["Pass standing lorries", "Feed the queue", "Bring planners their barriers", "A" * 72]
)
def test_imperative_subjects_are_accepted(subject):
    assert faults(subject) == []


@pytest.mark.parametrize(
    ("subject", "fault"),
    [
        ("Added a planner", '"Added" is not imperative'),
        ("Adding a planner", '"Adding" is not imperative'),
        ("Adds a planner", '"Adds" is not imperative'),
        ("add a planner", "begins with a small letter"),
        ("Add a planner.", "ends with a full stop"),
        ("Planner: add a setting", "names a topic before a colon"),
        ("A" * 73, "73 characters, at most 72"),
    ],
)
def test_other_subjects_are_refused_with_the_reason(subject, fault):
    assert faults(subject) == [fault]


def test_a_shallow_clone_and_an_unknown_base_are_named(tmp_path):
    git("init", "--quiet", str(tmp_path / "whole"), folder=tmp_path)
    author = ["-c", "user.name=a", "-c", "user.email=a@b.c"]
    for subject in ("First", "Second", "Third"):
        git(*author, "commit", "--quiet", "--allow-empty", "-m", subject, folder=tmp_path / "whole")
    first = git("rev-parse", "HEAD~2", folder=tmp_path / "whole").strip()
    assert later_subjects(first, tmp_path / "whole") == ["Third", "Second"]
    with pytest.raises(LookupError, match="Not a valid commit name"):
        later_subjects(BASE, tmp_path / "whole")

    git("clone", "--quiet", "--depth", "1", (tmp_path / "whole").as_uri(), "shallow", folder=tmp_path)
    with pytest.raises(LookupError, match="this clone is shallow"):
        later_subjects(first, tmp_path / "shallow")
