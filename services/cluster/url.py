"""Addresses of web services, as users write them."""

from urllib.parse import urlsplit

SCHEMES = ("http", "https")


def checked_url(text: str) -> str:
    """The address ``http(s)://HOST[:PORT]`` without a slash at its end.

    Raises:
        ValueError: It is none; says what is wrong with it and how to mend that.
    """
    try:
        parts = urlsplit(text.strip())
        port = parts.port
    except ValueError as error:
        raise ValueError(f"{error}; write http://HOST:PORT") from error
    if parts.scheme not in SCHEMES or not parts.hostname:
        raise ValueError("must be an address like http://HOST:8265; correct it")
    if parts.username is not None or parts.password is not None:
        raise ValueError("must hold no name or password; put a token into a file instead")
    if parts.path.strip("/") or parts.query or parts.fragment:
        raise ValueError("must end after the port; drop the rest")
    host = f"[{parts.hostname}]" if ":" in parts.hostname else parts.hostname
    return f"{parts.scheme}://{host}" + ("" if port is None else f":{port}")
