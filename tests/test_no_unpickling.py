"""What comes from others is never unpickled: no code of ours has a function that could."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = [
    file for folder in ("lmtr", "services", "pipelines") for file in (ROOT / folder).rglob("*.py")
]

MODULES = {"pickle", "cloudpickle", "joblib", "dill", "shelve", "marshal"}
"""Modules that run what they read."""

CALLS = {
    *("torch.load", "torch.jit.load", "np.load", "numpy.load", "pd.read_pickle"),
    *("pyfunc.load_model", "mlflow.pyfunc.load_model", "yaml.load", "shutil.unpack_archive"),
    *("eval", "exec", "__import__", "os.system", "os.popen"),
}
"""Functions that do, or may."""


def reaches(source: str) -> set[str]:
    """Which of them a module names."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names} & MODULES
        elif isinstance(node, ast.ImportFrom):
            found |= {(node.module or "").partition(".")[0]} & MODULES
            found |= {f"{node.module}.{alias.name}" for alias in node.names} & CALLS
        elif isinstance(node, ast.Call):
            found |= {ast.unparse(node.func)} & CALLS
            if any(keyword.arg in ("allow_pickle", "shell") for keyword in node.keywords):
                found.add(ast.unparse(node))
    return found


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(ROOT)))
def test_nothing_that_runs_what_it_reads_is_named(file):
    assert reaches(file.read_text(encoding="utf-8")) == set()


@pytest.mark.parametrize(
    "source",
    [
        "import pickle",
        "from joblib import load",
        "from torch import load",
        "import numpy as np\nnp.load(path)",
        "mlflow.pyfunc.load_model(uri)",
        "numpy.lib.format.read_array(file, allow_pickle=True)",
        "subprocess.run(words, shell=True)",
    ],
)
def test_it_would_be_found(source):
    assert reaches(source)
