"""What people see of a cluster in a browser: Ray's dashboard with the token, and MLflow's runs."""

import os
import shutil
from pathlib import Path

import pytest

from tests.docker.conftest import MODELS, SOLUTIONS, command
from tests.docker.recorded_runs import metrics, tags

pytestmark = [pytest.mark.slow, pytest.mark.cluster]

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
PATIENCE_MS = 60_000.0
"""Both pages load megabytes of scripts, which a busy machine takes its time for."""

LINE = ".js-plotly-plot .scatterlayer path.js-line"
"""The line of a chart, which MLflow fetches and draws after its title."""

SCREENSHOTS = "LMTR_SCREENSHOTS"
"""Environment variable with a folder for screenshots, to be looked at."""


@pytest.fixture(scope="module")
def page():
    """A page of a browser without a window."""
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed; pip install -e '.[browser]'"
    )
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        pytest.skip(f"no browser is installed: none of {', '.join(BROWSERS)}")
    with playwright.sync_playwright() as driver:
        # Root has no sandbox; the pages come from our own containers.
        browser = driver.chromium.launch(executable_path=program, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        page.set_default_timeout(PATIENCE_MS)
        yield page
        browser.close()


@pytest.fixture(scope="module")
def screenshot(page, tmp_path_factory):
    """Takes pictures under a name."""
    folder = Path(os.environ.get(SCREENSHOTS) or tmp_path_factory.mktemp("screenshots"))

    def take(name):
        page.screenshot(path=folder / f"{name}.png")

    return take


@pytest.fixture(scope="module")
def trained(containers, reference):
    """Runs of a training that the cluster made."""
    for stage in ("segment", "train"):
        job = containers.finish(containers.submit(command(stage, "/data/reference")))
        assert job.status == "SUCCEEDED", containers.log(job.id)[-3000:]
    return containers.runs("training")


def test_rays_dashboard_is_seen_with_the_token_alone(containers, trained, page, screenshot):
    page.goto(f"http://127.0.0.1:{containers.ports[0]}/#/jobs")
    field = page.get_by_placeholder("Enter your authentication token")
    field.fill("0" * 64)
    page.get_by_role("button", name="Submit").click()
    page.get_by_text("Invalid authentication token").wait_for()
    assert "lmtr --home" not in page.inner_text("body")
    screenshot("dashboard-refused")
    field.fill(containers.token)
    page.get_by_role("button", name="Submit").click()
    page.get_by_text("lmtr --home /data/reference train").first.wait_for()
    screenshot("dashboard-jobs")
    page.goto(f"http://127.0.0.1:{containers.ports[0]}/#/cluster")
    for name in containers.names("head") + containers.names("worker"):
        address = containers.address(name)
        page.get_by_text(address).first.wait_for()
    screenshot("dashboard-nodes")


def test_mlflow_shows_what_the_cluster_made(containers, trained, page, screenshot):
    server = f"http://127.0.0.1:{containers.ports[1]}"
    (experiment,) = {run["info"]["experiment_id"] for run in trained}
    page.goto(f"{server}/#/experiments/{experiment}/runs?workflowType=machine_learning")
    for run in trained:
        if "mlflow.parentRunId" not in tags(run):  # those of a sweep are folded into it
            page.get_by_text(run["info"]["run_name"]).first.wait_for()
    screenshot("mlflow-runs")
    info = next(run["info"] for run in trained if run["info"]["run_name"].startswith("LMTR"))
    page.goto(f"{server}/#/experiments/{experiment}/runs/{info['run_id']}/model-metrics")
    page.get_by_placeholder("Search metric charts").fill("train.loss")
    page.get_by_text("train.loss", exact=True).first.wait_for()
    page.locator(LINE).first.wait_for()
    screenshot("mlflow-metrics")
    page.goto(f"{server}/#/experiments/{experiment}/runs/{info['run_id']}/artifacts")
    page.get_by_text("learning.png").first.click()
    page.locator("img[src^='blob:'], .image-outer-container img, canvas").first.wait_for()
    screenshot("mlflow-files")
    assert {run["info"]["run_name"].split(" seed")[0] for run in trained} >= MODELS
    made = containers.runs("generation")
    (generation,) = [run for run in made if tags(run).get("home") == "/data/reference"]
    assert metrics(generation)["committed"] == SOLUTIONS
