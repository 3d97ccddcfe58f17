"""The images of the cluster's roles: built once for each commit."""

import os
import re
from collections.abc import Mapping

from compose_client import HERE, ToolError, output, run

ROOT = HERE.parent
NAMES = {
    "node": "LMTR_NODE_IMAGE",
    "tracking": "LMTR_TRACKING_IMAGE",
    "database": "LMTR_DATABASE_IMAGE",
}
"""Variables that name the image of each role; Compose's file has the same defaults."""

BUILD_ARGUMENTS = ("BASE_IMAGE", "TORCH_INDEX")
"""What may be set in the environment for a machine that reaches no registry or index."""

REVISION = '{{index .Config.Labels "org.opencontainers.image.revision"}}'


def image_of(role: str, settings: Mapping[str, str]) -> str:
    """The name of a role's image."""
    return settings.get(NAMES[role]) or f"lmtr-{role}:{version()}"


def require_image(docker: str, role: str, settings: Mapping[str, str]) -> None:
    """Build a role's image, unless it is of this very code.

    Raises:
        ToolError: It cannot be built.
    """
    image, revision = image_of(role, settings), _revision()
    if not revision.endswith(".dirty") and _revision_of(docker, image) == revision:
        return
    print(f"cluster: building {image}", flush=True)
    arguments = {"VERSION": version(), "COMMIT": revision}
    arguments |= {name: os.environ[name] for name in BUILD_ARGUMENTS if name in os.environ}
    command = [docker, "build", "--file", str(HERE / "Dockerfile"), "--target", role]
    command += [part for pair in arguments.items() for part in ("--build-arg", "=".join(pair))]
    if authority := os.environ.get("BUILD_CA"):
        command += ["--secret", f"id=ca,src={authority}"]
    run([*command, "--tag", image, str(ROOT)], {**os.environ, "DOCKER_BUILDKIT": "1"})


def version() -> str:
    """That of the code."""
    text = (ROOT / "lmtr" / "__init__.py").read_text(encoding="utf-8")
    found = re.search(r'^__version__ = "([^"]+)"', text, re.MULTILINE)
    assert found is not None, "lmtr/__init__.py has no version"
    return found[1]


def _revision_of(docker: str, image: str) -> str | None:
    """The commit that an image was made of; None if there is no such image."""
    try:
        return output([docker, "image", "inspect", "--format", REVISION, image]).strip()
    except ToolError:
        return None


def _revision() -> str:
    """The commit that is checked out, marked if there are changes; empty outside of a checkout."""
    git = ["git", "-C", str(ROOT)]
    try:
        commit = output([*git, "rev-parse", "--short=12", "HEAD"]).strip()
        changed = output([*git, "status", "--porcelain", "--untracked-files=no"]).strip()
    except (ToolError, OSError):
        return ""
    return f"{commit}.dirty" if changed else commit
