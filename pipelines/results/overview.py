"""What was run: parts, seeds, configurations, versions of code and data, times of stages."""

from collections.abc import Mapping, Sequence

from pipelines.config import settings_digest
from pipelines.provenance import code_version
from pipelines.results.blocks import Block, Chapter, Missing, Row, Table
from pipelines.results.differences import changes, in_words
from pipelines.results.groups import Groups
from pipelines.results.parts import Part
from pipelines.workspace import Workspace

VERSIONED = ("solutions", "segments", "models", "evaluations", "rollouts")

Seconds = Mapping[str, Mapping[str, float]]
"""Times of stages (s) by part and stage."""


def overview_chapter(
    workspace: Workspace, parts: Sequence[Part], groups: Mapping[str, Groups], seconds: Seconds
) -> Chapter:
    """Everything that tells this study from another one."""
    blocks: list[Block] = [_parts(parts, groups), _versions(workspace, parts, groups)]
    absent = [(part.name, [*part.missing, *groups[part.name].missing]) for part in parts]
    blocks += [Missing(f"{name}: {' '.join(texts)}") for name, texts in absent if texts]
    blocks.append(_times(parts, seconds) if seconds else Missing("No stage has been timed."))
    return Chapter("What was run", blocks)


def _parts(parts: Sequence[Part], groups: Mapping[str, Groups]) -> Table:
    rows = []
    for part in parts:
        config = part.config
        rows.append(
            Row(
                [
                    part.name,
                    in_words(changes(parts[0].config, config)),
                    settings_digest(config),
                    part.dataset_id,
                    ", ".join(map(str, config.training.latent)),
                    ", ".join(map(str, config.training.seeds)),
                    len(part.model_ids),
                    len(part.evaluation_ids),
                    config.evaluation.rollouts,
                    str(config.evaluation.seed),
                ],
                [part.dataset_id],
            )
        )
    return Table(
        "parts",
        "The configurations of the study. The digest is that of all settings but the cluster's.",
        [
            "part",
            "changes",
            "digest",
            "data set",
            "n",
            "training seeds",
            "models",
            "evaluations",
            "rollouts each",
            "seed of courses",
        ],
        rows,
    )


def _versions(workspace: Workspace, parts: Sequence[Part], groups: Mapping[str, Groups]) -> Table:
    lake = workspace.lake
    ids = [each for part in parts for each in part.evaluation_ids]
    rolled = sorted(
        {row["code_version"] for g in groups.values() for each in g.every for row in each.members}
    )
    solved = _codes(workspace, "solutions", "dataset_id", [part.dataset_id for part in parts])
    trained = _codes(workspace, "models", "model_id", [m for part in parts for m in part.model_ids])
    versions = [f"{name} {lake.version(name)}" for name in VERSIONED if lake.exists(name)]
    rows = [
        Row(["code that solved", ", ".join(solved) or None]),
        Row(["code that trained", ", ".join(trained) or None]),
        Row(["code that evaluated", ", ".join(rolled) or None], ids),
        Row(["code that wrote this page", code_version()]),
        Row(["versions of tables", ", ".join(versions)]),
    ]
    return Table("versions", "Versions of code and data.", ["what", "version"], rows)


def _codes(workspace: Workspace, table: str, column: str, ids: Sequence[str]) -> list[str]:
    if not ids or not workspace.lake.exists(table):
        return []
    where = f"{column} IN ({', '.join(repr(each) for each in dict.fromkeys(ids))})"
    return sorted(set(map(str, workspace.lake.values(table, "code_version", where))))


def _times(parts: Sequence[Part], seconds: Seconds) -> Table:
    stages = list(dict.fromkeys(stage for each in seconds.values() for stage in each))
    names = [part.name for part in parts if part.name in seconds]
    rows = [
        Row([name, *(seconds[name].get(s) for s in stages), sum(seconds[name].values())])
        for name in names
    ]
    total = [sum(seconds[name].get(s, 0.0) for name in names) for s in stages]
    rows.append(Row(["all", *total, sum(total)]))
    return Table(
        "stages",
        "Time of each stage in seconds, of all runs that these settings took. What was there "
        "already takes none.",
        ["part", *stages, "all"],
        rows,
    )
