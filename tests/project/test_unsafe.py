"""The shipped Rust leaves the guarantees of the compiler at one place: the call of functions compiled for AVX2."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CRATES = ROOT / "crates"
#: What is compiled into the package; tests count allocations with allocators of their own.
SHIPPED = sorted(CRATES.glob("*/src/**/*.rs")) + sorted(CRATES.glob("*/build.rs"))
COMMENT_OR_TEXT = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\])*"', re.DOTALL)


def unsafe_in(source: str) -> int:
    """Uses of the keyword, without comments and texts."""
    return len(re.findall(r"\bunsafe\b", COMMENT_OR_TEXT.sub("", source)))


def test_shipped_rust_has_exactly_one_unsafe():
    counts = {str(path.relative_to(CRATES)): unsafe_in(path.read_text("utf-8")) for path in SHIPPED}
    assert {path: count for path, count in counts.items() if count} == {"core/src/simd.rs": 1}


@pytest.mark.parametrize(
    ("source", "count"),
    [
        ("unsafe { f() }", 1),
        ("unsafe fn f() {} unsafe impl Send for A {} unsafe extern {}", 3),
        ('// unsafe\n/* unsafe */ let a = "unsafe"; let unsafe_code = 1;', 0),
    ],
)
def test_the_keyword_is_counted_and_not_the_word(source, count):
    assert unsafe_in(source) == count


def test_unsafe_is_refused_in_every_crate_and_allowed_once():
    lints = tomllib.loads((ROOT / "Cargo.toml").read_text("utf-8"))["workspace"]["lints"]["rust"]
    assert lints["unsafe_code"] in ("deny", "forbid")
    for manifest in CRATES.glob("*/Cargo.toml"):
        assert tomllib.loads(manifest.read_text("utf-8"))["lints"] == {"workspace": True}, manifest
    allowed = [
        path for path in SHIPPED for _ in re.findall(r"\b(?:allow|expect)\s*\(\s*unsafe_code", path.read_text("utf-8"))
    ]
    assert [path.name for path in allowed] == ["simd.rs"]
