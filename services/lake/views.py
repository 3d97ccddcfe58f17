"""Views with readable columns over the tables, and the queries that the docs show."""

from dataclasses import dataclass


@dataclass(frozen=True)
class View:
    """A view that any query may use like a table.

    Attributes:
        sql: What it selects.
        meaning: What a row is, for people.
        tables: Tables that it reads.
    """

    sql: str
    meaning: str
    tables: tuple[str, ...]


_OVERVIEW = """
SELECT dataset_id, "index",
    sqrt((goal_pose[1] - start_pose[1])^2 + (goal_pose[2] - start_pose[2])^2) AS distance_m,
    len(obstacles) // 3 AS lines,
    status, accepted, reject_reasons, cost, cost - expected_cost AS cost_above_expected,
    iterations, solve_cpu_s, liftoff_swaps, saturated,
    violations['linear_residual_peak'] AS linear_residual_peak,
    violations['angular_residual_peak'] AS angular_residual_peak,
    violations['stance_overshoot'] AS stance_overshoot_m,
    violations['closest_foothold_1'] AS closest_foothold_1_m,
    created_at
FROM solutions
"""

VIEWS: dict[str, View] = {
    "solutions_overview": View(
        _OVERVIEW, "a solution, with its task and figures as plain columns", ("solutions",)
    ),
    "accepted_by_distance": View(
        f"""
        SELECT dataset_id, round(distance_m, 1) AS distance_m, count(*) AS solutions,
            avg(accepted::INT) AS accepted_share, median(cost) AS cost_median,
            median(solve_cpu_s) AS solve_cpu_s_median
        FROM ({_OVERVIEW}) GROUP BY ALL ORDER BY ALL
        """,
        "goals of one distance, to a decimetre: how many, accepted share, cost",
        ("solutions",),
    ),
    "rejection_reasons": View(
        """
        WITH given AS (SELECT dataset_id, unnest(reject_reasons) AS reason FROM solutions),
            counted AS (SELECT dataset_id, reason, count(*) AS solutions FROM given GROUP BY ALL)
        SELECT *, solutions / sum(solutions) OVER (PARTITION BY dataset_id) AS share_of_reasons
        FROM counted ORDER BY dataset_id, solutions DESC
        """,
        "a reason for refusal: how often",
        ("solutions",),
    ),
    "solve_times": View(
        """
        SELECT dataset_id, status, count(*) AS solutions, median(solve_cpu_s) AS cpu_s_median,
            quantile_cont(solve_cpu_s, 0.9) AS cpu_s_p90, max(solve_cpu_s) AS cpu_s_max,
            median(iterations) AS iterations_median, sum(solve_cpu_s) / 3600 AS cpu_h_total
        FROM solutions GROUP BY ALL ORDER BY ALL
        """,
        "an end of a solve: effort",
        ("solutions",),
    ),
    "cost_summary": View(
        """
        SELECT dataset_id, accepted, count(cost) AS solutions, min(cost) AS cost_min,
            median(cost) AS cost_median, max(cost) AS cost_max,
            median(cost - expected_cost) AS above_expected_median
        FROM solutions GROUP BY ALL ORDER BY ALL
        """,
        "accepted and refused solutions: their costs",
        ("solutions",),
    ),
    "dataset_summary": View(
        """
        SELECT d.dataset_id, d.robot, d.seed, count(s."index") AS solutions,
            count(*) FILTER (s.accepted) AS accepted, min(s.created_at) AS begun,
            max(s.created_at) AS last_row
        FROM datasets d LEFT JOIN solutions s USING (dataset_id) GROUP BY ALL ORDER BY begun
        """,
        "a data set: how many solutions, how many accepted, when",
        ("datasets", "solutions"),
    ),
    "segments_overview": View(
        """
        SELECT dataset_id, segmentation_id, split, count(*) AS segments,
            count(DISTINCT solution_index) AS solutions,
            avg(goal_time_s - epoch_s) AS horizon_s_mean
        FROM segments GROUP BY ALL ORDER BY ALL
        """,
        "one split of one cut: segments, solutions they come from",
        ("segments",),
    ),
    "evaluations_overview": View(
        """
        SELECT dataset_id, replanner, policy, latent, training_seed, purpose, weights,
            summary['close_share'] AS close_share, summary['mean_violation'] AS mean_violation_m,
            summary['large_violation_share'] AS large_violation_share,
            summary['mean_velocity_jump'] AS mean_velocity_jump,
            summary['mean_foot_jump'] AS mean_foot_jump_m,
            summary['linear_residual'] AS linear_residual,
            summary['angular_residual'] AS angular_residual,
            summary['friction_share'] AS friction_share, summary['distance'] AS distance_m,
            summary['diverged'] AS diverged, summary['rollouts'] AS rollouts, evaluation_id,
            created_at
        FROM evaluations
        """,
        "a replanner at one w on one set of courses, with its figures as plain columns",
        ("evaluations",),
    ),
}

DOCUMENTED: dict[str, str] = {
    "Accepted share by distance of the goal": "SELECT * FROM accepted_by_distance",
    "The dearest accepted solutions": (
        'SELECT "index", distance_m, lines, cost_above_expected FROM solutions_overview '
        "WHERE accepted ORDER BY cost_above_expected DESC LIMIT 10"
    ),
    "Segments by split": "SELECT * FROM segments_overview",
    "Forward velocity at the start of segments": (
        "SELECT split, avg(x[4]) AS mean, quantile_cont(x[4], [0.05, 0.5, 0.95]) AS quantiles "
        "FROM segments GROUP BY split ORDER BY split"
    ),
    "Segments by the cost of their solution": (
        "SELECT round(s.cost) AS cost, count(*) AS segments, avg(g.goal_time_s - g.epoch_s) AS "
        "horizon_s FROM segments g JOIN solutions s ON s.dataset_id = g.dataset_id "
        'AND s."index" = g.solution_index GROUP BY ALL ORDER BY ALL'
    ),
    "The Pareto front over w of each replanner": (
        "SELECT a.replanner, a.weights, a.close_share, a.mean_violation_m FROM "
        "evaluations_overview a WHERE a.purpose = 'report' AND a.diverged = 0 AND NOT EXISTS "
        "(SELECT 1 FROM evaluations_overview b WHERE b.purpose = 'report' AND b.diverged = 0 "
        "AND b.dataset_id = a.dataset_id AND b.policy = a.policy AND "
        "b.latent IS NOT DISTINCT FROM a.latent AND b.training_seed IS NOT DISTINCT FROM "
        "a.training_seed AND b.close_share <= a.close_share AND b.mean_violation_m <= "
        "a.mean_violation_m AND (b.close_share < a.close_share OR b.mean_violation_m < "
        "a.mean_violation_m)) ORDER BY a.latent, a.training_seed, a.close_share"
    ),
    "Close steps of each policy over all its training seeds": (
        "SELECT e.policy, e.latent, e.weights, count(DISTINCT e.training_seed) AS seeds, "
        "sum(r.metrics['close_steps']) / sum(r.metrics['steps']) AS close_share FROM rollouts r "
        "JOIN evaluations e USING (evaluation_id) WHERE e.purpose = 'report' GROUP BY ALL "
        "ORDER BY close_share"
    ),
}
"""Queries of docs/queries.md by what they answer."""
