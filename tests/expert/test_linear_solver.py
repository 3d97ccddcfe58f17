"""The linear solver made for a problem, called as IPOPT calls it, against dense algebra."""

import ctypes
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from lmtr.expert import solver
from lmtr.expert.compilation import compiled_linear_solver
from lmtr.expert.kkt.elimination import eliminate
from lmtr.expert.kkt.structure import KktStructure
from lmtr.expert.solve import Expert, Status
from lmtr.robot.model import ANYMAL
from lmtr.task.sampling import TaskDistribution

SINGULAR = -5


class Ma27:
    """One instance of the solver, through the calling convention of MA27."""

    def __init__(self, library, matrix, doubled=True):
        self._call = ctypes.CDLL(str(library))
        lower = sp.tril(matrix).tocoo()
        # As IPOPT does, hand a diagonal in twice: the solver adds what has one place.
        diagonal = np.arange(matrix.shape[0] if doubled else 0)
        self._rows = np.concatenate([lower.row, diagonal]).astype(np.int32) + 1
        self._columns = np.concatenate([lower.col, diagonal]).astype(np.int32) + 1
        self.values = np.concatenate([lower.data, np.zeros(len(diagonal))])
        self._size, self.info = np.int32(matrix.shape[0]), np.zeros(20, np.int32)
        self._unused = np.zeros(30, np.int32), np.zeros(5)
        self._kept = np.zeros(3 * matrix.shape[0], np.int32)

    def _pass(self, name, *arguments):
        integers, reals = self._unused
        known = {"i": integers, "r": reals, "k": self._kept}
        passed = [known[a] if isinstance(a, str) else np.asarray(a) for a in arguments]
        getattr(self._call, name)(*[a.ctypes.data_as(ctypes.c_void_p) for a in passed])

    def analyse(self):
        count = np.int32(len(self._rows))
        structure = self._size, count, self._rows, self._columns
        self._pass("ma27ad_", *structure, *"iikiiii", "r", self.info, "r")
        self._room = int(self.info[4])
        return int(self.info[0])

    def factor(self):
        self._storage = np.zeros(self._room)
        self._storage[: len(self.values)] = self.values
        count, room = np.int32(len(self._rows)), np.int32(len(self._storage))
        structure = self._size, count, self._rows, self._columns
        self._pass("ma27bd_", *structure, self._storage, room, *"iikiiii", "r", self.info)
        return int(self.info[0])

    @property
    def negative_eigenvalues(self):
        return int(self.info[14])

    def solve(self, right):
        solution, room = right.copy(), np.int32(len(self._storage))
        self._pass("ma27cd_", self._size, self._storage, room, *"iiri", solution, *"iiir")
        return solution


@pytest.fixture(scope="module")
def structure(drawn):
    return KktStructure.of(drawn.problem)


@pytest.fixture(scope="module")
def library(drawn, expert_cache):
    path, report = compiled_linear_solver(drawn.problem, expert_cache)
    assert report.compiled, report.reason
    return path


def newton_system(structure, seed=0, convexity=0.1):
    """A random system with the structure of a problem's Newton steps."""
    rng = np.random.default_rng(seed)

    def filled(pattern):
        matrix = sp.csr_matrix(pattern, copy=True)
        matrix.data = rng.standard_normal(matrix.nnz)
        return matrix

    upper = sp.triu(filled(structure.hessian))
    hessian = upper + upper.T
    dominance = np.asarray(abs(hessian).sum(axis=1)).ravel() + convexity
    hessian = hessian + sp.diags(dominance)
    equalities, inequalities = filled(structure.equalities), filled(structure.inequalities)
    n = structure.n_inequalities
    slack, one = sp.diags(10.0 ** rng.uniform(-3, 3, n)), sp.identity(n)
    blocks = [
        [hessian, None, equalities.T, inequalities.T],
        [None, slack, None, -one],
        [equalities, None, None, None],
        [inequalities, -one, None, None],
    ]
    return sp.bmat(blocks).tocsr(), rng.standard_normal(structure.size)


def test_it_solves_newton_systems_and_counts_negative_eigenvalues(structure, library):
    matrix, right = newton_system(structure)
    kkt = Ma27(library, matrix)
    assert kkt.analyse() == 0
    assert kkt.factor() == 0
    solution = kkt.solve(right)
    solution += kkt.solve(right - matrix @ solution)  # IPOPT refines once at least
    exact = np.linalg.solve(matrix.toarray(), right)
    np.testing.assert_allclose(solution, exact, rtol=1e-7, atol=1e-9)
    assert kkt.negative_eigenvalues == (np.linalg.eigvalsh(matrix.toarray()) < 0.0).sum()


def test_it_sees_curvature_of_the_wrong_sign(structure, library):
    """IPOPT convexifies by what the count of negative eigenvalues tells it."""
    matrix, _ = newton_system(structure, seed=1)
    bent = sp.diags(np.where(np.arange(structure.size) < structure.n_variables, -300.0, 0.0))
    matrix = (matrix + bent).tocsr()
    kkt = Ma27(library, matrix)
    kkt.analyse()
    assert kkt.factor() == 0
    expected = (np.linalg.eigvalsh(matrix.toarray()) < 0.0).sum()
    assert expected > structure.n_equalities + structure.n_inequalities
    assert kkt.negative_eigenvalues == expected


def test_instances_of_one_library_do_not_disturb_each_other(structure, library):
    systems = [newton_system(structure, seed) for seed in (2, 3)]
    solvers = [
        Ma27(library, matrix, doubled)
        for (matrix, _), doubled in zip(systems, (True, False), strict=True)
    ]
    for kkt in solvers:
        assert kkt.analyse() == 0
    for kkt in solvers:
        assert kkt.factor() == 0
    for kkt, (matrix, right) in zip(solvers, systems, strict=True):
        solution = kkt.solve(right)
        solution += kkt.solve(right - matrix @ solution)
        np.testing.assert_allclose(matrix @ solution, right, atol=1e-8)


def test_not_a_number_is_told_as_a_singular_system(structure, library):
    matrix, _ = newton_system(structure)
    kkt = Ma27(library, matrix)
    kkt.analyse()
    kkt.values[0] = np.nan
    assert kkt.factor() == SINGULAR


def test_systems_of_another_problem_are_refused(structure, library):
    matrix, _ = newton_system(structure)
    assert Ma27(library, matrix[:-1, :-1]).analyse() < 0
    stranger = sp.lil_matrix(matrix)
    stranger[structure.n_variables + 1, structure.n_variables] = 1.0  # two slacks never meet
    assert Ma27(library, sp.csr_matrix(stranger)).analyse() < 0


def test_fronts_eliminate_every_unknown_once_and_hold_all_that_fills_in(structure):
    pattern = structure.condensed
    plan = eliminate(pattern)
    assert sorted(plan.order) == list(range(pattern.shape[0]))
    pivots = [front.first + np.arange(front.pivots) for front in plan.fronts]
    np.testing.assert_array_equal(np.concatenate(pivots), np.arange(len(plan.order)))
    held = np.zeros(pattern.shape, bool)
    for front, own in zip(plan.fronts, pivots, strict=True):
        held[np.ix_(np.concatenate([own, front.border]), own)] = True
    dense = pattern[plan.order][:, plan.order].toarray() != 0.0
    for column in range(len(plan.order)):  # elimination as it is taught
        below = column + 1 + np.flatnonzero(dense[column + 1 :, column])
        dense[np.ix_(below, below)] = True
    assert not (np.tril(dense) & ~held).any()


def test_the_expert_finds_the_same_with_mumps(short_expert, nearby):
    """Two linear solvers, one optimum; interpreted problems use MUMPS."""
    general = Expert(ANYMAL, short_expert.settings, None)
    assert short_expert.compiled
    for index in range(3):
        own, other = short_expert.solve(*nearby(index)), general.solve(*nearby(index))
        assert own.status == other.status
        assert own.cost == pytest.approx(other.cost, rel=1e-3)


def test_a_problem_with_fixed_variables_is_left_to_mumps(drawn, expert_cache):
    fixed = replace(drawn.problem, lower=drawn.problem.upper)
    path, report = compiled_linear_solver(fixed, expert_cache)
    assert path is None
    assert "fix" in report.reason


@pytest.mark.slow
def test_whole_walks_with_both_linear_solvers(drawn_in_full, expert_cache):
    settings = drawn_in_full.settings
    own, general = Expert(ANYMAL, settings, expert_cache), Expert(ANYMAL, settings, None)
    assert own.compiled
    task, noise = drawn_in_full.task, drawn_in_full.noise
    assert len(task.obstacles_W) == TaskDistribution().obstacle_count[0]
    first, second = own.solve(task, noise), general.solve(task, noise)
    assert abs(first.iterations - second.iterations) <= 2
    assert first.cost == pytest.approx(second.cost, rel=1e-3)


def test_a_library_that_cannot_be_loaded_is_left_to_mumps(drawn, tmp_path, monkeypatch):
    """As on a file system that forbids to execute what lies there."""

    def refuse(path):
        raise OSError(f"{path}: failed to map segment from shared object")

    monkeypatch.setattr(ctypes, "CDLL", refuse)
    path, report = compiled_linear_solver(drawn.problem, tmp_path)
    assert path is None
    assert "failed to map segment" in report.reason


def test_restoration_solves_systems_of_the_same_structure(
    short_expert, nearby, monkeypatch, expert_cache
):
    """IPOPT looks for a feasible point with systems of its own, and the same linear solver."""
    options = solver._ipopt_options

    def restoring(settings):
        return options(settings) | {"start_with_resto": "yes"}

    monkeypatch.setattr(solver, "_ipopt_options", restoring)
    settings = short_expert.settings
    own, general = Expert(ANYMAL, settings, expert_cache), Expert(ANYMAL, settings, None)
    for index in range(2):
        first, second = own.solve(*nearby(index)), general.solve(*nearby(index))
        assert first.status == second.status == Status.CONVERGED
        assert first.cost == pytest.approx(second.cost, rel=1e-3)
