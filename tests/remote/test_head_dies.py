"""The head of a cluster dies in the middle of a job; the same command on the next one goes on."""

import pytest

from tests.faults.driver import require_complete, require_one_line, rows
from tests.remote.conftest import await_rows

pytestmark = [pytest.mark.slow, pytest.mark.cluster]


def test_the_same_submission_completes_the_data_set_after_the_head_died(
    head, user, cluster_home, reference
):
    following = user.starts("submit", "generate", "-c", "walks.toml", "--follow")
    await_rows(cluster_home, 8)
    stale = head.token_file.read_text()
    head.power_off()
    kept = len(rows(cluster_home))
    out, err = following.communicate(timeout=120)
    assert following.returncode == 2
    again = "submit again to go on: lmtr submit generate -c walks.toml --follow"
    require_one_line(err, "cannot be reached", "what was committed is kept", again)
    job_id = out.splitlines()[0]

    head.start()
    fresh = head.token_file.read_text()
    head.token_file.write_text(stale)
    require_one_line(user.types("jobs").stderr, "refuses the token", "earlier start")
    head.token_file.write_text(fresh)
    require_one_line(user.types("logs", job_id).stderr, "knows no job", "started anew")

    done = user.types("submit", "generate", "-c", "walks.toml", "--follow")
    assert done.returncode == 0, done.stderr
    assert 8 <= kept < len(reference)
    require_complete(cluster_home, reference)
