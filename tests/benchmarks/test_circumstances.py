"""Kept solves tell what made them, and those of other code or settings are not recorded."""

import subprocess
import sys
from dataclasses import asdict, replace

import pytest

from benchmarks.solving.circumstances import (
    JUDGEMENT,
    SOURCES,
    circumstances,
    differences,
    made_by,
    require_same,
    sections,
    sources,
)
from lmtr.errors import DataError
from pipelines.config import load

NOW = circumstances(sections(load(None, [])), 0, 2, compiled=True)


def test_the_digest_covers_all_code_that_solves_and_judges():
    asked = (
        "import sys, lmtr.expert.solve, lmtr.quality.filter, lmtr.task.sampling\n"
        "print(*(name for name in sys.modules if name.startswith('lmtr.')))"
    )
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    covered = {name.removesuffix(".py") for name in SOURCES}
    assert {name.split(".")[1] for name in done.stdout.split()} <= covered


def test_the_digest_is_of_the_files_but_for_those_left_out():
    assert sources() == sources()
    assert len({sources(), sources(JUDGEMENT), sources(JUDGEMENT[:1])}) == 3


def test_circumstances_come_back_from_the_head_of_a_file():
    assert made_by({"circumstances": asdict(NOW)}, "study") == NOW
    with pytest.raises(DataError, match="study: the kept solves do not tell what made them"):
        made_by({}, "study")


def test_solves_of_other_code_or_settings_are_refused():
    require_same(replace(NOW, code="1+other", day="2026-01-01"), NOW, "study", "--record")
    other = replace(NOW, sources="other", code="1+abc")
    with pytest.raises(DataError, match=r"study: --record .* code \(solved by 1\+abc\)"):
        require_same(other, NOW, "study", "--record")
    changed = circumstances(
        sections(load(None, ["expert.obstacle_weight=0.7"])), 0, 2, compiled=True
    )
    with pytest.raises(DataError, match=r"settings \(expert\)"):
        require_same(changed, NOW, "study", "--record")


def test_an_interpreted_expert_is_told_from_a_compiled_one():
    (said,) = differences(replace(NOW, compiled=False), NOW)
    assert said == "it was recorded as machine code, this is interpreted"
