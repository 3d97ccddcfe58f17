"""The page that derives the problem and the code that cites it agree on their equations."""

import re
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "formulation.md"

EQUATION = r"E\d+(?:–E\d+)?"
CITATION = re.compile(rf"\(({EQUATION}(?:, {EQUATION})*)(?:; [^)]*)?\)")
"""As in (E7), (E3, E5), (E22–E24) or (E11; Sec. 4.1)."""


def numbered() -> list[int]:
    """Numbers of the page's equations, from top to bottom."""
    return [int(number) for number in re.findall(r"\\tag\{E(\d+)\}", PAGE.read_text())]


def cited(text: str) -> set[int]:
    """Numbers of the equations that a text cites."""
    numbers: set[int] = set()
    for citation in CITATION.findall(text):
        for part in citation.split(", "):
            ends = [int(number) for number in re.findall(r"\d+", part)]
            numbers.update(range(ends[0], ends[-1] + 1))
    return numbers


def sources(*folders: str) -> Iterable[Path]:
    for folder in folders:
        yield from (ROOT / folder).rglob("*.py")


def test_equations_are_numbered_from_one_in_reading_order() -> None:
    found = numbered()
    assert found == list(range(1, len(found) + 1))
    assert len(found) > 30


def test_every_citation_leads_to_an_equation() -> None:
    known = set(numbered())
    astray = {
        str(path.relative_to(ROOT)): sorted(cited(path.read_text()) - known)
        for path in [*sources("lmtr", "benchmarks"), PAGE]
    }
    assert {path: missing for path, missing in astray.items() if missing} == {}


def test_every_equation_is_cited_where_it_is_coded() -> None:
    by_code = set().union(*(cited(path.read_text()) for path in sources("lmtr")))
    assert sorted(set(numbered()) - by_code) == []


def test_citations_of_several_equations_are_understood() -> None:
    text = "As (E3, E5) say, (E7–E9; Sec. 4.1) hold; `# noqa: E501`, (Eq. 2) and E4 are not cited."
    assert cited(text) == {3, 5, 7, 8, 9}


def test_every_picture_and_page_that_is_linked_exists() -> None:
    links = re.findall(r"\]\(([^)]+)\)", PAGE.read_text())
    assert links
    assert [link for link in links if not (PAGE.parent / link).exists()] == []
