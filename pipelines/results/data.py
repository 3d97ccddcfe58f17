"""The expert's data: acceptance, reasons, effort and distributions of each data set."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from pipelines import records
from pipelines.datasets import configuration_of
from pipelines.report import page
from pipelines.report.dataset import dataset_section
from pipelines.results.blocks import Block, Chapter, Illustration, Missing, Paragraph, Row, Table
from pipelines.results.parts import Part
from pipelines.workspace import Workspace

TABLES = ("quantities", "reasons")
"""Names of the tables of a data set, in the order of the report."""


def data_chapter(workspace: Workspace, parts: Sequence[Part]) -> Chapter:
    """Every data set of the study, and the number of segments of every part."""
    blocks: list[Block] = []
    for number, dataset_id in enumerate(dict.fromkeys(part.dataset_id for part in parts)):
        blocks += _dataset(workspace, dataset_id, number)
    blocks.append(
        Table(
            "segments",
            "Segments that each part of the study learns from (mirror images included) and holds "
            "out, by solution.",
            ["part", "data set", "cut", "version of the table", "learnt from", "held out"],
            [
                Row(
                    [
                        part.name,
                        part.dataset_id,
                        part.segmentation_id or None,
                        part.segments_version,
                        part.training_rows,
                        part.validation_rows,
                    ],
                    [part.dataset_id],
                )
                for part in parts
            ],
        )
    )
    return Chapter("Expert data", blocks)


def _dataset(workspace: Workspace, dataset_id: str, number: int) -> list[Block]:
    """The report's section on a data set, under names of its own."""
    lake = workspace.lake
    where = f"dataset_id = '{dataset_id}'"
    if not lake.exists("solutions") or not (rows := _rows(workspace, where)):
        return [Missing(f"Data set {dataset_id} has no solutions yet; run `lmtr generate`.")]
    section = dataset_section(rows, configuration_of(workspace, dataset_id).quality)
    blocks: list[Block] = [Paragraph(f"Data set `{dataset_id}`:")]
    names = iter(TABLES)
    for block in section.blocks:
        if isinstance(block, page.Table):
            cells = [Row(list(row), [dataset_id]) for row in block.rows]
            blocks.append(
                Table(f"data-{number}-{next(names)}", block.caption, block.headers, cells)
            )
        elif isinstance(block, page.Picture) and isinstance(block.source, Figure):
            blocks.append(Illustration(f"data-{number}-{block.name}", block.source, block.caption))
    return blocks


def _rows(workspace: Workspace, where: str) -> list[records.Row]:
    rows: list[records.Row] = workspace.lake.read(
        "solutions", where=where, order_by="index"
    ).to_pylist()
    return rows
