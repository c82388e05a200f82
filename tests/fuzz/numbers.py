"""Numbers that programs stumble over, drawn with a given generator."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from random import Random

#: Whole numbers at the ends of what common types hold, and beside them.
WHOLE = (
    *(0, -0, 1, -1, 2, 3, 7, 100, 1000, 10_000, 65_535, 65_536, 999_999, 3_000_000),
    *(2**31 - 1, 2**31, -(2**31), 2**32, 2**53 + 1, 2**63 - 1, 2**63, 2**64, -(2**63) - 1, 10**30, -(10**30)),
)
#: Texts of real numbers: tiny, huge, not finite, and spelled unusually.
REAL = (
    *("0", "-0.0", "1e-320", "5e-324", "1e-300", "1e-12", "1e-9", "1e-6", "1e-3", "0.1", "0.5", "1", "-1"),
    *("3.141592653589793", "-3.141592653589793", "6.283185307179586", "100", "1000.5", "1e4", "1e5", "1e6", "1e7"),
    *("1e8", "9e8", "1e9", "1e12", "1e16", "1e100", "1e300", "1.7976931348623157e308", "1e309", "-1e308", "-1e6"),
    *("nan", "NaN", "inf", "-inf", "Infinity", "1_000", " 5 ", "0x10", "1,5", "٣", "+7", "1e", "", "--1", "1.0.0"),
)


def whole(random: Random, old: int) -> int:
    """A whole number: one of `WHOLE`, or near the old one."""
    if random.random() < 0.5:
        return random.choice(WHOLE)
    return old + random.choice((-2, -1, 1, 2, 10, -10, 1000)) if random.random() < 0.7 else -old


def real(random: Random, old: float) -> float:
    """A real number as protobuf can hold it, so also one that is not finite."""
    draw = random.random()
    if draw < 0.3:
        return random.choice((0.0, -0.0, 5e-324, 1e-300, 1e-9, 1e6, 1e9, 1e100, 1e308, -1e308))
    if draw < 0.4:
        return random.choice((float("nan"), float("inf"), float("-inf")))
    if draw < 0.8:
        return old * random.choice((-1.0, 0.0, 1e-6, 0.01, 0.5, 0.999999, 1.000001, 2.0, 10.0, 1e3, 1e6))
    return old + random.gauss(0.0, random.choice((1e-9, 1e-3, 1.0, 100.0, 1e5)))


def text_of_number(random: Random, old: str) -> str:
    """What stands in place of a number in a document."""
    draw = random.random()
    if draw < 0.2:
        return random.choice(REAL)
    if draw < 0.35:
        return str(random.choice(WHOLE))
    try:
        value = float(old)
    except ValueError:
        return random.choice(REAL)
    if "." not in old and "e" not in old and draw < 0.7 and abs(value) < 1e18:
        return str(whole(random, int(value)))
    return repr(real(random, value))
