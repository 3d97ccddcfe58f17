"""The home and its tracker as jobs on this machine would have them; nothing is made for good."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib import metadata
from pathlib import Path

from pipelines.checkup.report import HomeReport, TrackerReport
from services.errors import ServiceError
from services.folder_probe import probed_folder
from services.home import Home, lake_access, shared_tracker
from services.machine import nearest, room
from services.marker import MARKER, require_unclaimed
from services.objects.access import Access
from services.objects.address import Address, is_address
from services.objects.probe import KEY, require_conditional_writes, round_trip_seconds
from services.objects.store import ObjectStore
from services.tracking import is_server
from services.tracking.server import look_at_server, shown


@contextmanager
def examined_home(place: str) -> Iterator[tuple[HomeReport, str]]:
    """Look at a home, and let other machines see whether they have the same.

    Args:
        place: Its folder or address; empty if none is named.

    Yields:
        What was found, and a folder in it that is there for the block; empty if there is none.
    """
    if not place:
        yield HomeReport(), ""
    elif is_address(place):
        yield _store(place), ""
    else:
        with _folder(Path(place)) as found:
            yield found


def examined_tracker(place: str) -> TrackerReport:
    """Look at the tracker of a home at this place.

    Args:
        place: Its folder or address; empty if none is named.
    """
    uri, client = shared_tracker(place), metadata.version("mlflow-skinny")
    report = TrackerReport(uri=shown(uri), is_server=is_server(uri), client=client)
    if not report.is_server:
        return report
    try:
        return report.model_copy(update={"version": look_at_server(uri).version})
    except ServiceError as error:
        return report.model_copy(update={"fault": str(error)})


@contextmanager
def _folder(place: Path) -> Iterator[tuple[HomeReport, str]]:
    report = HomeReport(place=str(place), known=(place / MARKER).exists(), room=room(place))
    with ExitStack() as stack:
        try:
            _require_ours(place, report.known)
            mark = str(stack.enter_context(probed_folder(nearest(place))))
        except (ServiceError, OSError) as error:
            mend = "" if isinstance(error, ServiceError) else "; mend its permissions"
            report, mark = report.model_copy(update={"fault": f"{error}{mend}"}), ""
        # Above a home that is not there yet may be the head's own disk, which says nothing.
        yield report, mark if place.is_dir() else ""


def _require_ours(place: Path, known: bool) -> None:
    """Refuse what a job would refuse, without making a home as a job would."""
    if known:
        Home.open(place, create=False)
    elif place.is_dir():
        foreign = [each.name for each in place.iterdir() if not each.name.startswith(f".{MARKER}.")]
        require_unclaimed(str(place), foreign, create=True)


def _store(place: str) -> HomeReport:
    report = HomeReport(place=place, remote=True)
    try:
        access = Access.from_environment(Address.parse(place))
        store = ObjectStore(access)
        known = store.get(MARKER) is not None
        report = report.model_copy(update={"known": known})
        if not known:
            foreign = [key for key in store.first_keys() if not key.endswith(f"/{KEY}")]
            require_unclaimed(place, foreign, create=True)
        lake = lake_access(access)
        require_conditional_writes(lake)
        return report.model_copy(update={"seconds": round_trip_seconds(lake)})
    except ServiceError as error:
        return report.model_copy(update={"fault": str(error)})
