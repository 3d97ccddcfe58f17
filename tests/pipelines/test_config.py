"""A configuration is checked whole, and every fault is one line that names key and mend."""

import copy
import functools
import operator
import tomllib

import pytest

from lmtr.errors import ConfigurationError
from lmtr.robot.model import ROBOTS
from pipelines.config import as_toml, builtin_names, load, parse


def test_every_builtin_configuration_is_valid():
    assert "demo" in builtin_names()
    for name in builtin_names():
        assert load(name).dataset.name


@pytest.mark.parametrize(
    ("override", "named"),
    [
        ("expert.durationn=3", "durationn"),
        ("tasks.goal_yaw=-1", "tasks.goal_yaw"),
        ("expert.scope.duration=-7.5", "expert.scope.duration"),
        ("training.latent=[0, -1]", "training.latent.1"),
        ("dataset.robot='unicorn'", "unicorn"),
        ("dataset.solutions=many", "dataset.solutions"),
        ("tasks.goal_distance=[3.0, 2.0]", "goal_distance"),
        ("tasks.goal_distance=[9.0, 10.0]", "bring the goals closer"),
        ("tasks.foot_scatter=[0.5, 0.0]", "range of motion"),
        ("tasks.foot_scatter=[0.155, 0.0]", "less the margin of 0.008 m"),
        ("expert.range_of_motion_margin=0.2", "range_of_motion_margin must be less"),
        ("expert.limits.height=0.42", "limits.height must be less"),
        ("dataset.robot.range_of_motion=[0.16, 0.12]", "dataset.robot.range_of_motion.2"),
        ("dataset.robot.masss=30.0", "did you mean 'mass'"),
        ("cluster.cache=caches/lmtr", "cluster.cache: cache must be an absolute path"),
        ("nonsense", "section.key=value"),
    ],
)
def test_a_fault_is_one_line_that_names_it(override, named):
    with pytest.raises(ConfigurationError) as caught:
        load("demo", [override])
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_misspelt_key_gets_the_right_one():
    with pytest.raises(ConfigurationError, match="did you mean 'goal_yaw'"):
        load(None, ["tasks.goal_yav=0.1"])


def test_an_unknown_file_lists_the_builtin_ones():
    with pytest.raises(ConfigurationError, match="demo"):
        load("no-such-file.toml")


def test_broken_toml_names_the_line(tmp_path):
    path = tmp_path / "broken.toml"
    path.write_text("[dataset]\nsolutions = = 3\n")
    with pytest.raises(ConfigurationError, match="line 2"):
        load(str(path))


def test_overrides_win_over_the_file_and_later_ones_over_earlier_ones(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("[dataset]\nsolutions = 5\nseed = 3\n")
    config = load(str(path), ["dataset.solutions=6", "dataset.solutions=7"])
    assert (config.dataset.solutions, config.dataset.seed) == (7, 3)


def test_start_feet_may_use_all_of_their_room():
    load(None, ["tasks.foot_scatter=[0.152, 0.112]"])


@pytest.mark.parametrize("name", list(ROBOTS))
def test_single_figures_of_a_named_robot_can_be_set(tmp_path, name):
    path = tmp_path / "mine.toml"
    path.write_text(f'[dataset]\nseed = 3\nrobot = "{name}"\n')
    figures = {"mass": 40.0, "range_of_motion": (0.18, 0.12, 0.1)}
    expected = ROBOTS[name].model_copy(update=figures)
    overrides = ["dataset.robot.mass=40", "dataset.robot.range_of_motion=[0.18, 0.12, 0.1]"]
    config = load(str(path), overrides)
    assert config.dataset.robot == expected
    assert config.dataset.seed == 3
    assert load(None, [f"dataset.robot={name}", *overrides]).dataset.robot == expected


def test_a_figure_that_is_set_is_the_default_robots_where_none_is_named():
    default = load(None).dataset.robot
    changed = load(None, ["dataset.robot.mass=40"]).dataset.robot
    assert changed == default.model_copy(update={"mass": 40.0})


def test_a_figure_of_an_unknown_robot_is_refused_by_the_robots_name():
    with pytest.raises(ConfigurationError, match="no built-in robot is called 'unicorn'"):
        load(None, ["dataset.robot=unicorn", "dataset.robot.mass=40"])


def test_a_figure_of_a_robot_of_ones_own_leaves_its_others(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text(as_toml(load(None, ["dataset.robot.name=mine", "dataset.robot.mass=12"])))
    robot = load(str(path), ["dataset.robot.friction=0.5"]).dataset.robot
    assert (robot.name, robot.mass, robot.friction) == ("mine", 12.0, 0.5)


def numbers_below(tree, path=()):
    """Paths of all real numbers in a tree of settings."""
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree):
        if isinstance(value, (dict, list)):
            yield from numbers_below(value, (*path, key))
        elif isinstance(value, float):
            yield (*path, key)


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), float("-inf")])
def test_every_setting_that_is_not_finite_is_refused_by_its_name(wrong):
    whole = tomllib.loads(as_toml(parse({})))
    paths = list(numbers_below(whole))
    assert len(paths) > 100
    for path in paths:
        tree = copy.deepcopy(whole)
        *above, last = path
        functools.reduce(operator.getitem, above, tree)[last] = wrong
        with pytest.raises(ConfigurationError) as caught:
            parse(tree)
        assert ".".join(map(str, path)) in str(caught.value)


def test_the_dataset_id_depends_on_what_decides_the_rows_and_on_nothing_else():
    base = parse({})
    longer = parse({"dataset": {"solutions": 9}, "cluster": {"workers": 1}})
    assert longer.dataset_id == base.dataset_id
    others = [
        {"dataset": {"seed": 1}},
        {"dataset": {"robot": "hyq"}},
        {"tasks": {"goal_yaw": 0.1}},
        {"expert": {"obstacle_weight": 0.0}},
    ]
    assert len({base.dataset_id, *(parse(tree).dataset_id for tree in others)}) == 5
