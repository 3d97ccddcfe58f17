"""What a cluster tells of itself, as the one line of JSON that the job prints.

Every field has a default: an LMTR of another version on some node may tell more or less.
"""

from pydantic import BaseModel, ConfigDict

from pipelines.remote.versions import Versions
from services.cluster.clock import Offset
from services.machine import Room


class Told(BaseModel):
    """A part of a report."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class MachineReport(Told):
    """What a node's own process tells.

    Attributes:
        versions: What it runs, and its ``LMTR_HOME``.
        processors: What it may use at once.
        memory_free: Bytes; None if unknown.
        shared: Memory that processes share; None where it is no file system.
        temporary: Room for temporary files.
        cache: Room where compiled experts are kept.
        compiler: Path of the C compiler; empty for none.
        cache_fault: Why nothing can be compiled into the cache, and the mend; empty if it can.
        compiled: How many compiled experts the cache holds.
        unset: Variables that notice lost nodes, and are not set.
        sees_home: Whether it sees what the head has put into the home; None if that is not asked.
    """

    versions: Versions
    processors: float = 1.0
    memory_free: int | None = None
    shared: Room | None = None
    temporary: Room | None = None
    cache: Room | None = None
    compiler: str = ""
    cache_fault: str = ""
    compiled: int = 0
    unset: tuple[str, ...] = ()
    sees_home: bool | None = None


class NodeReport(Told):
    """A node that Ray takes for alive.

    Attributes:
        name: Its name.
        address: Its address.
        is_head: Whether the head runs on it.
        offered: Processors that it offers to Ray.
        store: Bytes that Ray wants to share between processes.
        offset: Of its clock from that of the head's job.
        machine: What it tells; None if it does not answer.
        error: Why it does not.
    """

    name: str
    address: str
    is_head: bool = False
    offered: float = 0.0
    store: float = 0.0
    offset: Offset | None = None
    machine: MachineReport | None = None
    error: str = ""

    @property
    def label(self) -> str:
        """What people call it."""
        named = self.address if self.name in ("", self.address) else f"{self.name} {self.address}"
        return f"{named} (head)" if self.is_head else named


class HomeReport(Told):
    """The home as the head's machine has it.

    Attributes:
        place: Folder or address; empty if none is named.
        known: Whether it is there already; the first job makes it else.
        remote: Whether it is in an object store.
        fault: Why jobs cannot use it, and the mend; empty if they can.
        room: Of a folder, on its disk.
        seconds: Of an object store, to read one small object.
    """

    place: str = ""
    known: bool = False
    remote: bool = False
    fault: str = ""
    room: Room | None = None
    seconds: float | None = None


class TrackerReport(Told):
    """The tracker as the head's machine sees it.

    Attributes:
        uri: Its address, without passwords; empty where the home has its own.
        is_server: Whether it is an MLflow server.
        version: Of that server.
        client: Version of MLflow on the head's machine.
        fault: Why it cannot be used, and the mend; empty if it can.
    """

    uri: str = ""
    is_server: bool = False
    version: str = ""
    client: str = ""
    fault: str = ""


class ClusterReport(Told):
    """All of it.

    Attributes:
        versions: Of the ``lmtr`` that jobs run.
        nodes: All that live, the head first.
        home: Where jobs would keep what they make.
        tracker: Where they would record it.
        fault: Why the cluster's nodes could not be asked, and the mend.
    """

    versions: Versions
    nodes: tuple[NodeReport, ...] = ()
    home: HomeReport = HomeReport()
    tracker: TrackerReport = TrackerReport()
    fault: str = ""
