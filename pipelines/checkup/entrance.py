"""Whether a cluster is reached from here, lets us in, and keeps others out."""

import ipaddress
import stat
from collections.abc import Iterator
from importlib import metadata
from urllib.parse import urlsplit

from pipelines.checkup.finding import Finding
from pipelines.remote.target import Target
from services.cluster.head import Head
from services.cluster.jobs import Jobs
from services.cluster.token import Token
from services.errors import ClusterRefusedError, ServiceError
from services.tracking.server import look_at_server

ANSWER_S = 10.0
"""How long the head may take to answer a simple question (s)."""

LISTING = "/api/jobs/"
"""Whoever may list jobs may send some."""


def examined_entrance(target: Target) -> Iterator[Finding]:
    """Knock without the token, then with it; the last finding is fatal where that led nowhere."""
    head = Head(target.url, target.jobs.head.token, ANSWER_S)
    named = f" (profile {target.profile!r})" if target.profile else ""
    try:
        closed = _refuses_strangers(head.url)
        yield Finding("cluster", f"{head.url}{named} answers")
        yield from judged_secrecy(head.url, head.token, closed=closed)
        ray_version = Jobs(head).ray_version()
        head.get(LISTING)
    except ClusterRefusedError as error:
        yield Finding.of("token", error)
        return
    except ServiceError as error:
        yield Finding.of("cluster", error)
        return
    if head.token is None:
        yield Finding("token", "none is wanted")
    else:
        state = "taken" if closed else "not asked for"
        yield Finding("token", f"that from {head.token.source} is {state}, Ray {ray_version}")


def examined_tracking(uri: str) -> Finding:
    """Look at the MLflow server of a profile from here."""
    try:
        server = look_at_server(uri)
    except ServiceError as error:
        return Finding.of("MLflow from here", error)
    ours = metadata.version("mlflow-skinny")
    other = f", MLflow {server.version} where this client has {ours}"
    return Finding(
        "MLflow from here",
        f"{uri} answers" + (f", MLflow {ours}" if server.version == ours else other),
        "" if server.version == ours else "install the server's version here, or ours there",
    )


def judged_secrecy(url: str, token: Token | None, *, closed: bool) -> Iterator[Finding]:
    """Who else may use the cluster, or learn how.

    Args:
        url: Address of its dashboard.
        token: The token of this client.
        closed: Whether it refuses who has no token.
    """
    if closed:
        yield Finding("strangers", "refused: no token, no answer")
    else:
        yield Finding(
            "strangers",
            "let in without a token: whoever reaches this port can run any program there",
            "start every node with RAY_AUTH_MODE=token and RAY_AUTH_TOKEN_PATH (docs/cluster.md)",
        )
    if token is None:
        return
    if urlsplit(url).scheme == "http" and not _is_this_machine(url):
        yield Finding(
            "encryption",
            "none: the token can be read on its way to the cluster",
            "put TLS in front and use https, or a tunnel: ssh -L 8265:localhost:8265 HEAD",
        )
    if token.file is not None:
        mode = stat.S_IMODE(token.file.stat().st_mode)
        if mode & (stat.S_IRWXG | stat.S_IRWXO):
            yield Finding(
                "token file",
                f"{token.file} is open to other users of this machine (mode {mode:04o})",
                f"chmod 600 {token.file}",
            )


def _refuses_strangers(url: str) -> bool:
    """Whether a request without a token is refused.

    Raises:
        ServiceError: Nothing answers, or what answers is no dashboard.
    """
    try:
        Head(url, None, ANSWER_S).get(LISTING)
    except ClusterRefusedError:
        return True
    return False


def _is_this_machine(url: str) -> bool:
    host = urlsplit(url).hostname or ""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
