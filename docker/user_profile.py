"""The profile by which `lmtr submit` and its fellows find the cluster, in the user's settings."""

import json
import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

NAME = "local"


def settings_file() -> Path:
    """``LMTR_SETTINGS``, else ``lmtr/settings.toml`` in the user's folder of settings."""
    if named := os.environ.get("LMTR_SETTINGS"):
        return Path(named).expanduser().absolute()
    standard = os.environ.get("XDG_CONFIG_HOME", "")
    folder = Path(standard) if os.path.isabs(standard) else Path("~/.config").expanduser()
    return folder / "lmtr" / "settings.toml"


def write_profile(file: Path, values: Mapping[str, str], name: str = NAME) -> bool:
    """Set a profile in a settings file, whose other lines stay as they are.

    Returns:
        Whether it is the profile of commands that name none; where the file named no such profile,
        this one becomes it.

    Raises:
        ValueError: The file is no TOML.
    """
    text = file.read_text(encoding="utf-8") if file.exists() else ""
    before = _parsed(file, text)
    block = "".join(f"{key} = {json.dumps(value)}\n" for key, value in values.items())
    section = f"[profiles.{name}]\n{block}"
    present = re.compile(
        rf"^\[profiles\.{re.escape(name)}\][^\n]*\n(?:(?!\[)[^\n]*\n?)*", re.MULTILINE
    )
    if present.search(text):
        text = present.sub(lambda _: section + "\n", text).rstrip("\n") + "\n"
    else:
        text = f"{text.rstrip()}\n\n{section}".lstrip("\n")
    if "profile" not in before:
        text = f'profile = "{name}"\n\n{text}'
    after = _parsed(file, text)
    if after["profiles"][name] != dict(values):
        raise ValueError(f"settings {file}: the profile {name!r} cannot be set; remove it there")
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_name(f".{file.name}.{os.getpid()}")
    partial.write_text(text, encoding="utf-8")
    os.replace(partial, file)
    return bool(after["profile"] == name)


def _parsed(file: Path, text: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"settings {file}: no valid TOML: {error}; mend that line") from error
