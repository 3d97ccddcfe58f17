"""Object stores: what is refused before any work is done, and how it is said."""

import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.request import Request
from uuid import uuid4

import pytest
from s3_servers import (
    BUCKET,
    DIRECT,
    S3Server,
    always_answering,
    dropping_conditions,
    moto_server,
    never_answering,
)
from web import free_port

from services.errors import LakeError, StoreError
from services.home import Home
from services.lake.storage import Storage
from services.lake.tables import Lake
from services.objects import access as access_module
from services.objects import probe
from services.objects import store as store_module
from services.objects.access import Access
from services.objects.address import Address, is_address
from services.objects.store import ObjectStore


@pytest.fixture
def store(moto, reach, prefix):
    reach(moto)
    return ObjectStore(Access.from_environment(Address(BUCKET, prefix)))


def test_objects_are_read_written_and_listed(store, moto, prefix):
    assert store.get("a/b") is None
    assert store.first_keys() == []
    assert store.put_new("a/b", b"1")
    assert not store.put_new("a/b", b"2")
    assert store.get("a/b") == b"1"
    store.put("a/b", b"3")
    assert moto.objects(prefix) == {f"{prefix}/a/b": b"3"}
    assert store.first_keys() == ["a/b"]


def test_a_store_that_keeps_writers_apart_is_asked_once_and_leaves_no_litter(store, moto, prefix):
    for _ in range(2):
        probe.require_conditional_writes(store.access)
    assert set(moto.objects(prefix)) == {f"{prefix}/{probe.KEY}"}
    assert probe.round_trip_seconds(store.access) > 0.0


@pytest.mark.slow
def test_a_real_store_lets_one_of_many_writers_win(radosgw, reach, prefix):
    """Fifty races of eight writers for one object."""
    reach(radosgw)
    store = ObjectStore(Access.from_environment(Address(BUCKET, prefix)))
    with ThreadPoolExecutor(8) as writers:
        for race in range(50):
            won = list(writers.map(lambda k, r=race: store.put_new(f"{r}", b"%d" % k), range(8)))
            assert sum(won) == 1
            assert store.get(f"{race}") == b"%d" % won.index(True)


def test_a_store_that_overwrites_is_refused_before_anything_is_made(moto, reach, prefix, datasets):
    with dropping_conditions(moto) as loose:
        reach(loose)
        said = r"If-None-Match: \*\), so two writers would overwrite one another's commits; use"
        with pytest.raises(StoreError, match=said):
            Home.open(f"s3://{BUCKET}/{prefix}", create=True)
        with pytest.raises(StoreError, match=said):
            Lake(f"s3://{BUCKET}/{prefix}/lake").append(
                "datasets", datasets(["a"]), app_id="x", number=1
            )
    assert set(moto.objects(prefix)) == {f"{prefix}/lake/{probe.KEY}"}


def test_a_home_that_moved_behind_a_careless_gateway_is_refused_for_writing(moto, reach, prefix):
    place = f"s3://{BUCKET}/{prefix}"
    reach(moto)
    Home.open(place, create=True)
    with dropping_conditions(moto) as loose:
        reach(loose)
        home = Home.open(place, create=False)
        with pytest.raises(StoreError, match="honours conditional writes"):
            home.require_writable()


PLAIN = {"Content-Type": "text/plain"}


def open_home(server: S3Server, reach, bucket: str = BUCKET) -> str:
    """What is said of a home on a server that does not serve."""
    reach(server)
    with pytest.raises(StoreError) as caught:
        Home.open(f"s3://{bucket}/home", create=True)
    assert "\n" not in str(caught.value)
    assert server.endpoint in str(caught.value)
    return str(caught.value)


def test_a_missing_bucket_is_named(moto, reach):
    said = open_home(moto, reach, "no-such-bucket")
    assert "s3://no-such-bucket/home" in said
    assert "the bucket does not exist; make it, or correct the address" in said


def test_refused_credentials_are_named_and_not_shown(reach):
    with moto_server() as server:
        # From now on moto wants a signature by a key that it has given out.
        DIRECT.open(Request(f"{server.endpoint}/moto-api/reset-auth", b"0", PLAIN)).close()
        said = open_home(server, reach)
    assert "the credentials are refused; correct AWS_ACCESS_KEY_ID, AWS_SECRET" in said
    assert server.environment["AWS_SECRET_ACCESS_KEY"] not in said


@pytest.mark.parametrize(
    ("status", "code", "said"),
    [
        (403, "AccessDenied", "access is denied; allow these credentials to list, read and write"),
        (403, "SignatureDoesNotMatch", "the credentials are refused"),
        (400, "ExpiredToken", "the credentials are refused; correct .*AWS_SESSION_TOKEN"),
        (301, "PermanentRedirect", "in another region; set AWS_REGION to the bucket's region"),
        (400, "AuthorizationHeaderMalformed", "in another region; set AWS_REGION"),
        (503, "SlowDown", "overloaded or out of order; run the same command again later"),
        (418, "Teapot", "418 .*Teapot.*; check the store and the address"),
    ],
)
def test_a_stores_refusals_are_told_apart(reach, status, code, said):
    with always_answering(status, code) as server:
        assert re.search(said, open_home(server, reach))


def test_a_store_that_is_not_there_is_given_up(reach):
    server = S3Server(f"http://127.0.0.1:{free_port()}")
    assert "the store does not answer; check AWS_ENDPOINT_URL" in open_home(server, reach)


def test_a_store_that_says_nothing_is_given_up(reach, monkeypatch):
    monkeypatch.setattr(store_module, "REQUEST", store_module.timedelta(seconds=1))
    with never_answering() as server:
        assert "the store does not answer; check AWS_ENDPOINT_URL" in open_home(server, reach)


def test_a_lake_whose_store_went_away_says_so_in_one_line(reach, prefix, monkeypatch):
    monkeypatch.setattr(access_module, "RETRIES", 1)
    reach(S3Server(f"http://127.0.0.1:{free_port()}"))
    with pytest.raises(
        LakeError,
        match=r"^table 'datasets' cannot be read: the store does not answer; check [^\n]*$",
    ):
        Lake(f"s3://{BUCKET}/{prefix}").read("datasets")


ADDRESS = Address("bucket", "home")
PAIR = {"AWS_ACCESS_KEY_ID": "k", "AWS_SECRET_ACCESS_KEY": "s"}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"AWS_ENDPOINT_URL": "http://host"}, "there are no credentials; set AWS_ACCESS_KEY_ID"),
        ({"AWS_ACCESS_KEY_ID": "k"}, "AWS_SECRET_ACCESS_KEY is not set and its fellow is"),
        ({"AWS_ENDPOINT_URL": "host:9000", **PAIR}, "must be the URL of a store, got 'host:9000'"),
        (
            {"AWS_ENDPOINT_URL": "http://host", "AWS_ALLOW_HTTP": "false", **PAIR},
            "not encrypted, and AWS_ALLOW_HTTP forbids that; use an https endpoint",
        ),
    ],
)
def test_a_wrong_environment_is_refused_without_asking_the_store(given, said):
    with pytest.raises(StoreError, match=said):
        Access.from_environment(ADDRESS, given)


def test_the_environment_says_how_a_store_is_reached():
    given = {
        "AWS_ENDPOINT_URL": "https://elsewhere",
        "AWS_ENDPOINT_URL_S3": "http://store:9000/",
        "AWS_DEFAULT_REGION": "eu-west-1",
        "AWS_SESSION_TOKEN": "t",
        **PAIR,
    }
    access = Access.from_environment(ADDRESS, given)
    options = access.lake_options
    assert (access.endpoint, access.region) == ("http://store:9000", "eu-west-1")
    assert options["AWS_ALLOW_HTTP"] == "true"
    assert options["AWS_CONDITIONAL_PUT"] == "etag"
    assert options["AWS_SESSION_TOKEN"] == "t"
    assert "'s'" not in repr(access)
    # Amazon's own machines get their credentials without variables.
    amazon = Access.from_environment(ADDRESS, {"AWS_REGION": "us-west-2"})
    assert amazon.endpoint is None
    assert amazon.lake_options["AWS_ALLOW_HTTP"] == "false"


def test_no_variable_switches_the_protection_off(monkeypatch, moto, reach, prefix, datasets):
    """Two makers of the same version of a table: the second is refused by the store."""
    from deltalake import CommitProperties, DeltaTable, write_deltalake
    from deltalake.exceptions import CommitFailedError

    reach(moto)
    monkeypatch.setenv("AWS_S3_ALLOW_UNSAFE_RENAME", "true")
    monkeypatch.setenv("AWS_CONDITIONAL_PUT", "disabled")
    lake = Lake(f"s3://{BUCKET}/{prefix}")
    lake.append("datasets", datasets(["a"]), app_id="x", number=1)
    stale = [lake.delta("datasets") for _ in range(2)]
    once = CommitProperties(max_commit_retries=0)
    write_deltalake(stale[0], datasets(["b"]), mode="append", commit_properties=once)
    with pytest.raises(CommitFailedError):
        write_deltalake(stale[1], datasets(["c"]), mode="append", commit_properties=once)
    options = Storage.at(lake.storage.root).options
    found = DeltaTable(lake.uri("datasets"), storage_options=options).to_pyarrow_table()
    assert sorted(found["dataset_id"].to_pylist()) == ["a", "b"]


@pytest.mark.parametrize("text", ["s3://b", "s3://", "s3://under score/x", "s3://bucket/a b"])
def test_a_wrong_address_is_refused(text):
    with pytest.raises(StoreError, match="address"):
        Address.parse(text)


@pytest.mark.parametrize("text", ["s3://bucket/../x", "s3://bucket/a//b", "s3://bucket/a%20b"])
def test_a_prefix_that_clients_would_read_in_two_ways_is_refused(text):
    with pytest.raises(StoreError, match="choose another prefix"):
        Address.parse(text)


def test_addresses_and_folders_are_told_apart():
    assert is_address("s3://bucket/home")
    assert not is_address("homes/mine")
    assert not is_address(Path("/homes/s3:/x"))
    for taken_for_a_folder in (Path("s3://bucket/home"), "gs://bucket/home", "file:///homes"):
        with pytest.raises(StoreError, match="must be a folder or begin with s3://"):
            is_address(taken_for_a_folder)
    assert str(Address.parse(f"s3://bucket/a/{uuid4().hex}/")).count("/") == 4
    assert str(Address.parse("s3://bucket/") / "lake") == "s3://bucket/lake"
