"""The report: one HTML page with its PNG figures beside it, readable without a network.

The page asks for nothing but the pictures in its own folder, runs no script, and escapes every
string that it is given.
"""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, isnan
from pathlib import Path
from typing import ClassVar

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from matplotlib.figure import Figure
from PIL import Image

from lmtr.errors import DataError
from lmtr.figures.style import save

PAGE = "index.html"
FIGURE_FOLDER = "figures"

CSS_RESOLUTION = 96.0
"""CSS pixels per inch: pictures are shown at the size that their fonts were chosen for."""

Cell = str | int | float | None


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    kind: ClassVar[str] = "text"

    text: str


@dataclass(frozen=True)
class Picture:
    """A figure with its caption.

    Attributes:
        name: Stem of its file, unique in the report.
        source: A matplotlib figure to write, or a PNG or GIF to copy.
        caption: What is seen, and how to read it.
        alternative: What the picture says, for those who cannot see it.
    """

    kind: ClassVar[str] = "picture"

    name: str
    source: Figure | Path
    caption: str
    alternative: str


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        caption: What it shows.
        headers: Column names with units.
        rows: Cells; numbers are right-aligned, floats given to three digits, None as a dash.
    """

    kind: ClassVar[str] = "table"

    caption: str
    headers: Sequence[str]
    rows: Sequence[Sequence[Cell]]


@dataclass(frozen=True)
class Commands:
    """Shell commands, one per line."""

    kind: ClassVar[str] = "commands"

    lines: Sequence[str]


Block = Text | Picture | Table | Commands


@dataclass(frozen=True)
class Section:
    """A headed part of the report."""

    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class ReportContent:
    """Everything that a report says.

    Attributes:
        title: Title of the page.
        summary: The main findings, in a few sentences.
        provenance: Names and values that trace the numbers: seed, data set, versions.
        sections: The parts, in order.
        reproduce: Commands that make the report again.
    """

    title: str
    summary: str
    provenance: Sequence[tuple[str, str]]
    sections: Sequence[Section]
    reproduce: Sequence[str]

    def __post_init__(self) -> None:
        if not any(section.blocks for section in self.sections):
            raise DataError("report: needs at least one section with content, got none; add one")
        pictures = [block for block in self.blocks if isinstance(block, Picture)]
        names = [picture.name for picture in pictures]
        for picture in pictures:
            if names.count(picture.name) > 1:
                raise DataError(f"report: picture names must be unique, got {picture.name!r} twice")
            if not picture.alternative.strip():
                raise DataError(f"report: picture {picture.name!r} needs an alternative text")
        for table in (block for block in self.blocks if isinstance(block, Table)):
            for row in table.rows:
                if len(row) != len(table.headers):
                    raise DataError(
                        f"report: rows of table {table.caption!r} must have {len(table.headers)} "
                        f"cells as its header, got {len(row)}"
                    )

    @property
    def blocks(self) -> list[Block]:
        """The blocks of all sections."""
        return [block for section in self.sections for block in section.blocks]


@dataclass(frozen=True)
class _Placed:
    """A picture in the report's folder, and the size it is shown at in CSS pixels."""

    address: str
    width: int
    height: int


def write_report(content: ReportContent, folder: Path) -> Path:
    """Write the page and its pictures into a folder, which is made if need be.

    Returns:
        The page's path.

    Raises:
        DataError: A picture's file does not exist or is neither PNG nor GIF.
    """
    (folder / FIGURE_FOLDER).mkdir(parents=True, exist_ok=True)
    pictures = {
        block.name: _place(block, folder) for block in content.blocks if isinstance(block, Picture)
    }
    page = folder / PAGE
    page.write_text(_template().render(content=content, pictures=pictures), encoding="utf-8")
    return page


def _place(picture: Picture, folder: Path) -> _Placed:
    """Write or copy a picture into the report's folder."""
    if isinstance(picture.source, Path):
        path = folder / FIGURE_FOLDER / f"{picture.name}{picture.source.suffix}"
        if not picture.source.is_file() or picture.source.suffix not in (".png", ".gif"):
            raise DataError(
                f"report: picture {picture.name!r} must be an existing .png or .gif, "
                f"got {picture.source}; draw it first"
            )
        if picture.source.resolve() != path.resolve():
            shutil.copyfile(picture.source, path)
    else:
        path = save(picture.source, folder / FIGURE_FOLDER / f"{picture.name}.png")
    with Image.open(path) as image:
        scale = CSS_RESOLUTION / float(image.info.get("dpi", (CSS_RESOLUTION,))[0])
        width, height = (round(scale * pixels) for pixels in image.size)
    return _Placed(path.relative_to(folder).as_posix(), width, height)


def _template() -> Template:
    environment = Environment(
        loader=PackageLoader("pipelines", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["cell"] = format_cell
    environment.tests["numeric"] = lambda cell: cell is None or isinstance(cell, int | float)
    return environment.get_template("report.html")


def format_cell(cell: Cell) -> str:
    """A cell as text: integers with thousands separated, floats to three digits, None as a dash."""
    if cell is None or (isinstance(cell, float) and isnan(cell)):
        return "–"
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    if isinstance(cell, int):
        return f"{cell:,}"
    if isinstance(cell, float):
        large = not isfinite(cell) or abs(cell) >= 999.5
        text = f"{cell:,.0f}" if large or cell == 0.0 else f"{cell:#.3g}".rstrip(".")
        return text.replace("-", "−")
    return cell
