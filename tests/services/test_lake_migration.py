"""Tables of an older schema version: refused with the mend, migrated once, readable throughout."""

from concurrent.futures import ThreadPoolExecutor

import pyarrow as pa
import pytest
from deltalake import DeltaTable, write_deltalake

from services.errors import LakeError
from services.lake.inspection import inspect_table
from services.lake.migration import migrate, outdated
from services.lake.schemas import ADDED, SCHEMAS

NEW = ("saturated", "digest")


@pytest.fixture
def old(lake, solutions):
    """A lake whose solutions 0 to 3 were written by an LMTR of schema version 1."""
    schema = pa.schema([field for field in SCHEMAS["solutions"] if field.name not in NEW])
    (lake.storage.folder / "solutions").mkdir(parents=True)
    DeltaTable.create(
        lake.uri("solutions"),
        schema,
        configuration={"lmtr.schemaVersion": "1", "delta.enableExpiredLogCleanup": "false"},
        raise_if_key_not_exists=False,
    )
    rows = solutions([0, 1, 2, 3]).select(schema.names).cast(schema)
    write_deltalake(lake.uri("solutions"), rows, mode="append")
    return lake


def test_what_versions_added_may_be_null():
    for table, versions in ADDED.items():
        for names in versions.values():
            assert all(SCHEMAS[table].field(name).nullable for name in names)


def test_an_older_table_is_refused_with_the_command_that_mends_it(old, solutions):
    said = r"^table 'solutions' is of schema version 1, .* with `lmtr lake migrate`$"
    with pytest.raises(LakeError, match=said):
        old.read("solutions")
    with pytest.raises(LakeError, match=said):
        old.append("solutions", solutions([4]), app_id="x", number=1)


def test_a_migrated_table_keeps_its_rows_and_takes_new_ones(old, solutions):
    assert outdated(old, "solutions") == "1"
    assert migrate(old, "solutions") == list(NEW)
    assert outdated(old, "solutions") is None
    rows = old.read("solutions", order_by="index")
    assert rows.schema.equals(SCHEMAS["solutions"])
    assert rows["index"].to_pylist() == [0, 1, 2, 3]
    assert rows["digest"].null_count == rows["saturated"].null_count == 4
    old.append("solutions", solutions([4]), app_id="x", number=1)
    found = inspect_table(old, "solutions")
    assert (found.findings, found.rows, found.undigested) == ([], 5, 4)


def test_versions_from_before_a_migration_read_with_nulls(old):
    before = old.opened("solutions").version()
    migrate(old, "solutions")
    rows = old.read("solutions", version=before, order_by="index")
    assert rows.schema.equals(SCHEMAS["solutions"])
    assert (rows.num_rows, rows["digest"].null_count) == (4, 4)
    assert old.read("solutions", where="digest IS NULL", version=before).num_rows == 4


def test_a_migration_is_done_once_and_one_that_was_killed_goes_on(old, monkeypatch):
    def killed(*_, **__):
        raise KeyboardInterrupt

    alterer = type(old.opened("solutions").alter)
    with monkeypatch.context() as patch:
        patch.setattr(alterer, "set_table_properties", killed)
        with pytest.raises(KeyboardInterrupt):
            migrate(old, "solutions")
    assert outdated(old, "solutions") == "1"
    assert migrate(old, "solutions") == []
    version = old.version("solutions")
    assert migrate(old, "solutions") == []
    assert old.version("solutions") == version


def test_two_migrations_at_once_do_not_harm_each_other(old):
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda _: migrate(old, "solutions"), range(2)))
    assert old.read("solutions").num_rows == 4


def test_a_newer_table_is_not_touched(lake, solutions):
    lake.append("solutions", solutions([0]), app_id="x", number=1)
    lake.delta("solutions").alter.set_table_properties({"lmtr.schemaVersion": "99"}, False)
    with pytest.raises(LakeError, match="is of schema version 99"):
        migrate(lake, "solutions")


BARE = {pa.string(): "", pa.float64(): 0.0, pa.int64(): 0, pa.timestamp("us", tz="UTC"): 0}


@pytest.mark.parametrize(("table", "added"), [("evaluations", 4), ("rollouts", 1)])
def test_evaluations_of_before_read_with_nulls_and_new_ones_join_them(lake, table, added):
    names = ADDED[table][2]
    schema = pa.schema([field for field in SCHEMAS[table] if field.name not in names])
    (lake.storage.folder / table).mkdir(parents=True)
    DeltaTable.create(
        lake.uri(table),
        schema,
        configuration={"lmtr.schemaVersion": "1"},
        raise_if_key_not_exists=False,
    )
    row = {field.name: BARE.get(field.type, []) for field in schema if not field.nullable}
    write_deltalake(lake.uri(table), pa.Table.from_pylist([row], schema=schema), mode="append")
    assert migrate(lake, table) == list(names)
    assert len(names) == added
    key = f"{table.removesuffix('s')}_id"
    filled = {"policy": "nearest", "latent": 3, "training_seed": 1, "purpose": "tuning"}
    filled |= {"metrics": [("steps", 4.0)]}
    new = {**row, **{name: filled[name] for name in names}}
    new |= {key: "new"} | ({"outcome": "completed"} if table == "rollouts" else {})
    assert lake.append_rows(table, [new], app_id="x")
    rows = lake.read(table, order_by=key).to_pylist()
    assert [row[key] for row in rows] == ["", "new"]
    assert all(rows[0][name] is None for name in names)
    assert all(rows[1][name] == filled[name] for name in names)
