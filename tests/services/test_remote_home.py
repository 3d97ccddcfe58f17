"""A home in an object store: known by its marker there, with a companion folder on each machine."""

import json

import pytest
from s3_servers import BUCKET

from services.companion import companion_folder
from services.errors import HomeError, StoreError
from services.home import Home
from services.models import ModelStore
from services.objects.access import Access
from services.objects.address import Address


@pytest.fixture
def place(moto, reach, prefix) -> str:
    reach(moto)
    return f"s3://{BUCKET}/{prefix}"


@pytest.fixture
def put(moto, prefix):
    """Puts an object below the prefix, as somebody else would."""
    return lambda key, body: moto.client().put_object(
        Bucket=BUCKET, Key=f"{prefix}/{key}", Body=body
    )


def test_a_home_is_made_once_and_found_again(place, moto, prefix):
    made = Home.open(place, create=True)
    assert Home.open(f"{place}/", create=False) == made == Home.open(place, create=True)
    marker = moto.objects(prefix)[f"{prefix}/home.json"]
    assert json.loads(marker) == {"application": "lmtr", "version": 1}
    assert made.name == place
    assert made.lake == f"{place}/lake"


def test_reading_where_there_is_no_home_makes_nothing(place, moto, prefix):
    with pytest.raises(HomeError, match=f"no LMTR home at {place}; make one with `lmtr run demo`"):
        Home.open(place, create=False)
    assert moto.objects(prefix) == {}


@pytest.mark.parametrize("create", [True, False])
@pytest.mark.parametrize("key", ["thesis.tex", "lake/datasets/_delta_log/0.json"])
def test_a_foreign_prefix_is_never_claimed(place, put, moto, prefix, create, key):
    put(key, b"")
    with pytest.raises(HomeError, match=f"'{key}'.*choose an empty or a new folder"):
        Home.open(place, create=create)
    assert set(moto.objects(prefix)) == {f"{prefix}/{key}"}


def test_neighbours_with_a_longer_name_are_no_part_of_a_prefix(place, put, moto, prefix):
    moto.client().put_object(Bucket=BUCKET, Key=f"{prefix}-old/x", Body=b"")
    Home.open(place, create=True)


@pytest.mark.parametrize("marker", [b"", b"[1]", b'{"application": "other", "version": 1}'])
def test_a_marker_of_something_else_is_refused(place, put, marker):
    put("home.json", marker)
    with pytest.raises(HomeError, match=r"home\.json is not LMTR's"):
        Home.open(place, create=True)


@pytest.mark.parametrize("create", [True, False])
def test_a_newer_version_is_refused_and_kept(place, put, moto, prefix, create):
    newer = b'{"application": "lmtr", "version": 2}'
    put("home.json", newer)
    with pytest.raises(HomeError, match="of version 2, this LMTR knows versions up to 1"):
        Home.open(place, create=create)
    assert moto.objects(prefix)[f"{prefix}/home.json"] == newer


def test_what_needs_a_file_system_lies_in_the_companion_folder(place, tmp_path):
    home = Home.open(place, create=True)
    assert home.root.is_dir()
    assert home.root.parent == tmp_path / "state"
    local = (home.tracking_db, home.artifacts, home.models, home.reports)
    assert all(path.is_relative_to(home.root) for path in local)
    assert home.tracking_uri == f"sqlite:///{home.root}/mlflow.db"
    with home.lock("generate-a"), pytest.raises(HomeError, match=f"home {place}: process"):
        home.lock("generate-a").__enter__()


def test_every_home_has_a_companion_of_its_own(monkeypatch, tmp_path):
    def at(prefix: str, endpoint: str | None = None) -> Access:
        return Access(Address("bucket", prefix), endpoint, "us-east-1")

    given = {"LMTR_STATE": str(tmp_path)}
    folders = {
        companion_folder(access, given)
        for access in (at("a-b"), at("a/b"), at("a-b", "http://x"), at("a-b", "http://y"))
    }
    assert len(folders) == 4
    assert all(folder.name.startswith("bucket-a-b-") for folder in folders)
    assert companion_folder(at("a-b"), given) in folders
    monkeypatch.setenv("HOME", "/homes/me")
    usual = companion_folder(at("a"), {"XDG_STATE_HOME": "relative"})
    assert str(usual.parent) == "/homes/me/.local/state/lmtr"
    assert str(companion_folder(at("a"), {"XDG_STATE_HOME": "/s"}).parent) == "/s/lmtr"


def test_a_companion_that_cannot_be_made_says_where_to_put_it(place, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("LMTR_STATE", str(tmp_path / "file"))
    with pytest.raises(HomeError, match="cannot be made: Not a directory; name another place with"):
        Home.open(place, create=True)


def test_a_named_tracker_takes_the_place_of_the_local_file(place, tmp_path, monkeypatch):
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://tracker:5000")
    assert Home.open(place, create=True).tracking_uri == "http://tracker:5000"
    # A home in a folder keeps its own.
    folder = Home.open(tmp_path / "home", create=True)
    assert folder.tracking_uri == f"sqlite:///{folder.root}/mlflow.db"


def test_the_tracker_of_a_cluster_is_that_of_all_homes(place, tmp_path, monkeypatch):
    monkeypatch.setenv("LMTR_TRACKING", "http://cluster:5000")
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://tracker:5000")
    for home in (place, tmp_path / "home"):
        assert Home.open(home, create=True).tracking_uri == "http://cluster:5000"


@pytest.fixture
def machines(place, tmp_path, monkeypatch):
    """The models of one home as two machines see them, one with a model of two files."""

    def machine(name: str) -> ModelStore:
        monkeypatch.setenv("LMTR_STATE", str(tmp_path / name))
        return ModelStore(Home.open(place, create=True))

    here, there = machine("here"), machine("there")
    here.folder("m").mkdir(parents=True)
    (here.folder("m") / "weights").write_bytes(bytes(range(256)) * 1000)
    (here.folder("m") / "model.json").write_text("{}")
    return here, there


def test_a_model_reaches_other_machines_whole(machines):
    here, there = machines
    assert not there.fetched("m").exists()
    here.publish("m")
    folder = there.fetched("m")
    assert folder != here.folder("m")
    assert {p.name: p.read_bytes() for p in folder.iterdir()} == {
        p.name: p.read_bytes() for p in here.folder("m").iterdir()
    }
    assert [path.name for path in folder.parent.iterdir()] == ["m"]


def test_half_an_upload_is_not_taken_for_a_model(machines, put):
    _, there = machines
    put("models/m/model.json", b"{}")
    put("models/m/weights", b"half")
    assert not there.fetched("m").exists()


def test_a_model_that_was_damaged_in_the_store_is_refused_by_file(machines, put):
    here, there = machines
    here.publish("m")
    put("models/m/weights", b"other")
    with pytest.raises(StoreError, match=r"model 'm' in s3://.*weights is missing or damaged"):
        there.fetched("m")
    put("models/m/whole.json", b"{")
    with pytest.raises(StoreError, match=r"whole\.json is missing or damaged"):
        there.fetched("m")
    assert not there.folder("m").exists()


@pytest.mark.parametrize("name", ["../m", "/tmp/m", "a/b", "..", ""])
def test_no_name_leads_out_of_the_folder_of_models(machines, put, tmp_path, name):
    _, there = machines
    with pytest.raises(HomeError, match="no model can be called"):
        there.fetched(name)
    before = [path for path in tmp_path.rglob("*") if path.is_file()]
    put("models/m/whole.json", json.dumps({"sha256": {name: "0" * 64}}).encode())
    with pytest.raises(StoreError, match=r"whole\.json is missing or damaged"):
        there.fetched("m")
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == before


def test_models_of_a_folder_stay_where_they_are(tmp_path):
    models = ModelStore(Home.open(tmp_path / "home", create=True))
    models.publish("m")
    assert models.fetched("m") == tmp_path / "home" / "models" / "m"
