"""What every stage works with: the home, its lake, models and tracker, and the cluster."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from pipelines.sections import ClusterSection
from services.cluster import Cluster
from services.home import Home
from services.lake.tables import Lake
from services.models import ModelStore
from services.tracking import Tracker


@dataclass(frozen=True)
class Workspace:
    """A home and the services that run on it.

    Attributes:
        home: The place that holds everything.
        cluster_settings: Where work is sent.
    """

    home: Home
    cluster_settings: ClusterSection

    @classmethod
    def open(
        cls, place: Path | str, cluster_settings: ClusterSection | None = None, *, create: bool
    ) -> "Workspace":
        """Open the home at a folder or address, or make it where ``create`` allows."""
        return cls(Home.open(place, create=create), cluster_settings or ClusterSection())

    @cached_property
    def lake(self) -> Lake:
        """The lakehouse of the home."""
        return Lake(self.home.lake)

    @cached_property
    def models(self) -> ModelStore:
        """The folders of the home's trained models."""
        return ModelStore(self.home)

    @cached_property
    def tracker(self) -> Tracker:
        """The experiment tracker of the home."""
        home = self.home
        return Tracker(home.tracking_uri, home.artifacts, home.name if home.shared_tracker else "")

    def cluster(self, items: int, few: int = 0) -> Cluster:
        """A cluster for ``items`` pieces of work; use it in a ``with`` statement.

        Up to ``few`` pieces are worked on in this process, unless the user names workers.
        """
        settings = self.cluster_settings
        workers = settings.workers
        if workers is None and items <= few:
            workers = 0
        if workers is not None:
            workers = min(workers, max(items, 1))
        return Cluster.connect(address=settings.address, workers=workers)
