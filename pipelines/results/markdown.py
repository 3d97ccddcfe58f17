"""The page as Markdown, its figures as PNG and PDF, and all of its numbers as JSON."""

import json
from collections.abc import Sequence
from pathlib import Path

from lmtr.errors import DataError
from lmtr.figures.style import save
from pipelines.report.page import format_cell
from pipelines.results.blocks import (
    Block,
    Cell,
    Chapter,
    Illustration,
    Measure,
    Missing,
    Paragraph,
    Table,
    plain_number,
)

PAGE = "results.md"
NUMBERS = "numbers.json"
IMAGES = "images"
FIGURES = "figures"

SHARP = 200
"""Pixels per inch of the page's pictures."""


def write_page(title: str, lead: Sequence[str], chapters: Sequence[Chapter], folder: Path) -> Path:
    """Write a page into a folder, which is made if need be; returns the page's path.

    Args:
        title: Headline.
        lead: Paragraphs before the first chapter.
        chapters: The parts, in order; those without content are left out.
        folder: Gets ``results.md``, ``numbers.json``, ``images/*.png`` and ``figures/*.pdf``.

    Raises:
        DataError: Two tables or two figures have the same name.
    """
    chapters = [chapter for chapter in chapters if chapter.blocks]
    blocks = [block for chapter in chapters for block in chapter.blocks]
    names = [block.name for block in blocks if isinstance(block, Table | Illustration)]
    doubled = sorted({name for name in names if names.count(name) > 1})
    if doubled:
        raise DataError(f"results page: names must be unique, got {doubled} more than once")
    for sub in (IMAGES, FIGURES):
        (folder / sub).mkdir(parents=True, exist_ok=True)
    for block in blocks:
        if isinstance(block, Illustration):
            save(block.figure, folder / IMAGES / f"{block.name}.png", SHARP)
            save(block.figure, folder / FIGURES / f"{block.name}.pdf", SHARP)
    text = [f"# {title}", *lead]
    for chapter in chapters:
        text.append(f"## {chapter.title}")
        text += [_markdown(block) for block in chapter.blocks]
    numbers = {block.name: _numbers(block) for block in blocks if isinstance(block, Table)}
    (folder / NUMBERS).write_text(json.dumps(numbers, indent=1, ensure_ascii=False) + "\n", "utf-8")
    page = folder / PAGE
    page.write_text("\n\n".join(text) + "\n", "utf-8")
    return page


def _markdown(block: Block) -> str:
    if isinstance(block, Illustration):
        return f"![{block.name}]({IMAGES}/{block.name}.png)\n\n*{block.caption}*"
    if isinstance(block, Missing):
        return f"> Missing: {block.text}"
    if isinstance(block, Paragraph):
        return block.text
    return _table(block)


def _table(table: Table) -> str:
    numeric = [
        all(isinstance(row.cells[k], int | float | Measure | None) for row in table.rows)
        for k in range(len(table.headers))
    ]
    lines = [
        _line(table.headers),
        _line(["---:" if right else ":---" for right in numeric]),
        *(_line([_text(cell) for cell in row.cells]) for row in table.rows),
    ]
    return f"{table.caption}\n\n" + "\n".join(lines)


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _text(cell: Cell) -> str:
    if isinstance(cell, Measure):
        return str(cell)
    return format_cell(cell).replace("\n", " ")


def _numbers(table: Table) -> list[dict[str, object]]:
    """The rows of a table in full precision, each with what it was read from."""
    return [
        {
            "row": {
                header: _plain(cell) for header, cell in zip(table.headers, row.cells, strict=True)
            },
            "from": list(row.ids),
        }
        for row in table.rows
    ]


def _plain(cell: Cell) -> object:
    if isinstance(cell, Measure):
        return cell.as_json()
    return plain_number(cell) if isinstance(cell, float) else cell
