"""Which cluster a command is about, how it is entered, and where its home is."""

import shlex
from dataclasses import dataclass, replace

from services.cluster.head import Head
from services.cluster.jobs import Jobs
from services.cluster.token import Token
from services.errors import ProfileError
from services.profiles import cluster_home, find_profile, settings_file


@dataclass(frozen=True)
class Target:
    """A cluster.

    Attributes:
        jobs: Its jobs.
        home: The home as its machines see it; none leaves it to their ``LMTR_HOME``.
        options: What the user typed to choose it, for commands that are suggested.
        profile: Name of the profile that was looked at; empty for none.
        tracking: Address of the MLflow server that the profile names.
    """

    jobs: Jobs
    home: str | None
    options: tuple[str, ...] = ()
    profile: str = ""
    tracking: str | None = None

    @property
    def url(self) -> str:
        """Its address."""
        return self.jobs.head.url

    def command(self, *words: str) -> str:
        """``lmtr …`` for this cluster, as a user may type it."""
        return shlex.join(["lmtr", *words, *self.options])


def find_target(
    profile: str | None = None, cluster: str | None = None, home: str | None = None
) -> Target:
    """The cluster that the options name, else the profile of the user's settings.

    An address that is typed goes without the token of a profile that is not: a token must not be
    sent to another cluster by mistake.

    Args:
        profile: Name of a profile, if one was typed.
        cluster: Address of a cluster's dashboard, if one was typed.
        home: The home as the cluster's machines see it, if one was typed.

    Raises:
        ProfileError: No cluster is named, or the profile is wrong or missing.
        ClusterError: The address is wrong, or the token cannot be read.
    """
    typed = {"--profile": profile, "--cluster": cluster}
    options = tuple(word for pair in typed.items() if pair[1] for word in pair if word)
    found = None if cluster is not None and profile is None else find_profile(profile)
    if found is not None:
        name, known = found
        token = Token.find(known.token_file)
        chosen = _target(cluster or known.cluster, token, home or known.home, options)
        return replace(chosen, profile=name, tracking=known.tracking)
    if cluster is not None:
        return _target(cluster, Token.find(), home, options)
    raise ProfileError(
        f"no cluster is named; give --cluster http://HOST:8265, or a --profile of {settings_file()}"
    )


def _target(url: str, token: Token | None, home: str | None, options: tuple[str, ...]) -> Target:
    there = None if home is None else _checked(home)
    return Target(Jobs(Head(url, token)), there, options)


def _checked(home: str) -> str:
    try:
        return cluster_home(home)
    except ValueError as error:
        raise ProfileError(f"home {home!r} of a job: {error}") from error
