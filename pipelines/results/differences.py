"""What a variant of a study changes, in words, and which variants vary one parameter alone."""

from collections.abc import Mapping, Sequence
from typing import Any

from pipelines.config import Configuration
from pipelines.results.parts import Part

KAPPA = "training.model.kappa"
AMOUNT = frozenset(
    {
        "training.segments",
        "segmentation.epochs_per_solution",
        "segmentation.goals_per_epoch",
        "dataset.solutions",
    }
)
"""Settings that decide how many segments there are, and nothing else."""

ASIDE = ("cluster.", "evaluation.", "training.latent", "training.seeds", "dataset.name")
"""Settings that say which models there are and how they are compared, not what they are."""


def changes(base: Configuration, other: Configuration) -> dict[str, Any]:
    """Settings of another configuration that differ from the base, by dotted name."""
    before, after = (_flat(each.model_dump(mode="json")) for each in (base, other))
    return {
        key: after.get(key)
        for key in sorted(before.keys() | after.keys())
        if before.get(key) != after.get(key) and not key.startswith(ASIDE)
    }


def in_words(changed: Mapping[str, Any]) -> str:
    """The changes as a reader of the configuration would write them."""
    return "; ".join(f"{key} = {_value(value)}" for key, value in changed.items()) or "–"


def varied(parts: Sequence[Part], keys: frozenset[str]) -> list[Part]:
    """The base, which is first, and the variants that change nothing but some of ``keys``."""
    base, *others = parts
    changed = {part.name: changes(base.config, part.config).keys() for part in others}
    return [base, *(part for part in others if changed[part.name] and changed[part.name] <= keys)]


def otherwise_varied(parts: Sequence[Part]) -> list[Part]:
    """The variants that are neither of a sweep over κ nor of one over the amount of data."""
    swept = {part.name for keys in (frozenset({KAPPA}), AMOUNT) for part in varied(parts, keys)}
    return [part for part in parts if part.name not in swept]


def _flat(tree: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in tree.items():
        if isinstance(value, Mapping) and value:
            flat |= _flat(value, f"{above}{key}.")
        else:
            flat[f"{above}{key}"] = value
    return flat


def _value(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(map(_value, value))
    if isinstance(value, bool):
        return "on" if value else "off"
    return "all" if value is None else str(value)
