"""One process at a time replaces a table's files, and no lock stays behind."""

import pytest
from s3_servers import BUCKET, losing_an_answer

from services.errors import StoreError
from services.lake.exclusive import LOCK, holder_of, rewriting
from services.lake.storage import Storage
from services.objects.store import ObjectStore


@pytest.fixture
def storage(moto, reach, prefix):
    reach(moto)
    return Storage.at(f"s3://{BUCKET}/{prefix}")


def test_a_lock_in_a_store_keeps_others_out_until_its_holder_is_done(storage, moto, prefix):
    with rewriting(storage, "solutions") as alone:
        assert alone
        assert holder_of(storage, "solutions").startswith("process ")
        for _ in range(2):
            with rewriting(storage, "solutions") as second:
                assert not second
    assert moto.objects(prefix) == {}
    assert holder_of(storage, "solutions") == ""


def test_a_lock_whose_answer_was_lost_is_known_as_ones_own(moto, reach, prefix):
    with losing_an_answer(moto, LOCK) as gateway:
        reach(gateway)
        storage = Storage.at(f"s3://{BUCKET}/{prefix}")
        with rewriting(storage, "solutions") as alone:
            assert alone
            with rewriting(storage, "solutions") as second:
                assert not second
    assert moto.objects(prefix) == {}


def test_an_attempt_that_fails_leaves_no_lock(storage, moto, prefix, monkeypatch):
    put_new = ObjectStore.put_new

    def unanswered(self, key, content):
        put_new(self, key, content)
        raise StoreError("no answer")

    monkeypatch.setattr(ObjectStore, "put_new", unanswered)
    with pytest.raises(StoreError, match="no answer"), rewriting(storage, "solutions"):
        pass
    assert moto.objects(prefix) == {}
