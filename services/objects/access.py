"""How an object store is reached, read from the environment variables that all S3 tools share."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from urllib.parse import urlsplit

from services.errors import StoreError
from services.objects.address import Address

DEFAULT_REGION = "us-east-1"
"""What stores other than Amazon's take for their region."""

KEYS = ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY")

GRANTED = (
    "AWS_WEB_IDENTITY_TOKEN_FILE",
    "AWS_CONTAINER_CREDENTIALS_RELATIVE_URI",
    "AWS_CONTAINER_CREDENTIALS_FULL_URI",
)
"""Variables by which a cluster grants credentials that the client fetches and renews by itself."""

PASSED = ("AWS_SESSION_TOKEN", "AWS_VIRTUAL_HOSTED_STYLE_REQUEST")

CONNECT_SECONDS = 5
REQUEST_SECONDS = 60
RETRIES = 8
RETRY_SECONDS = 45
"""How long one request of the lake may take, and how long a store that fails is asked again."""


@dataclass(frozen=True)
class Access:
    """What it takes to reach one address.

    Attributes:
        address: The place.
        endpoint: URL of the store; None for Amazon's own.
        region: The bucket's region.
        secrets: Credentials and other variables that are passed on, by their names.
    """

    address: Address
    endpoint: str | None
    region: str
    secrets: tuple[tuple[str, str], ...] = field(default=(), repr=False)

    @classmethod
    def from_environment(
        cls, address: Address, environment: Mapping[str, str] | None = None
    ) -> "Access":
        """Read ``AWS_ENDPOINT_URL``, ``AWS_REGION`` and the credentials.

        Args:
            address: The place.
            environment: The variables; those of this process by default.

        Raises:
            StoreError: They contradict one another, or a store of one's own has no credentials.
        """
        given = {
            name: value
            for name, value in (os.environ if environment is None else environment).items()
            if value
        }
        endpoint = given.get("AWS_ENDPOINT_URL_S3") or given.get("AWS_ENDPOINT_URL")
        if endpoint is not None:
            endpoint = endpoint.rstrip("/")
            _require_endpoint(endpoint, given)
        _require_credentials(address, endpoint, given)
        region = given.get("AWS_REGION") or given.get("AWS_DEFAULT_REGION") or DEFAULT_REGION
        secrets = tuple((name, given[name]) for name in (*KEYS, *PASSED) if name in given)
        return cls(address, endpoint, region, secrets)

    @property
    def settings(self) -> dict[str, str]:
        """The settings that name the store and us, for any client built on ``object_store``."""
        settings = dict(self.secrets) | {
            "AWS_REGION": self.region,
            # Two writers of one version of a table are told apart by this alone.
            "AWS_CONDITIONAL_PUT": "etag",
        }
        if self.endpoint is not None:
            settings["AWS_ENDPOINT_URL"] = self.endpoint
        return settings

    @property
    def allows_http(self) -> bool:
        """Whether requests go unencrypted: only where the endpoint says so itself."""
        return self.endpoint is not None and self.endpoint.startswith("http://")

    @property
    def lake_options(self) -> dict[str, str]:
        """All options of delta-rs."""
        return self.settings | {
            "AWS_ALLOW_HTTP": str(self.allows_http).lower(),
            # A variable of this name would switch the protection off.
            "AWS_S3_ALLOW_UNSAFE_RENAME": "false",
            "connect_timeout": f"{CONNECT_SECONDS}s",
            "timeout": f"{REQUEST_SECONDS}s",
            "max_retries": str(RETRIES),
            "retry_timeout": f"{RETRY_SECONDS}s",
        }

    def __str__(self) -> str:
        return f"{self.address}" + (f" at {self.endpoint}" if self.endpoint else "")


def _require_endpoint(endpoint: str, given: Mapping[str, str]) -> None:
    parts = urlsplit(endpoint)
    if parts.scheme not in ("http", "https") or not parts.hostname:
        raise StoreError(
            f"AWS_ENDPOINT_URL: must be the URL of a store, got {endpoint!r}; set it to "
            "https://HOST[:PORT]"
        )
    if parts.scheme == "http" and given.get("AWS_ALLOW_HTTP", "").lower() in ("false", "0", "no"):
        raise StoreError(
            f"AWS_ENDPOINT_URL: {endpoint} is not encrypted, and AWS_ALLOW_HTTP forbids that; "
            "use an https endpoint, or unset AWS_ALLOW_HTTP"
        )


def _require_credentials(address: Address, endpoint: str | None, given: Mapping[str, str]) -> None:
    missing = [name for name in KEYS if name not in given]
    if len(missing) == 1:
        raise StoreError(f"{address}: {missing[0]} is not set and its fellow is; set both")
    # Amazon's own machines are given theirs without any variable.
    granted = endpoint is None or any(name in given for name in GRANTED)
    if missing and not granted:
        raise StoreError(
            f"{address} at {endpoint}: there are no credentials; set {' and '.join(KEYS)}"
        )
