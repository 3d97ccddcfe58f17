"""What the lake keeps of rollouts, as the sums that comparisons are made of."""

from collections.abc import Sequence

from lmtr.errors import DataError
from lmtr.rollout.comparison import Tallies
from services.lake.tables import Lake


def tallies_of(lake: Lake, evaluation_ids: Sequence[str]) -> Tallies:
    """Sums of one replanner at one w, each training seed and course.

    Args:
        lake: The lake.
        evaluation_ids: Its evaluations, one for each training seed, on the same courses; one alone
            for the library.

    Raises:
        DataError: An evaluation is missing or has no sums, or they walked different courses.
    """
    seeds, courses = [], set()
    for evaluation_id in evaluation_ids:
        where = f"evaluation_id = '{evaluation_id}'"
        rows = lake.read(
            "rollouts", ["index", "seed", "metrics"], where=where, order_by="index"
        ).to_pylist()
        if not rows or any(row["metrics"] is None for row in rows):
            raise DataError(
                f"comparison: evaluation {evaluation_id!r} has no sums in table rollouts; it is "
                "missing or of an older LMTR, so evaluate it again with another seed"
            )
        courses.add(tuple((row["seed"], row["index"]) for row in rows))
        seeds.append([dict(row["metrics"]) for row in rows])
    if len(courses) > 1:
        raise DataError(
            f"comparison: evaluations {', '.join(evaluation_ids)} did not walk the same courses; "
            "take those of one evaluation.seed and number of rollouts"
        )
    return Tallies.stacked(seeds, courses.pop())
