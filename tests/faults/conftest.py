"""The data set without faults that all others must equal, made once."""

from pathlib import Path

import pyarrow as pa
import pytest

from tests.faults.driver import CONFIGURATION, finish, require_complete, rows


@pytest.fixture(scope="session", autouse=True)
def machine_cache(tmp_path_factory):
    """A cache of compiled experts for all processes of these tests."""
    folder = tmp_path_factory.mktemp("machine") / "cache"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LMTR_CACHE", str(folder))
        yield folder


@pytest.fixture(scope="session")
def config(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("configuration") / "faults.toml"
    path.write_text(CONFIGURATION)
    return path


@pytest.fixture(scope="session")
def undisturbed(config, tmp_path_factory) -> Path:
    """A home with the data set as it is without faults."""
    home = tmp_path_factory.mktemp("undisturbed") / "home"
    finish(home, config)
    return home


@pytest.fixture(scope="session")
def reference(undisturbed) -> pa.Table:
    """Its rows, by index."""
    made = rows(undisturbed)
    require_complete(undisturbed, made)
    return made


@pytest.fixture
def home(tmp_path) -> Path:
    return tmp_path / "home"
