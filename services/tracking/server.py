"""An MLflow server, looked at: is it there, does its database answer, which version is it."""

import os
import re
import ssl
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit, urlunsplit

from services.errors import TrackingError
from services.tls import tls_fault
from services.tracking.page import QUIET

ANSWER_S = 5.0
"""How long it may take to be reached, and to answer (s)."""

ASK_DATABASE = "/api/2.0/mlflow/experiments/search?max_results=1"
"""A question that the server must ask its database."""


VERSION = re.compile(r"\d+\.\d[\w.+-]*")


@dataclass(frozen=True)
class Server:
    """A server that answers.

    Attributes:
        version: Of its MLflow.
        seconds: Time of the question to its database (s).
    """

    version: str
    seconds: float


def look_at_server(uri: str) -> Server:
    """Ask a server for its version and something of its database, entered as MLflow's client does.

    Args:
        uri: ``http(s)://HOST[:PORT]``.

    Raises:
        TrackingError: It cannot be reached, refuses us, is something else, or its database fails.
    """
    version = _asked(uri, "/version")
    if not VERSION.fullmatch(version.text.strip()):
        raise _fault(uri, "what answers is no MLflow server", "give the address of MLflow's server")
    began = time.perf_counter()
    answer = _asked(uri, ASK_DATABASE)
    if answer.status_code != 200:
        raise _fault(
            uri,
            f"its database does not answer (HTTP status {answer.status_code})",
            "look at the log of the MLflow server and of its database",
        )
    return Server(version.text.strip(), time.perf_counter() - began)


def shown(uri: str) -> str:
    """The address for people, without a password that may be in it."""
    parts = urlsplit(uri)
    if parts.password is None:
        return uri
    return urlunsplit(parts._replace(netloc=f"…@{parts.netloc.rpartition('@')[2]}"))


def _asked(uri: str, path: str) -> Any:  # noqa: ANN401 - MLflow has no types
    for name, value in QUIET.items():
        os.environ.setdefault(name, value)
    from mlflow.exceptions import MlflowException
    from mlflow.utils.credentials import get_default_host_creds
    from mlflow.utils.rest_utils import http_request

    try:
        answer = http_request(
            *(get_default_host_creds(uri), path, "GET"),
            **{"timeout": ANSWER_S, "max_retries": 0, "raise_on_status": False},
        )
    except (MlflowException, OSError) as error:
        cause, mend = _reason(error)
        raise _fault(uri, f"it cannot be reached ({cause})", mend) from error
    if answer.status_code == 403 and "host" in answer.text.lower():
        raise _fault(
            uri,
            "it does not let itself be called by this name",
            "add the name to the server's --allowed-hosts",
        )
    if answer.status_code in (401, 403):
        raise _fault(
            uri,
            "it refuses us",
            "set MLFLOW_TRACKING_USERNAME and MLFLOW_TRACKING_PASSWORD, or MLFLOW_TRACKING_TOKEN",
        )
    return answer


def _fault(uri: str, cause: str, mend: str) -> TrackingError:
    return TrackingError(f"MLflow at {shown(uri)}: {cause}; {mend}")


def _reason(error: BaseException) -> tuple[str, str]:
    """The innermost cause that is one of the system's, in its words, and the mend."""
    mend = "check that the MLflow server runs and that this is its address"
    for inner in _causes(error):
        if isinstance(inner, ssl.SSLError):
            return tls_fault(inner)
        if isinstance(inner, OSError) and inner.errno is not None and inner.strerror:
            return inner.strerror, mend
    return "no answer in time" if "timed out" in str(error) else str(error)[:200], mend


def _causes(error: BaseException) -> Iterator[BaseException]:
    """The error and what it came of, as Python and as urllib3 keep that."""
    seen: list[BaseException] = []
    waiting: list[object] = [error]
    while waiting:
        each = waiting.pop()
        if not isinstance(each, BaseException) or any(each is known for known in seen):
            continue
        seen.append(each)
        waiting += [each.__context__, each.__cause__, getattr(each, "reason", None), *each.args]
    yield from reversed(seen)
