"""The cache of compiled problems: loaded when intact, mended when not, done without when needed."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest

from lmtr.expert.compilation import (
    FUNCTIONS,
    LINEAR_SOLVER,
    BuildReport,
    compiled,
    compiled_linear_solver,
)
from lmtr.expert.solve import Expert
from lmtr.robot.model import ANYMAL

ARGUMENTS = np.array([0.3, -1.2])


def functions(factor=2.0):
    x = ca.MX.sym("x", 2)
    return [
        ca.Function("first", [x], [factor * ca.sin(x)]),
        ca.Function("second", [x], [ca.dot(x, x)]),
    ]


def value(function):
    return np.array(function(ARGUMENTS)).reshape(-1)


def only_entry(folder):
    (entry,) = folder.glob("*.so")
    return entry


def test_compiled_functions_are_the_interpreted_ones(tmp_path):
    loaded, report = compiled(functions(), tmp_path)
    assert report.compiled
    assert not report.cached
    for machine, interpreted in zip(loaded, functions(), strict=True):
        assert machine.name() == interpreted.name()
        np.testing.assert_allclose(value(machine), value(interpreted), rtol=1e-14)


def test_the_whole_default_problem_is_compiled_as_it_is_interpreted(drawn_in_full, tmp_path):
    """Objective, rows, gradient, Jacobian, Hessian and terms; their sparsity too."""
    problem = drawn_in_full.problem
    interpreted = problem.functions.all()
    machine, report = compiled(interpreted, tmp_path)
    assert report.compiled, report.reason
    point = [drawn_in_full.near_start(10), drawn_in_full.parameters]
    multipliers = [1.3, np.random.default_rng(10).standard_normal(problem.rows.size)]
    for expected, found in zip(interpreted, machine, strict=True):
        arguments = [*point, *multipliers][: expected.n_in()]
        pairs = zip(expected.call(arguments), found.call(arguments), strict=True)
        for mine, theirs in pairs:
            assert mine.sparsity() == theirs.sparsity()
            value = np.array(mine.nonzeros())
            rounding = 1e-13 * np.abs(value).max()  # of sums that cancel
            np.testing.assert_allclose(theirs.nonzeros(), value, rtol=1e-10, atol=rounding)


def test_a_second_build_finds_the_first(tmp_path):
    compiled(functions(), tmp_path)
    _, report = compiled(functions(), tmp_path)
    assert report.cached
    only_entry(tmp_path)


def test_another_problem_is_another_entry(tmp_path):
    compiled(functions(), tmp_path)
    loaded, report = compiled(functions(factor=3.0), tmp_path)
    assert not report.cached
    np.testing.assert_allclose(value(loaded[0]), 3.0 * np.sin(ARGUMENTS))


@pytest.mark.parametrize("damage", ["truncated", "flipped", "empty", "another problem's"])
def test_a_damaged_entry_is_built_again(tmp_path, damage):
    compiled(functions(factor=5.0), tmp_path / "other")
    folder = tmp_path / "cache"
    # Damaged before any load: a library in use must not change under a process.
    subprocess.run(
        [
            sys.executable,
            "-c",
            f"from pathlib import Path; import casadi as ca; x = ca.MX.sym('x', 2);"
            "from lmtr.expert.compilation import compiled;"
            "compiled([ca.Function('first', [x], [7.0 * ca.sin(x)]),"
            f" ca.Function('second', [x], [ca.dot(x, x)])], Path({str(folder)!r}))",
        ],
        check=True,
    )
    entry = only_entry(folder)
    content = entry.read_bytes()
    entry.write_bytes(
        {
            "truncated": content[: len(content) // 2],
            "flipped": content[:5000] + bytes([content[5000] ^ 1]) + content[5001:],
            "empty": b"",
            "another problem's": only_entry(tmp_path / "other").read_bytes(),
        }[damage]
    )
    loaded, report = compiled(functions(factor=7.0), folder)
    assert report.compiled
    assert not report.cached
    np.testing.assert_allclose(value(loaded[0]), 7.0 * np.sin(ARGUMENTS))
    _, again = compiled(functions(factor=7.0), folder)
    assert again.cached, "the entry was not mended"


def test_processes_may_build_at_once(tmp_path):
    code = (
        "from pathlib import Path; import casadi as ca, sys; x = ca.MX.sym('x', 2);"
        "from lmtr.expert.compilation import compiled;"
        "f, r = compiled([ca.Function('first', [x], [2.0 * ca.sin(x)])], Path(sys.argv[1]));"
        "assert r.compiled; print(float(f[0]([1.0, 1.0])[0]))"
    )

    def build(_):
        command = [sys.executable, "-c", code, str(tmp_path)]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout

    with ThreadPoolExecutor(3) as pool:
        printed = list(pool.map(build, range(3)))
    assert [float(text) for text in printed] == pytest.approx([2.0 * np.sin(1.0)] * 3)
    only_entry(tmp_path)


def test_without_a_compiler_the_problem_is_interpreted_and_says_so(
    tmp_path, monkeypatch, nearby, short
):
    monkeypatch.setenv("PATH", str(tmp_path))
    expert = Expert(ANYMAL, short, tmp_path / "cache")
    assert not expert.compiled
    assert "gcc" in expert.build_report.reason
    assert expert.solve(*nearby(0)).trajectory.is_finite()


def test_a_compiler_that_fails_is_done_without(tmp_path, monkeypatch):
    broken = tmp_path / "gcc"
    broken.write_text('#!/bin/sh\n[ "$1" = --version ] && exit 0\necho out of luck >&2; exit 1\n')
    broken.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    loaded, report = compiled(functions(), tmp_path / "cache")
    assert not report.compiled
    assert "out of luck" in report.reason
    np.testing.assert_allclose(value(loaded[0]), 2.0 * np.sin(ARGUMENTS))


def test_a_cache_that_cannot_be_written_is_done_without(tmp_path):
    file = tmp_path / "file"
    file.write_text("not a folder")
    _, report = compiled(functions(), file / "cache")
    assert not report.compiled
    assert str(file) in report.reason


def test_a_report_of_both_parts_tells_which_is_missing():
    whole = BuildReport(frozenset(), cached=True, seconds=1.0, reason="")
    solver = BuildReport(frozenset({LINEAR_SOLVER}), cached=False, seconds=2.0, reason="why")
    functions_too = BuildReport(frozenset({FUNCTIONS}), cached=False, seconds=0.0, reason="why")
    assert (whole + whole).compiled
    assert (whole + whole).loss == ""
    assert not (whole + solver).compiled
    assert "MUMPS" in (whole + solver).loss
    assert "interpreted" not in (whole + solver).loss
    assert "MUMPS" not in (whole + functions_too).loss
    neither = solver + functions_too
    assert "interpreted" in neither.loss
    assert "MUMPS" in neither.loss
    assert neither.reason == "why"


def test_each_part_reports_itself_as_missing(drawn, tmp_path):
    problem = drawn.problem
    assert compiled(functions(), None)[1].missing == {FUNCTIONS}
    assert compiled_linear_solver(problem, None)[1].missing == {LINEAR_SOLVER}
    assert compiled(functions(), tmp_path)[1].missing == frozenset()


def test_machine_code_and_interpreter_reach_the_same_solution(short_expert, nearby, short):
    assert short_expert.compiled, short_expert.build_report.reason
    task, noise = nearby(1)
    machine = short_expert.solve(task, noise)
    interpreted = Expert(ANYMAL, short, None).solve(task, noise)
    assert machine.cost == pytest.approx(interpreted.cost, rel=1e-3)
    np.testing.assert_allclose(
        machine.trajectory.footholds, interpreted.trajectory.footholds, atol=5e-3
    )
