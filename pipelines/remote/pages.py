"""The pages of a cluster: where MLflow shows its runs, and Ray what it does."""

from pipelines.progress import say
from pipelines.remote.target import Target
from services.errors import ProfileError
from services.profiles import settings_file
from services.tracking.server import look_at_server

RUNS = "/#/experiments?workflowType=machine_learning"
"""Without the last part MLflow opens on its pages for language models."""


def show_pages(target: Target) -> None:
    """Say where the pages of a cluster are, once its MLflow server has answered.

    Raises:
        ProfileError: No profile names the server.
        TrackingError: It cannot be reached, refuses us, or is something else.
    """
    if target.tracking is None:
        wanted = f"[profiles.{target.profile}]" if target.profile else "a profile"
        raise ProfileError(
            f"cluster {target.url}: where its MLflow server is cannot be told; write tracking = "
            f'"http://HOST:5000" into {wanted} of {settings_file()}'
        )
    server = look_at_server(target.tracking)
    of = f"profile {target.profile}" if target.profile else f"cluster {target.url}"
    say(f"MLflow {server.version} of {of}: {target.tracking}{RUNS}")
    token = target.jobs.head.token
    asks = f" (paste the token into its page: {token.source})" if token is not None else ""
    say(f"Ray's dashboard: {target.url}/#/jobs{asks}")
