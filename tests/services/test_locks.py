"""Locks of a home: who holds them, alone or with others."""

import os

import pytest

from services.locks import Holder, LockHeldError, Locks


@pytest.fixture
def locks(tmp_path):
    return Locks(tmp_path / "locks")


def test_holders_are_named_while_they_hold(locks):
    assert locks.holders() == []
    with locks.held("b"), locks.held("a", shared=True):
        assert locks.holders() == [Holder("a"), Holder("b", str(os.getpid()))]
    assert locks.holders() == []


def test_a_shared_lock_is_held_by_many_and_keeps_one_alone_out(locks):
    with locks.held("train", shared=True), locks.held("train", shared=True):
        with pytest.raises(LockHeldError, match="another process"), locks.held("train"):
            pytest.fail("the lock was given twice")
        assert locks.holders() == [Holder("train")]
    with locks.held("train"), pytest.raises(LockHeldError, match=f"process {os.getpid()}"):
        locks.held("train", shared=True).__enter__()


def test_whoever_may_only_read_sees_holders_too(locks):
    with locks.held("a"):
        (locks.folder / "a.lock").chmod(0o444)
        assert [each.lock for each in locks.holders()] == ["a"]
