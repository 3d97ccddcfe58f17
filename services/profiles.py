"""The user's settings file: named profiles of clusters, so that commands stay short.

profile = "local"                # the profile of cluster commands that name none

[profiles.local]
cluster = "http://127.0.0.1:8265"
token_file = "/path/to/ray_token"
tracking = "http://127.0.0.1:5000"
home = "/data/home"
"""

import difflib
import os
import stat
import tomllib
from collections.abc import Mapping
from pathlib import Path, PurePosixPath

from pydantic import BaseModel, ConfigDict, ValidationError, field_validator

from services.cluster.url import checked_url
from services.errors import ProfileError, StoreError
from services.objects.address import Address, is_address

FILE_VARIABLE = "LMTR_SETTINGS"
"""Environment variable that names the settings file."""

PROFILE_VARIABLE = "LMTR_PROFILE"
"""Environment variable that names the profile."""


class Profile(BaseModel):
    """A cluster, and what a client needs to know of it.

    Attributes:
        cluster: Address of the head's dashboard.
        token_file: File with the cluster's token; none leaves it to ``RAY_AUTH_TOKEN`` and
            ``RAY_AUTH_TOKEN_PATH``.
        tracking: Address of the MLflow server.
        home: The home as the cluster's machines see it: an absolute folder, or an address; none
            leaves it to their ``LMTR_HOME``.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    cluster: str
    token_file: Path | None = None
    tracking: str | None = None
    home: str | None = None

    @field_validator("cluster", "tracking")
    @classmethod
    def _address(cls, url: str | None) -> str | None:
        return None if url is None else checked_url(url)

    @field_validator("token_file")
    @classmethod
    def _from_everywhere(cls, file: Path | None) -> Path | None:
        if file is not None and not file.expanduser().is_absolute():
            raise ValueError(f"must be an absolute path, got {str(file)!r}; begin it with / or ~")
        return None if file is None else file.expanduser()

    @field_validator("home")
    @classmethod
    def _on_the_cluster(cls, home: str | None) -> str | None:
        return None if home is None else cluster_home(home)


class UserSettings(BaseModel):
    """All of the settings file.

    Attributes:
        profile: Name of the profile that cluster commands take by default.
        profiles: Profiles by name.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    profile: str | None = None
    profiles: dict[str, Profile] = {}


def cluster_home(place: str) -> str:
    """A home that another machine shall open.

    Raises:
        ValueError: It is a relative folder, or no address.
    """
    try:
        if is_address(place):
            return str(Address.parse(place))
    except StoreError as error:
        raise ValueError(str(error)) from error
    if not PurePosixPath(place).is_absolute():
        raise ValueError(
            f"must be an absolute folder or s3://bucket/prefix as the cluster's machines see it, "
            f"got {place!r}; begin it with /"
        )
    return place


def settings_file(environment: Mapping[str, str] | None = None) -> Path:
    """``LMTR_SETTINGS``, else ``lmtr/settings.toml`` in the user's folder of settings."""
    given = os.environ if environment is None else environment
    if given.get(FILE_VARIABLE):
        return Path(given[FILE_VARIABLE]).expanduser().absolute()
    standard = given.get("XDG_CONFIG_HOME", "")
    folder = Path(standard) if os.path.isabs(standard) else Path("~/.config").expanduser()
    return folder / "lmtr" / "settings.toml"


def load_settings(file: Path) -> UserSettings:
    """Read and check a settings file; one that is not there is empty.

    Raises:
        ProfileError: It cannot be read, all users of the machine may write it, it is no TOML, or
            holds a wrong or unknown setting.
    """
    try:
        mode = file.stat().st_mode
        if stat.S_ISREG(mode) and mode & stat.S_IWOTH:
            raise ProfileError(
                f"settings {file}: all users of this machine may write it, and could have your "
                f"token sent to them; forbid it with `chmod o-w {file}`"
            )
        tree = tomllib.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return UserSettings()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is no UTF-8 text"
        raise ProfileError(
            f"settings {file} cannot be read ({reason}); mend its permissions, or name another "
            f"file in {FILE_VARIABLE}"
        ) from error
    except tomllib.TOMLDecodeError as error:
        raise ProfileError(f"settings {file}: no valid TOML: {error}; mend that line") from error
    try:
        return UserSettings.model_validate(tree)
    except ValidationError as error:
        raise ProfileError(f"settings {file}: {_explain(error)}") from error


def find_profile(
    name: str | None = None, environment: Mapping[str, str] | None = None
) -> tuple[str, Profile] | None:
    """The profile of this name, of ``LMTR_PROFILE``, or the file's own; None if none is named.

    Raises:
        ProfileError: The settings file is wrong, or has no such profile.
    """
    given = os.environ if environment is None else environment
    file = settings_file(given)
    settings = load_settings(file)
    wanted = name or given.get(PROFILE_VARIABLE) or settings.profile
    if wanted is None:
        return None
    if wanted not in settings.profiles:
        known = ", ".join(settings.profiles)
        mend = f"choose one of: {known}" if known else f"write a table [profiles.{wanted}]"
        raise ProfileError(f"profile {wanted!r} is not in {file}; {mend}")
    return wanted, settings.profiles[wanted]


def _explain(error: ValidationError) -> str:
    """One line for the first fault."""
    first = error.errors(include_url=False)[0]
    path = ".".join(map(str, first["loc"]))
    if first["type"] == "missing":
        return f"{path} is missing; add it"
    if first["type"] == "extra_forbidden":
        fields = Profile if len(first["loc"]) > 1 else UserSettings
        near = difflib.get_close_matches(str(first["loc"][-1]), fields.model_fields, n=1)
        mend = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(fields.model_fields)}"
        return f"unknown key {path!r}; {mend}"
    if first["type"] == "value_error":
        return f"{path}: {first['msg'].removeprefix('Value error, ')}"
    return f"{path}: {first['msg']}, got {first['input']!r}; correct it"
