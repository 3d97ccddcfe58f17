"""Clusters: the same work on this process, on this machine's cores or on many machines.

``cluster`` (the contract and what comes out of it) → ``worker`` (what runs in a worker process)
→ ``local`` (in this process) and ``pool``, ``ray_cluster`` (Ray, imported when it is used).
``sweep`` is what trainings are to a cluster, and ``ray_sweep`` runs them on Ray Tune.
"""

from services.cluster.cluster import Cluster, Failure, Outcome
from services.cluster.sweep import Done, Report, Sweep, Trial

__all__ = ["Cluster", "Done", "Failure", "Outcome", "Report", "Sweep", "Trial"]
