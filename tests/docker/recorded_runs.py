"""What a run that MLflow's server has told of holds, by key."""

from typing import Any


def tags(run: dict[str, Any]) -> dict[str, str]:
    """What it is found by."""
    return _by_key(run, "tags")


def params(run: dict[str, Any]) -> dict[str, str]:
    """What was chosen for it."""
    return _by_key(run, "params")


def metrics(run: dict[str, Any]) -> dict[str, float]:
    """Its figures, as they were at last."""
    return _by_key(run, "metrics")


def _by_key(run: dict[str, Any], kind: str) -> dict[str, Any]:
    """A run without any has no such list."""
    return {each["key"]: each["value"] for each in run["data"].get(kind, [])}
