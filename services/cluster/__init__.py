"""Clusters: the same work on this process, on this machine's cores or on many machines.

``cluster`` (the contract and what comes out of it) → ``worker`` (what runs in a worker process)
→ ``local`` (in this process) and ``pool``, ``ray_cluster`` (Ray, imported when it is used).
"""

from services.cluster.cluster import Cluster, Failure, Outcome

__all__ = ["Cluster", "Failure", "Outcome"]
