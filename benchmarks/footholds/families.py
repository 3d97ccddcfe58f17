"""What is compared: families of tasks with and without the potential, and ranges of motion.

Tasks of one index have the same start and goal in every group of a family, and the same lines and
noise, so the groups differ by nothing but what their names say.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from lmtr.expert.settings import ExpertSettings
from lmtr.robot.model import ANYMAL, RobotModel
from lmtr.task.sampling import TaskDistribution
from pipelines.config import fingerprint

BESIDE = (0.15, 0.5)
"""Distances of a first line (m) that lies between the start feet, or just before the fore ones."""

FAMILIES = {
    "two lines": TaskDistribution(obstacle_count=(2, 2)),
    "three lines": TaskDistribution(obstacle_count=(3, 3)),
    "four lines": TaskDistribution(obstacle_count=(4, 4)),
    "two, one at the start": TaskDistribution(obstacle_count=(2, 2), first_obstacle=BESIDE),
    "four, one at the start": TaskDistribution(obstacle_count=(4, 4), first_obstacle=BESIDE),
}
"""Tasks by the number of their lines, and with the first line right beside the start."""

Potential = tuple[float, float]
"""Weight and standard deviation (m) of the potential across a line."""

USED: Potential = (ExpertSettings().obstacle_weight, ExpertSettings().obstacle_sigma)
NONE: Potential = (0.0, USED[1])

TRIED: tuple[Potential, ...] = ((0.5, 0.1), (1.0, 0.1))
"""Wider potentials that are compared with it on some families."""

COMPARED = ("two lines", "four lines")
"""Those families."""

BOXES = (0.14, 0.16, 0.18, 0.20)
"""Half lengths of the expert's forward range of motion (m); replanners are judged at the last."""

REFERENCE_BOX = ANYMAL.range_of_motion[0]
"""The expert's own."""

NEAR, FAR = "near", "far"

DISTANCES = {
    NEAR: TaskDistribution(),
    FAR: TaskDistribution(goal_distance=(TaskDistribution().goal_distance[1], 3.8)),
}
"""Tasks that the range of motion is tried on: those of a data set, and goals beyond them."""


@dataclass(frozen=True)
class Group:
    """Tasks of one distribution, solved by one expert.

    Attributes:
        name: Its name.
        tasks: The distribution.
        robot: The robot.
        settings: The expert's settings.
        judge_cost: Whether the filter judges costs, as it can for the default range of motion.
    """

    name: str
    tasks: TaskDistribution
    robot: RobotModel
    settings: ExpertSettings
    judge_cost: bool

    @property
    def key(self) -> str:
        """Digest of everything that decides its solves but the code."""
        return "-".join(fingerprint(each) for each in (self.tasks, self.robot, self.settings))


def potentials(family: str) -> list[Potential]:
    """Potentials that a family is solved with: none, the one in use, and others."""
    others = TRIED if family in COMPARED else ()
    return list(dict.fromkeys((NONE, USED, *others)))


def called(potential: Potential) -> str:
    """A potential in words."""
    weight, sigma = potential
    return f"{weight:g}, {100.0 * sigma:g} cm" if weight else "none"


def of_family(family: str, potential: Potential) -> str:
    """Name of the group of a family with a potential."""
    return f"{family}; potential {called(potential)}"


def in_box(box: float, distance: str) -> str:
    """Name of the group with a forward range of motion and a kind of goal distance."""
    return f"forward box {box:g} m; {distance} goals"


def groups() -> Iterator[Group]:
    """All groups, those with the same expert one after the other."""
    expert = ExpertSettings()
    for family, tasks in FAMILIES.items():
        for potential in potentials(family):
            weight, sigma = potential
            weighted = expert.model_copy(
                update={"obstacle_weight": weight, "obstacle_sigma": sigma}
            )
            name = of_family(family, potential)
            yield Group(name, tasks, ANYMAL, weighted, judge_cost=potential == USED)
    for box in BOXES:
        sides = (box, *ANYMAL.range_of_motion[1:])
        robot = ANYMAL.model_copy(update={"range_of_motion": sides})
        for distance, tasks in DISTANCES.items():
            yield Group(in_box(box, distance), tasks, robot, expert, judge_cost=False)
