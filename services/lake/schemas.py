"""What each table of the lake holds: Arrow schemas with meaning, unit and frame of each column.

Lists are row-major where they hold an array; its shape is part of the meaning. Feet are in the
order LF, RF, LH, RH, angles roll, pitch, yaw. A change that old rows do not fit raises the
table's version.
"""

import pyarrow as pa

TEXT = pa.string()
REAL = pa.float64()
REALS = pa.list_(pa.float64())
NUMBERS = pa.map_(pa.string(), pa.float64())
TIME = pa.timestamp("us", tz="UTC")

TASK_SIZE = 35
SEGMENT_SIZE = 264


def column(
    name: str,
    kind: pa.DataType,
    meaning: str,
    *,
    unit: str = "",
    frame: str = "",
    nullable: bool = False,
) -> pa.Field:
    """A column that carries its meaning, and unit and frame where it has them."""
    metadata = {"meaning": meaning, "unit": unit, "frame": frame}
    return pa.field(name, kind, nullable, {key: text for key, text in metadata.items() if text})


DATASET_ID = column("dataset_id", TEXT, "data set")
SEGMENTATION_ID = column("segmentation_id", TEXT, "digest of the way solutions are cut")
CODE_VERSION = column("code_version", TEXT, "version and commit of the code that made the row")
CREATED_AT = column("created_at", TIME, "when the row was made, UTC")
RUN_ID = column("mlflow_run_id", TEXT, "run of the experiment tracker")
SEED = column("seed", pa.int64(), "seed of everything random in the row")
OBSTACLES = column("obstacles", REALS, "obstacle lines x, y, α, (n, 3)", unit="m, rad", frame="W")
DIGEST = column(
    "digest",
    TEXT,
    "of identity and numbers, taken where the row was made; services/lake/digest.py",
    nullable=True,
)
SEGMENTS_VERSION = column("segments_version", pa.int64(), "version of table segments that was read")

DATASETS = (
    DATASET_ID,
    SEED,
    column("configuration", TEXT, "all settings that decide the rows, JSON"),
    column("robot", TEXT, "name of the robot"),
    column("layouts", TEXT, "layouts of task and segment vectors, JSON"),
    CODE_VERSION,
    CREATED_AT,
)

_VERDICT = (
    column("status", TEXT, "how the solve ended"),
    column("message", TEXT, "the solver's words, or the error outside it", nullable=True),
    column("accepted", pa.bool_(), "kept by the quality filter"),
    column("reject_reasons", pa.list_(TEXT), "why it was not accepted"),
    column("cost", REAL, "objective at the solution", nullable=True),
    column("expected_cost", REAL, "cost expected of such a task", nullable=True),
    column("cost_terms", NUMBERS, "terms of the cost"),
    column("constraint_violation", NUMBERS, "largest violation of the optimizer's own rows"),
    column("violations", NUMBERS, "violations sampled densely from the splines", unit="SI"),
    column("iterations", pa.int32(), "iterations of the optimizer", nullable=True),
    column("solve_cpu_s", REAL, "processor time of the solve", unit="s", nullable=True),
    column("liftoff_swaps", pa.int32(), "lift-offs that changed order", nullable=True),
    column(
        "gait_order", pa.list_(pa.int8()), "feet in the order of their first swings", nullable=True
    ),
    column("saturated", pa.list_(TEXT), "limits that the solution lies on", nullable=True),
)

_TASK = (
    column("start_pose", REALS, "base x, y, yaw", unit="m, rad", frame="W", nullable=True),
    column("start_feet", REALS, "feet x, y, (4, 2)", unit="m", frame="W", nullable=True),
    column("goal_pose", REALS, "base x, y, yaw", unit="m, rad", frame="W", nullable=True),
    OBSTACLES.with_nullable(True),
    column("noise_amplitudes", REALS, "sines on x, y, yaw, (3, 3)", unit="m, rad", nullable=True),
    column("noise_timing", REALS, "offsets of contact changes", unit="s", nullable=True),
)

_TRAJECTORY = (
    column("n_stances", pa.int32(), "stances per foot, S", nullable=True),
    column("base_start", REAL, "time of the first base node", unit="s", nullable=True),
    column(
        "base_nodes",
        REALS,
        "x, y, z, roll, pitch, yaw and their derivatives every 0.1 s, (N, 2, 6)",
        unit="m, rad, m/s, rad/s",
        frame="W",
        nullable=True,
    ),
    column(
        "contact_times",
        REALS,
        "per foot: start, then lift-off and touch-down of each swing, then end, (4, 2S)",
        unit="s",
        nullable=True,
    ),
    column("footholds", REALS, "x, y, z, (4, S, 3)", unit="m", frame="W", nullable=True),
    column(
        "swing_nodes",
        REALS,
        "mid-swing x, y, z and horizontal velocity, (4, S − 1, 5)",
        unit="m, m/s",
        frame="W",
        nullable=True,
    ),
    column(
        "force_nodes",
        REALS,
        "force and its derivative at the nodes of each stance, (4, S, 3, 2, 3)",
        unit="N, N/s",
        frame="W",
        nullable=True,
    ),
    column(
        "guess_footholds",
        REALS,
        "footholds of the noisy first guess, (4, S, 3)",
        unit="m",
        frame="W",
        nullable=True,
    ),
)

SOLUTIONS = (
    DATASET_ID,
    column("index", pa.int64(), "which task of the data set; decides its random stream"),
    *_VERDICT,
    *_TASK,
    *_TRAJECTORY,
    CODE_VERSION,
    column("config_hash", TEXT, "digest of the settings"),
    CREATED_AT,
    DIGEST,
)

CUTS = (
    DATASET_ID,
    SEGMENTATION_ID,
    column("settings", TEXT, "how solutions are cut and split, JSON"),
    CODE_VERSION,
    CREATED_AT,
)

SEGMENTS = (
    DATASET_ID,
    column("solution_index", pa.int64(), "index of the solution it was cut from"),
    SEGMENTATION_ID,
    column("epoch_s", REAL, "its start in the solution", unit="s"),
    column("goal_time_s", REAL, "when the solution reaches its goal γ", unit="s"),
    column("split", TEXT, "train or validation, by solution"),
    # Single precision: a micrometre, and half of the disk.
    column("x", pa.list_(pa.float32(), TASK_SIZE), "task vector; datasets.layouts", frame="S"),
    column(
        "tau", pa.list_(pa.float32(), SEGMENT_SIZE), "segment vector; datasets.layouts", frame="S"
    ),
    DIGEST,
)

MODELS = (
    column("model_id", TEXT, "model"),
    DATASET_ID,
    SEGMENTATION_ID,
    SEGMENTS_VERSION,
    column("latent", pa.int32(), "latent dimension n; 0 is the unimodal regressor"),
    SEED,
    column("settings", TEXT, "architecture, loss and optimisation, JSON"),
    column("metrics", NUMBERS, "validation metrics of the weights that were kept"),
    column("folder", TEXT, "folder below the home's models"),
    RUN_ID,
    CODE_VERSION,
    CREATED_AT,
)

EVALUATIONS = (
    column("evaluation_id", TEXT, "one replanner on one set of courses"),
    DATASET_ID,
    SEGMENTATION_ID,
    column("replanner", TEXT, "name of the replanner"),
    column("model_id", TEXT, "its model; none for the trajectory library", nullable=True),
    column("weights", REALS, "distance weights w of base, feet, obstacles, goal"),
    column("planner", TEXT, "the replanner's own description, JSON"),
    column("settings", TEXT, "courses and testbed, JSON"),
    SEED,
    column("summary", NUMBERS, "metrics over all rollouts", unit="SI"),
    SEGMENTS_VERSION,
    RUN_ID,
    CODE_VERSION,
    CREATED_AT,
    column("policy", TEXT, "how the mode, or the library's plan, is selected", nullable=True),
    column(
        "latent",
        pa.int32(),
        "latent dimension n of its model; none for library and expert",
        nullable=True,
    ),
    column(
        "training_seed",
        pa.int64(),
        "seed that its model was trained with; none for library and expert",
        nullable=True,
    ),
    column(
        "purpose",
        TEXT,
        "report, or tuning: on courses of their own, to choose the weights w",
        nullable=True,
    ),
)

_SAMPLES = (
    column("t", REALS, "sample times, (M); none where the motion was not kept", unit="s"),
    column("base_pos_W", REALS, "(M, 3)", unit="m", frame="W"),
    column("base_rpy", REALS, "(M, 3)", unit="rad", frame="W"),
    column("base_linvel_W", REALS, "(M, 3)", unit="m/s", frame="W"),
    column("base_angvel_W", REALS, "(M, 3)", unit="rad/s", frame="W"),
    column("foot_pos_W", REALS, "(M, 4, 3)", unit="m", frame="W"),
    column(
        "foot_force_W", REALS, "ground reactions, zero in swing, (M, 4, 3)", unit="N", frame="W"
    ),
    column("foot_contact", pa.list_(pa.bool_()), "(M, 4); a change belongs to the later phase"),
)

_FOOTHOLDS = (
    column("foothold_foot", pa.list_(pa.int8()), "index of the foot, (K)"),
    column("foothold_x", REALS, "(K)", unit="m", frame="W"),
    column("foothold_y", REALS, "(K)", unit="m", frame="W"),
    column("foothold_touchdown", REALS, "start of the stance, (K)", unit="s"),
    column("foothold_liftoff", REALS, "end of the stance, (K)", unit="s"),
)

ROLLOUTS = (
    column("rollout_id", TEXT, "rollout"),
    column("evaluation_id", TEXT, "evaluation that it belongs to"),
    DATASET_ID,
    column("replanner", TEXT, "name of the replanner"),
    column("index", pa.int64(), "which course; the same index is the same course"),
    SEED,
    column("outcome", TEXT, "completed or diverged"),
    column("reason", TEXT, "limit that was left, of a diverged rollout", nullable=True),
    column("duration_s", REAL, "until the end or the divergence", unit="s"),
    column("distance_m", REAL, "travelled along x", unit="m"),
    OBSTACLES,
    column(
        "clearances",
        REALS,
        "closest foothold of each foot to each line that was crossed, (n_crossed, 4)",
        unit="m",
    ),
    column("violations", REALS, "range-of-motion excess of standing feet, by sample", unit="m"),
    column("velocity_jumps", REALS, "of the base at each replanning, (C)", unit="m/s"),
    column("foot_jumps", REALS, "of the feet at each replanning, (C, 4)", unit="m"),
    column("disagreements", pa.list_(pa.int8()), "of plan and motion on contacts, (C, 4)"),
    column("plan_seconds", REALS, "time of each plan, (C)", unit="s"),
    *_SAMPLES,
    *_FOOTHOLDS,
    CREATED_AT,
    column(
        "metrics",
        NUMBERS,
        "sums over the rollout whose ratios are the summary's rates: lmtr/rollout/tally.py",
        unit="SI",
        nullable=True,
    ),
)


def _schema(name: str, version: int, columns: tuple[pa.Field, ...]) -> pa.Schema:
    return pa.schema(columns, {"lmtr.table": name, "lmtr.version": str(version)})


SCHEMAS: dict[str, pa.Schema] = {
    "datasets": _schema("datasets", 1, DATASETS),
    "solutions": _schema("solutions", 2, SOLUTIONS),
    "cuts": _schema("cuts", 1, CUTS),
    "segments": _schema("segments", 2, SEGMENTS),
    "models": _schema("models", 1, MODELS),
    "evaluations": _schema("evaluations", 2, EVALUATIONS),
    "rollouts": _schema("rollouts", 2, ROLLOUTS),
}

IDENTITY: dict[str, tuple[str, ...]] = {
    "datasets": ("dataset_id",),
    "solutions": ("dataset_id", "index"),
    "cuts": ("dataset_id", "segmentation_id"),
    "segments": ("dataset_id", "segmentation_id", "solution_index", "epoch_s", "goal_time_s"),
    "models": ("model_id",),
    "evaluations": ("evaluation_id",),
    "rollouts": ("rollout_id",),
}
"""Columns that tell a row from all others."""

FINITE: dict[str, tuple[str, ...]] = {"segments": ("x", "tau")}
"""Columns that must hold no NaN and no infinity: one would spoil a whole training."""

UNDIGESTED = frozenset(
    {"digest", "created_at", "code_version", "solve_cpu_s", "message", "mlflow_run_id"}
)
"""Columns that a row's digest leaves out: they differ where the same was done twice."""

ADDED: dict[str, dict[int, tuple[str, ...]]] = {
    "solutions": {2: ("saturated", "digest")},
    "segments": {2: ("digest",)},
    "evaluations": {2: ("policy", "latent", "training_seed", "purpose")},
    "rollouts": {2: ("metrics",)},
}
"""Columns that a version of a table's schema added to the one before, all nullable."""

MADE_TOGETHER: dict[str, tuple[str, ...]] = {
    "segments": ("dataset_id", "segmentation_id", "solution_index"),
    "rollouts": ("evaluation_id",),
}
"""Columns that rows of one piece of work have in common, where it makes more than one row.

It is done again only where none of its rows is there, so they must be there all or none. Delta's
log has the bounds of these columns for each file, as they are among the first of their table.
"""

MADE_BY: dict[str, str] = {
    "datasets": "lmtr generate",
    "solutions": "lmtr generate",
    "cuts": "lmtr segment",
    "segments": "lmtr segment",
    "models": "lmtr train",
    "evaluations": "lmtr evaluate",
    "rollouts": "lmtr evaluate",
}
"""The command that makes each table."""


def version_of(schema: pa.Schema) -> str:
    """Version that a table's schema carries."""
    return str(schema.metadata[b"lmtr.version"].decode())


def older_versions(table: str) -> list[str]:
    """Schema versions of a table that can be brought up to this one."""
    return [str(version - 1) for version in sorted(ADDED.get(table, {}))]
