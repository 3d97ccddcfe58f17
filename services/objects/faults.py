"""What went wrong at a store, out of the words of its client: a cause and a mend, in one line."""

import re
from typing import NamedTuple


class Fault(NamedTuple):
    """A cause, and what to do about it."""

    cause: str
    mend: str


_SIGNS: tuple[tuple[str, Fault], ...] = (
    (
        # These are asked for only where no other credentials are found.
        r"/latest/api/token|/latest/meta-data|169\.254\.169\.254|credential provider|"
        r"NoCredentials|no credentials",
        Fault(
            "there are no credentials",
            "set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY",
        ),
    ),
    (
        r"NoSuchBucket",
        Fault("the bucket does not exist", "make it, or correct the address"),
    ),
    (
        r"PermanentRedirect|AuthorizationHeaderMalformed|redirect without LOCATION|"
        r"IllegalLocationConstraint|301 Moved",
        Fault("the bucket is in another region", "set AWS_REGION to the bucket's region"),
    ),
    (
        r"InvalidAccessKeyId|SignatureDoesNotMatch|InvalidToken|ExpiredToken|InvalidClientTokenId|"
        r"UnrecognizedClient|AuthFailure|401 Unauthorized",
        Fault(
            "the credentials are refused",
            "correct AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and AWS_SESSION_TOKEN",
        ),
    ),
    (
        r"AccessDenied|403 Forbidden|necessary privileges",
        Fault(
            "access is denied",
            "allow these credentials to list, read and write there (docs/object-storage.md)",
        ),
    ),
    (
        r"SlowDown|503 Service|500 Internal|502 Bad",
        Fault("the store is overloaded or out of order", "run the same command again later"),
    ),
    (
        r"error sending request|timed out|connection (closed|reset|refused)|dns error|tcp connect",
        Fault("the store does not answer", "check AWS_ENDPOINT_URL and the network"),
    ),
)

_FRAMES = re.compile(r"\n\s*(stack backtrace:|0: ).*", re.DOTALL)
"""Where in the client's own program an error came up; it comes after what the error is."""

_COLOUR = re.compile(r"\x1b\[[0-9;]*m")

_LONGEST = 300


def fault(error: BaseException) -> Fault | None:
    """What an error of a client of object stores means; None if it is not known."""
    text = _words(error)
    return next((meaning for sign, meaning in _SIGNS if re.search(sign, text)), None)


def plain(error: BaseException) -> str:
    """An error's own words in one line, without colours and the client's inner state."""
    line = " ".join(_words(error).replace("↳", ":").split())
    return line if len(line) <= _LONGEST else f"{line[: _LONGEST - 1]}…"


def _words(error: BaseException) -> str:
    """What the client says, without its inner state, in which every word may occur."""
    return _FRAMES.sub("", _COLOUR.sub("", str(error))).partition("Debug source")[0]
