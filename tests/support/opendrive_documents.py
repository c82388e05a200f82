"""OpenDRIVE documents for tests: roads of a few records."""

from __future__ import annotations


def geometry(form: str, length: float, s: float = 0.0, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> str:
    """A geometry record with the element of its form."""
    return f'<geometry s="{s}" x="{x}" y="{y}" hdg="{heading}" length="{length}">{form}</geometry>'


def lane(
    number: int,
    *,
    kind: str = "driving",
    width: str = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>',
    before: int | None = None,
    after: int | None = None,
    more: str = "",
    direction: str = "",
) -> str:
    """A lane of a section with its links."""
    links = "".join(
        f'<{which} id="{other}"/>'
        for which, other in (("predecessor", before), ("successor", after))
        if other is not None
    )
    attribute = f' direction="{direction}"' if direction else ""
    return f'<lane id="{number}" type="{kind}"{attribute}><link>{links}</link>{width if number else ""}{more}</lane>'


def section(*lanes: str, s: float = 0.0) -> str:
    """A section; lanes are on the side that their ids tell."""

    def side(text: str) -> str:
        number = int(text.split('"')[1])
        return "left" if number > 0 else "right" if number < 0 else "center"

    inner = "".join(
        f"<{name}>{''.join(text for text in lanes if side(text) == name)}</{name}>"
        for name in ("left", "center", "right")
        if any(side(text) == name for text in lanes)
    )
    return f'<laneSection s="{s}">{inner}</laneSection>'


def road(
    number: int,
    geometries: str,
    lanes: str,
    *,
    length: float,
    rule: str = "",
    junction: int = -1,
    before: str = "",
    after: str = "",
    more: str = "",
) -> str:
    """A road; `before` and `after` are attributes of its links, `lanes` sections and offsets, in this order."""
    links = "".join(f"<{which} {text}/>" for which, text in (("predecessor", before), ("successor", after)) if text)
    attribute = f' rule="{rule}"' if rule else ""
    return (
        f'<road id="{number}" length="{length}" junction="{junction}"{attribute}><link>{links}</link>{more}'
        f"<planView>{geometries}</planView><lanes>{lanes}</lanes></road>"
    )


def document(*parts: str, header: str = "") -> str:
    """A document of roads and junctions."""
    opening = f'<?xml version="1.0"?><OpenDRIVE><header revMajor="1" revMinor="6">{header}</header>'
    return f"{opening}{''.join(parts)}</OpenDRIVE>"
