"""The head of a Ray cluster as seen from outside: its dashboard's address, with the token.

Ray's own client (``ray.job_submission``) waits for ever for a head that is silent, lets variables
of the environment replace the address that it is given, and tells what went wrong as text. So its
documented REST interface is asked directly.
"""

import asyncio
import contextlib
import json
import os
import ssl
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import dataclass
from typing import Any

import aiohttp

from services.cluster.token import Token
from services.cluster.url import checked_url
from services.errors import ClusterError, ClusterLostError, ClusterRefusedError
from services.tls import tls_fault

CONNECT_S = 5.0
"""How long the head may take to be reached at all."""

ANSWER_S = 60.0
"""How long it may take to answer; a busy one starts its first agent meanwhile."""

CHECK_IT_RUNS = "check that the cluster runs and that this is the address of its head's dashboard"

HEARTBEAT_S = 15.0
"""While a log is followed, a head that is silent for so long is given up."""


@dataclass(frozen=True)
class Answer:
    """What the head said.

    Attributes:
        status: Of HTTP.
        text: Its body.
    """

    status: int
    text: str

    @property
    def reason(self) -> str:
        """The last line, which is where Ray says what is wrong."""
        lines = [line for line in self.text.splitlines() if line.strip(" .")]
        return lines[-1].strip() if lines else f"HTTP status {self.status}"


class Head:
    """A cluster's head.

    Args:
        url: Of its dashboard, ``http://HOST:8265``.
        token: The token, if there is one.
        answer_s: How long it may take to answer (s); that of a busy one by default.

    Raises:
        ClusterError: The address is none.
    """

    def __init__(self, url: str, token: Token | None = None, answer_s: float | None = None) -> None:
        try:
            self.url = checked_url(url)
        except ValueError as error:
            raise ClusterError(f"cluster {url!r}: {error}") from error
        self.token = token
        self._answer_s = answer_s

    def ask(self, method: str, path: str, body: object = None, data: bytes | None = None) -> Answer:
        """Send a request; what Ray has to say against it is left to the caller.

        Raises:
            ClusterLostError: Nothing answers.
            ClusterRefusedError: The token is missing, or refused.
            ClusterError: What answers is no Ray dashboard.
        """
        return asyncio.run(self._ask(method, path, body, data))

    def get(self, path: str) -> Any:  # noqa: ANN401 - whatever the JSON holds
        """What is at a path.

        Raises:
            ClusterError: As :meth:`ask`, or there is nothing.
        """
        answer = self.ask("GET", path)
        if answer.status != 200:
            raise self._no_dashboard(f"{path} answers with HTTP status {answer.status}")
        return self.decoded(answer)

    def decoded(self, answer: Answer) -> Any:  # noqa: ANN401 - whatever the JSON holds
        """The answer's JSON.

        Raises:
            ClusterError: It is none.
        """
        try:
            return json.loads(answer.text)
        except ValueError as error:
            raise self._no_dashboard("its answers are no JSON") from error

    def listen(self, path: str, heard: Callable[[str], None]) -> None:
        """Hand on what comes over a web socket until it ends.

        Raises:
            ClusterError: As :meth:`ask`.
        """
        asyncio.run(self._listen(path, heard))

    async def _ask(self, method: str, path: str, body: object, data: bytes | None) -> Answer:
        limit = aiohttp.ClientTimeout(total=self._answer_s or ANSWER_S, sock_connect=CONNECT_S)
        async with self._session(limit) as session:
            sent = session.request(
                method, self.url + path, json=body, data=data, allow_redirects=False
            )
            async with sent as response:
                answer = Answer(response.status, await response.text(errors="replace"))
        self._require_admitted(answer.status)
        if 300 <= answer.status < 400:
            raise self._no_dashboard("it sends us on to another address")
        return answer

    async def _listen(self, path: str, heard: Callable[[str], None]) -> None:
        limit = aiohttp.ClientTimeout(total=None, sock_connect=CONNECT_S)
        async with self._session(limit) as session:
            try:
                socket = await session.ws_connect(self.url + path, heartbeat=HEARTBEAT_S)
            except aiohttp.WSServerHandshakeError as error:
                self._require_admitted(error.status)
                raise self._no_dashboard(
                    f"{path} answers with HTTP status {error.status}"
                ) from error
            async for message in socket:
                if message.type is aiohttp.WSMsgType.TEXT:
                    heard(message.data)

    @contextlib.asynccontextmanager
    async def _session(self, limit: aiohttp.ClientTimeout) -> AsyncIterator[aiohttp.ClientSession]:
        """A session; what goes wrong inside becomes an error of ours."""
        try:
            async with aiohttp.ClientSession(headers=self._headers, timeout=limit) as session:
                yield session
        except aiohttp.ServerDisconnectedError as error:
            raise self._silent("it hangs up") from error
        except aiohttp.ClientConnectorError as error:
            if isinstance(error.os_error, ssl.SSLError):
                raise self._silent(*tls_fault(error.os_error)) from error
            raise self._silent(_reason(error.os_error)) from error
        except TimeoutError as error:
            raise self._silent("no answer in time") from error
        except aiohttp.ClientResponseError as error:
            raise self._no_dashboard("it does not speak HTTP as Ray does") from error
        except aiohttp.ClientError as error:
            raise self._silent(str(error)) from error

    @property
    def _headers(self) -> Mapping[str, str]:
        return {} if self.token is None else {"Authorization": f"Bearer {self.token.value}"}

    def _require_admitted(self, status: int) -> None:
        if status == 401 and self.token is None:
            raise ClusterRefusedError(
                f"cluster {self.url}: it wants a token, and none is named; set token_file in the "
                "profile, or RAY_AUTH_TOKEN_PATH to a file with the token of the cluster's head"
            )
        if status in (401, 403):
            source = "none" if self.token is None else self.token.source
            raise ClusterRefusedError(
                f"cluster {self.url}: it refuses the token from {source}: a wrong one, or one of "
                "an earlier start of the cluster; copy the present one from the cluster's head"
            )

    def _silent(self, reason: str, mend: str = CHECK_IT_RUNS) -> ClusterLostError:
        return ClusterLostError(f"cluster {self.url}: it cannot be reached ({reason}); {mend}")

    def _no_dashboard(self, reason: str) -> ClusterError:
        return ClusterError(
            f"cluster {self.url}: what answers is no Ray dashboard ({reason}); give the address of "
            "the head's dashboard, port 8265 unless it was moved"
        )


def _reason(error: OSError) -> str:
    """Why no connection came about: asyncio puts addresses in the place of the system's words."""
    if error.errno is not None and error.errno > 0:
        return os.strerror(error.errno)
    return error.strerror or str(error)
