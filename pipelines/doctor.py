"""A look over the installation: what is there, what is compiled, what can be reached."""

import os
import platform
import shutil
import sys
from collections.abc import Callable, Iterator
from importlib import import_module, metadata
from pathlib import Path

from lmtr import __version__
from lmtr.expert.shared_library import c_compiler
from pipelines.checkup.finding import Finding, healthy, show
from pipelines.config import Configuration
from pipelines.expert_cache import cache_fault, compiled_sizes
from pipelines.provenance import code_version
from pipelines.sections import ClusterSection
from pipelines.workspace import Workspace
from services.cache import machine_cache
from services.cluster import Cluster
from services.companion import companion_folder
from services.errors import ServiceError
from services.home import Home
from services.objects.access import Access
from services.objects.address import Address, is_address
from services.objects.probe import round_trip_seconds

LIBRARIES = (
    ("casadi", "casadi"),
    ("torch", "torch"),
    ("ray", "ray"),
    ("mlflow-skinny", "mlflow"),
    ("duckdb", "duckdb"),
    ("deltalake", "deltalake"),
    ("obstore", "obstore"),
    ("pyarrow", "pyarrow"),
)
"""Distribution and module of what the stages cannot do without."""

LOW_DISK_GB = 5.0

SLOW_STORE_S = 0.3


def examine(place: str, config: Configuration, *, form_json: bool = False) -> bool:
    """Print the findings for the home at ``place``; returns whether nothing fatal was found."""
    findings = [finding for look in _LOOKS for finding in look(place, config.cluster)]
    show(f"LMTR {__version__}", findings, form_json=form_json)
    return healthy(findings)


def _interpreter(_: str, __: ClusterSection) -> Iterator[Finding]:
    yield Finding("python", f"{platform.python_version()} at {sys.executable}")
    yield Finding("code", code_version())


def _libraries(_: str, __: ClusterSection) -> Iterator[Finding]:
    for distribution, module in LIBRARIES:
        try:
            import_module(module)
            yield Finding(module, metadata.version(distribution))
        except (ImportError, metadata.PackageNotFoundError) as error:
            yield Finding(
                module, f"cannot be imported: {error}", "install again: make install", fatal=True
            )


def _machine(place: str, _: ClusterSection) -> Iterator[Finding]:
    yield Finding("cores", str(os.cpu_count()))
    root = _local_folder(place)
    present = next(folder for folder in (root, *root.absolute().parents) if folder.exists())
    free = shutil.disk_usage(present).free / 1e9
    low = free < LOW_DISK_GB
    yield Finding("free disk", f"{free:.1f} GB", "make room: runs may fail half-way" if low else "")
    ffmpeg = shutil.which("ffmpeg")
    yield Finding("ffmpeg", ffmpeg or "none", "" if ffmpeg else "install it for mp4 (gif works)")


def _expert(_: str, cluster: ClusterSection) -> Iterator[Finding]:
    compiler = c_compiler()
    yield Finding(
        "C compiler",
        compiler or "none",
        "" if compiler else "install gcc: without it the expert takes four times as long",
    )
    folder = machine_cache(cluster.cache)
    built = compiled_sizes(folder)
    mend = cache_fault(folder)
    state = f"{len(built)} ({sum(built) / 1e6:.1f} MB)" if built else "none yet"
    yield Finding("compiled experts", f"{state} in {folder}", mend)


def _cluster(_: str, cluster: ClusterSection) -> Iterator[Finding]:
    if cluster.address is None:
        yield Finding("Ray cluster", "none named: one is started on this machine for each stage")
        return
    try:
        with Cluster.connect(address=cluster.address, workers=None):
            yield Finding("Ray cluster", f"{cluster.address} answers")
    except ServiceError as error:
        yield Finding("Ray cluster", str(error), "mend the address, or start it", fatal=True)


def _home(place: str, cluster: ClusterSection) -> Iterator[Finding]:
    try:
        if not is_address(place) and not Path(place).exists():
            yield Finding("home", f"{place} is not there yet", "make one: lmtr run demo")
            return
        workspace = Workspace.open(place, cluster, create=False)
        yield Finding("home", workspace.home.name)
        yield from _object_store(workspace.home)
        lake = workspace.lake
        for name in lake.tables():
            rows = lake.query_value(f'SELECT count(*) FROM "{name}"')
            yield Finding(f"table {name}", f"{rows} rows, version {lake.version(name)}")
        if workspace.home.shared_tracker or workspace.home.tracking_db.exists():
            workspace.tracker.experiment("training")
            yield Finding("MLflow", f"{workspace.home.tracking_uri} answers")
    except ServiceError as error:
        yield Finding("home", str(error), "mend this first", fatal=True)


def _object_store(home: Home) -> Iterator[Finding]:
    """What only a home in an object store has."""
    if home.access is None:
        return
    yield Finding("companion folder", str(home.root))
    seconds = round_trip_seconds(home.access)
    slow = seconds > SLOW_STORE_S
    yield Finding(
        "object store",
        f"{home.access.endpoint or 'Amazon S3'}, region {home.access.region}: answers in "
        f"{seconds * 1e3:.0f} ms",
        "use a store that is nearer: a commit takes several requests" if slow else "",
    )
    home.require_writable()
    yield Finding("conditional writes", "honoured")


def _local_folder(place: str) -> Path:
    """Folder on this machine that a home fills; of a wrong address, which others report, this."""
    try:
        if is_address(place):
            return companion_folder(Access.from_environment(Address.parse(place)))
    except ServiceError:
        return Path()
    return Path(place)


_LOOKS: tuple[Callable[[str, ClusterSection], Iterator[Finding]], ...] = (
    _interpreter,
    _libraries,
    _machine,
    _expert,
    _cluster,
    _home,
)
