"""The job of ``lmtr doctor --cluster``, on the cluster's head: ask, look, print one line."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack

from pydantic import ValidationError

from pipelines.checkup import machine
from pipelines.checkup.home import examined_home, examined_tracker
from pipelines.checkup.report import ClusterReport, MachineReport, NodeReport
from pipelines.remote.versions import Versions
from services.cluster import Cluster
from services.errors import ServiceError
from services.objects.address import is_address

NODES_S = 15.0
"""How long nodes may take to start a process and tell what they have (s)."""


def say_report(place: str) -> str:
    """What the job prints.

    Args:
        place: The home that jobs are to have, a folder or an address; empty if none is named.
    """
    return examined_cluster(place).model_dump_json()


def examined_cluster(place: str) -> ClusterReport:
    """Look at home and tracker from here, and ask every node what it has."""
    with ExitStack() as stack, ThreadPoolExecutor() as pool:
        looked = pool.submit(stack.enter_context, examined_home(place))
        tracker = pool.submit(examined_tracker, place)
        # A store may take long to be given up, and nodes are not asked about it.
        mark = "" if is_address(place) else looked.result()[1]
        nodes: Sequence[NodeReport] = ()
        fault = ""
        try:
            nodes = _nodes(mark)
        except ServiceError as error:
            fault = str(error)
        return ClusterReport(
            versions=Versions.here(),
            nodes=tuple(nodes),
            home=looked.result()[0],
            tracker=tracker.result(),
            fault=fault,
        )


def _nodes(mark: str) -> list[NodeReport]:
    with Cluster.connect(address="auto", workers=None):
        from services.cluster.inquiry import Reply, ask_everywhere

        def reported(reply: Reply) -> NodeReport:
            place, told, error = reply.place, None, reply.error
            try:
                told = None if error else MachineReport.model_validate_json(reply.answer)
            except ValidationError:
                error = "its LMTR tells other things than this one's"
            return NodeReport(
                name=place.name,
                address=place.address,
                is_head=place.is_head,
                offered=place.resources.get("CPU", 0.0),
                store=place.resources.get("object_store_memory", 0.0),
                offset=reply.offset,
                machine=told,
                error=error,
            )

        replies = ask_everywhere(machine.__name__, machine.told.__name__, mark, NODES_S)
        return [reported(reply) for reply in replies]
