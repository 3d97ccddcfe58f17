"""The machines of a Ray cluster, as its head knows them."""

from collections.abc import Mapping
from datetime import UTC, datetime

from pydantic import BaseModel, ConfigDict, Field

from services.cluster.head import Head

ALIVE = "ALIVE"


class Node(BaseModel):
    """A machine, or a container.

    Attributes:
        node_id: Ray's id of it.
        name: Its name or address.
        ip: Its address.
        is_head: Whether the head runs on it.
        state: ``ALIVE`` or ``DEAD``.
        state_message: Why it is dead.
        resources: What it offers, by name: processors, bytes of memory.
        used: What jobs have asked for of that; none if the cluster does not tell.
        start_time_ms: When it joined (ms since 1970).
        end_time_ms: When it died (ms since 1970), 0 while it lives.
    """

    model_config = ConfigDict(frozen=True, extra="ignore", populate_by_name=True)

    node_id: str
    name: str = Field("", validation_alias="node_name")
    ip: str = Field("", validation_alias="node_ip")
    is_head: bool = Field(False, validation_alias="is_head_node")
    state: str
    state_message: str | None = None
    resources: dict[str, float] = Field(default_factory=dict, validation_alias="resources_total")
    used: dict[str, float] | None = None
    start_time_ms: int = 0
    end_time_ms: int = 0

    @property
    def alive(self) -> bool:
        """Whether it works."""
        return self.state == ALIVE

    @property
    def since(self) -> datetime:
        """When it joined, or died."""
        return datetime.fromtimestamp((self.end_time_ms or self.start_time_ms) / 1e3, UTC)


def nodes(head: Head) -> list[Node]:
    """The machines that the cluster has or had, the head first and the dead last.

    Raises:
        ClusterError: The cluster does not answer.
    """
    listed = head.get("/api/v0/nodes?detail=1&limit=1000")["data"]["result"]["result"]
    used = _used(head)
    found = [Node.model_validate({**each, "used": used.get(each["node_id"])}) for each in listed]
    return sorted(found, key=lambda node: (not node.alive, not node.is_head, node.start_time_ms))


def _used(head: Head) -> Mapping[str, Mapping[str, float]]:
    """What is asked for on each machine, by id; empty until the cluster tells."""
    status = (head.get("/api/cluster_status")["data"] or {}).get("clusterStatus")
    report = status.get("loadMetricsReport") if isinstance(status, dict) else None
    by_node = (report or {}).get("usageByNode") or {}
    return {
        node: {name: amounts[0] for name, amounts in usage.items()}
        for node, usage in by_node.items()
    }
