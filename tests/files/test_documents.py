"""Elements that are not needed are left out of a document where they are easy to find; all others stay."""

from xml.etree.ElementTree import tostring

import pytest

from interdrive.files import document

ROAD = '<lanelet id="1"><leftBound note="&lt;obstacle&gt;"/></lanelet>'
OBSTACLE = '<obstacle id="7" note="a>b">\n<shape/></obstacle >'


def parsed(text: str, but: tuple[str, ...] = ("obstacle",)) -> str:
    return tostring(document.parse(text.encode(), "some.xml", but=but), encoding="unicode")


@pytest.mark.parametrize("head", ["", "<?xml version='1.0' encoding='UTF-8'?>\n", "<!-- a map -->"])
def test_elements_with_all_that_is_in_them_are_left_out(head):
    found = parsed(f"{head}<map>{OBSTACLE}{ROAD}{OBSTACLE}<obstacles/></map>")
    left = f"<map>{ROAD}<obstacles /></map>".replace('"/>', '" />')
    assert found == (parsed(f"<map>{OBSTACLE}{ROAD}{OBSTACLE}<obstacles/></map>", ()) if "--" in head else left)


@pytest.mark.parametrize(
    "hidden", ["<!-- <obstacle> -->", "<name><![CDATA[<obstacle>]]></name>", "<?who <obstacle> ?>"]
)
def test_what_only_looks_like_an_element_takes_nothing_with_it(hidden):
    text = f"<map>{hidden}{ROAD}{OBSTACLE}</map>"
    assert parsed(text) == parsed(text, ())


def test_elements_without_content_stay():
    assert parsed(f'<map><obstacle id="7"/>{ROAD}</map>') == parsed(f'<map><obstacle id="7"/>{ROAD}</map>', ())


def test_a_greater_than_sign_within_an_attribute_ends_no_element():
    text = f'<map><obstacle id="7" note="a>b"/>{ROAD}<obstacle id="8" note=\'a/>b\'><shape/></obstacle></map>'
    assert parsed(text) == parsed(f'<map><obstacle id="7" note="a>b"/>{ROAD}</map>', ())
