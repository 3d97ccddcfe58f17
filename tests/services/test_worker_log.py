"""Warnings of workers are told once each, and by count: the log of a week stays short."""

import uuid

import pytest

from services.cluster.worker_log import MOST_KINDS, WorkerLog


def scattered(n, bits):
    """A number of so many bits, another one for each n, with digits of all kinds."""
    return n * 0x9E3779B97F4A7C15F39CC0605CEDC835 % 2**bits


@pytest.fixture
def log(caplog):
    """A log, and what the user has read of it."""
    return WorkerLog(), lambda: [record.getMessage() for record in caplog.records]


@pytest.mark.parametrize(
    "varying",
    [
        lambda n: f"at {n}",
        lambda n: f"<Solver object at {0x7F3A9C0D1E00 + 16 * n:#x}>",
        lambda n: f"at 0X{0xABCDE + n:X}",
        lambda n: (
            f"request {uuid.UUID(int=n * 0x9E3779B97F4A7C15F39CC0605CEDC834 % 2**128)} failed"
        ),
        lambda n: f"task_{n * 0x9E3779B97F4A7C15 % 2**64 | 1 << 63:016x}01 is late",
    ],
)
def test_messages_that_differ_in_numbers_and_ids_alone_are_told_once(log, varying):
    worker_log, read = log
    worker_log.tell(tuple(map(varying, range(1, 1001))))
    worker_log.close()
    first, again = read()
    assert first == f"a worker says: {varying(1)}"
    assert again.startswith("workers said 999 times more: ")


def test_words_are_no_ids(log):
    worker_log, read = log
    worker_log.tell(("the facade", "the decade", "a defaced accede", "a defaced effaced"))
    assert len(read()) == 4


def test_after_many_kinds_further_ones_are_only_counted(log):
    worker_log, read = log
    lines = tuple(f"{'x' * n}!" for n in range(10 * MOST_KINDS))
    worker_log.tell(lines)
    worker_log.tell((*lines[:5], *lines[-7:]))
    assert len(read()) == MOST_KINDS + 1
    assert read()[-1].endswith("further kinds are only counted")
    worker_log.close()
    told = read()[MOST_KINDS + 1 :]
    assert [line for line in told if "further kinds" in line] == [
        f"workers gave {9 * MOST_KINDS + 7} warnings of further kinds"
    ]
    assert len(told) == 6
    worker_log.close()
    assert len(read()) == MOST_KINDS + 7
