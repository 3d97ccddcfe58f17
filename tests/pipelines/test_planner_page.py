"""The example of docs/planner.md runs on an exported replanner."""

import re
from pathlib import Path

from pipelines.workspace import Workspace


def test_the_example_of_the_page_runs(lmtr, tiny_home, tmp_path, capsys):
    page = (Path(__file__).parents[2] / "docs" / "planner.md").read_text(encoding="utf-8")
    rows = Workspace.open(tiny_home, create=False).lake.read("models", ["model_id", "latent"])
    (model_id,) = (row["model_id"] for row in rows.to_pylist() if row["latent"] == 2)
    out = tmp_path / "planner"
    status, _, err = lmtr("export", "replanner", model_id, "-o", out, "--home", tiny_home)
    assert status == 0, err
    (example,) = re.findall(r"```python\n(.*?)```", page, re.S)
    exec(example.replace('Path("planner")', f"Path({str(out)!r})"), {})
    promised = re.search(r"prints `(.*)`", page).group(1)
    assert capsys.readouterr().out.strip().splitlines()[-1] == promised
