"""The report page is whole, safe and asks for nothing but its own pictures."""

from html.parser import HTMLParser

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from lmtr.errors import DataError
from pipelines.report.page import (
    Commands,
    Picture,
    ReportContent,
    Section,
    Table,
    Text,
    format_cell,
    write_report,
)


class Page(HTMLParser):
    """Collects tags with their attributes, and text by the tag it stands in."""

    def __init__(self, html):
        super().__init__()
        self.tags, self.texts, self.open = [], [], []
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in ("meta", "img", "link"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if data.strip():
            self.texts.append((self.open[-1], data))


def plot():
    figure = Figure(figsize=(4.0, 2.0))
    figure.subplots().plot([0, 1], [1, 0])
    return figure


def content(*blocks, **changes):
    parts = {
        "title": "Replanners <compared>",
        "summary": "LMTR & library",
        "provenance": [("seed", "1"), ("code", '<script>alert("x")</script>')],
        "sections": [Section("Results", blocks)],
        "reproduce": ["lmtr report --seed 1 && echo done"],
    }
    return ReportContent(**{**parts, **changes})


def test_all_pictures_exist_and_are_shown_at_their_printed_size(tmp_path):
    Image.new("RGB", (120, 80)).save(tmp_path / "film.gif")
    page = write_report(
        content(
            Picture("plot", plot(), "A line", "It falls from one to zero"),
            Picture("film", tmp_path / "film.gif", "A walk", "A robot walks"),
        ),
        tmp_path / "report",
    )
    images = [attrs for tag, attrs in Page(page.read_text()).tags if tag == "img"]
    assert [image["alt"] for image in images] == ["It falls from one to zero", "A robot walks"]
    sizes = [(image["width"], image["height"]) for image in images]
    assert sizes == [("384", "192"), ("120", "80")]
    for image in images:
        assert (page.parent / image["src"]).stat().st_size > 0


def test_strings_are_escaped(tmp_path):
    rows = [["<b>library</b>", 3]]
    page = write_report(
        content(
            Text("a < b & c"),
            Table("<i>t</i>", ["<u>h</u>", "n"], rows),
            Picture("p", plot(), "<em>caption</em>", '" onerror="alert(1)'),
            Commands(["lmtr run > log"]),
        ),
        tmp_path,
    )
    parsed = Page(page.read_text())
    names = {tag for tag, _ in parsed.tags}
    assert not names & {"script", "b", "i", "u", "em", "compared"}
    assert ("h1", "Replanners <compared>") in parsed.texts
    assert ("dd", '<script>alert("x")</script>') in parsed.texts
    assert ("td", "<b>library</b>") in parsed.texts
    (image,) = (attrs for tag, attrs in parsed.tags if tag == "img")
    assert image["alt"] == '" onerror="alert(1)'
    assert "onerror" not in image


def test_page_asks_for_nothing_from_elsewhere(tmp_path):
    page = write_report(content(Picture("p", plot(), "c", "a")), tmp_path)
    html = page.read_text()
    for tag, attrs in Page(html).tags:
        assert tag not in ("script", "iframe", "object")
        for address in (attrs.get("src"), attrs.get("href")):
            assert address is None or address.startswith(("figures/", "#", "data:,"))
    assert "url(" not in html
    assert "@import" not in html


def test_sections_can_be_reached_from_the_top(tmp_path):
    sections = [Section("One", [Text("x")]), Section("Two", [Text("y")])]
    tags = Page(write_report(content(sections=sections), tmp_path).read_text()).tags
    anchors = {attrs["href"] for tag, attrs in tags if tag == "a"}
    targets = {f"#{attrs['id']}" for _, attrs in tags if "id" in attrs}
    assert anchors == {"#section-1", "#section-2", "#provenance"}
    assert anchors <= targets


def test_numbers_are_aligned_right_and_rounded(tmp_path):
    table = Table("t", ["replanner", "distance (m)"], [["LMTR-6", 11.2345], ["expert", None]])
    parsed = Page(write_report(content(table), tmp_path).read_text())
    assert ("td", "11.2") in parsed.texts
    assert ("td", "–") in parsed.texts
    classes = [attrs.get("class") for tag, attrs in parsed.tags if tag in ("th", "td")]
    assert classes == [None, "number", None, "number", None, "number"]


@pytest.mark.parametrize(
    ("cell", "text"),
    [
        (None, "–"),
        (float("nan"), "–"),
        (float("inf"), "inf"),
        (True, "yes"),
        (25000, "25,000"),
        (0.0, "0"),
        (-0.01234, "−0.0123"),
        (12345.6, "12,346"),
        (np.float64(0.5), "0.500"),
        ("-x", "-x"),
    ],
)
def test_cells_are_written_as_people_write_them(cell, text):
    assert format_cell(cell) == text


def test_written_twice_the_page_is_the_same(tmp_path):
    pages = [
        write_report(content(Picture("p", plot(), "c", "a")), tmp_path / name) for name in "ab"
    ]
    assert pages[0].read_bytes() == pages[1].read_bytes()
    first, second = (page.parent / "figures" / "p.png" for page in pages)
    assert first.read_bytes() == second.read_bytes()


def test_broken_content_is_refused(tmp_path):
    with pytest.raises(DataError, match="at least one section"):
        content(sections=[Section("Empty", [])])
    with pytest.raises(DataError, match="unique"):
        content(Picture("p", plot(), "c", "a"), Picture("p", plot(), "c", "a"))
    with pytest.raises(DataError, match="alternative"):
        content(Picture("p", plot(), "c", " "))
    with pytest.raises(DataError, match="2 cells as its header, got 1"):
        content(Table("t", ["a", "b"], [[1]]))
    with pytest.raises(DataError, match="draw it first"):
        write_report(content(Picture("p", tmp_path / "no.png", "c", "a")), tmp_path)
