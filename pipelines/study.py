"""A study: one configuration, and variants of it that change a few settings each.

A file may end with tables ``[[variants]]``. Each has a name and sections of settings that differ
from those of the file; whatever they leave out is as it stands above. All are checked before any
work starts, and since data sets, models and evaluations are known by what decides them, variants
share whatever they have in common.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lmtr.errors import ConfigurationError
from pipelines.config import Configuration, parse, settings_tree

BASE = "base"
"""Name of the configuration that variants vary."""

VARIANTS = "variants"


@dataclass(frozen=True)
class Study:
    """Configurations that are carried out and compared together.

    Attributes:
        name: Of the built-in configuration, or of its file without the ending.
        configurations: By name: ``base``, and then the variants in the order of the file.
    """

    name: str
    configurations: Mapping[str, Configuration]

    @property
    def base(self) -> Configuration:
        """What the variants vary."""
        return self.configurations[BASE]

    @property
    def variants(self) -> Mapping[str, Configuration]:
        """The others, by name."""
        return {name: each for name, each in self.configurations.items() if name != BASE}


def load_study(source: str | None, overrides: Sequence[str] = ()) -> Study:
    """Read and check a configuration with all of its variants.

    Args:
        source: A built-in name, the path of a TOML file, or None for the defaults.
        overrides: ``section.key=value`` with the value in TOML; they hold for variants too, where
            these do not set the same key.

    Raises:
        ConfigurationError: The file is missing or no TOML, a setting is unknown or wrong, or a
            variant has no name of its own.
    """
    tree = settings_tree(source, overrides)
    differing = tree.pop(VARIANTS, [])
    configurations = {BASE: parse(tree)}
    for name, changes in _named(differing):
        if name in configurations:
            raise ConfigurationError(
                f"configuration: variants need names of their own, got {name!r} twice; rename one"
            )
        try:
            configurations[name] = parse(_merged(tree, changes))
        except ConfigurationError as error:
            raise ConfigurationError(f"variant {name!r}: {error}") from error
    return Study("default" if source is None else Path(source).stem, configurations)


def load_variant(
    source: str | None, overrides: Sequence[str], variant: str | None
) -> Configuration:
    """One configuration of a study; the base without a name.

    Raises:
        ConfigurationError: As :func:`load_study`, or there is no such variant.
    """
    study = load_study(source, overrides)
    name = BASE if variant is None else variant
    if name not in study.configurations:
        raise ConfigurationError(
            f"configuration: it has no variant {name!r}; choose one of "
            f"{', '.join(study.configurations)}"
        )
    return study.configurations[name]


def _named(differing: object) -> Iterator[tuple[str, dict[str, Any]]]:
    if not isinstance(differing, list):
        raise ConfigurationError(
            "configuration: variants must be tables, each begun with [[variants]]"
        )
    for each in differing:
        name = each.get("name") if isinstance(each, dict) else None
        if not isinstance(name, str) or not name:
            raise ConfigurationError(
                "configuration: every variant needs a name; begin it with [[variants]] and "
                'name = "…"'
            )
        yield name, {key: value for key, value in each.items() if key != "name"}


def _merged(tree: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """The settings with the changes in their places, table by table."""
    merged = dict(tree)
    for key, value in changes.items():
        below = merged.get(key)
        if isinstance(value, Mapping) and isinstance(below, Mapping):
            merged[key] = _merged(below, value)
        else:
            merged[key] = value
    return merged
