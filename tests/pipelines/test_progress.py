"""Progress: pieces under way have lines of their own, in a terminal and in a log."""

import io

import pytest
from rich.console import Console

from pipelines import progress


@pytest.fixture
def output(monkeypatch, request):
    """What is shown, in a terminal or in a log."""
    file = io.StringIO()
    console = Console(file=file, force_terminal=request.param, width=160, highlight=False)
    monkeypatch.setattr(progress, "console", console)
    monkeypatch.setattr(progress, "LOG_EVERY_S", -1.0)
    return file


def two_models() -> None:
    """Two models side by side, of which one is done before the end."""
    with progress.bar("Training, epochs", 20) as bar:
        bar.piece("LMTR-2 seed 0", 4, 10, "loss 0.5")
        bar.piece("LMTR-2 seed 1", 1, 10)
        bar.advance(5, "0 of 2 models done")
        bar.piece("LMTR-2 seed 1", 2, 10)
        bar.drop("LMTR-2 seed 0")
        bar.drop("never heard of")
        bar.advance(7, "1 of 2 models done")


@pytest.mark.parametrize("output", [False], indirect=True)
def test_a_log_names_what_is_under_way(output):
    two_models()
    assert output.getvalue().splitlines() == [
        "Training, epochs: 5/20 LMTR-2 seed 0 4/10 loss 0.5; LMTR-2 seed 1 1/10; "
        "0 of 2 models done",
        "Training, epochs: 12/20 LMTR-2 seed 1 2/10; 1 of 2 models done",
    ]


@pytest.mark.parametrize("output", [True], indirect=True)
def test_a_terminal_shows_a_line_for_each(output):
    two_models()
    last_frame = output.getvalue().rpartition("Training, epochs")[2]
    for shown in ("12/20", "1 of 2 models done", "LMTR-2 seed 1", "2/10"):
        assert shown in last_frame
    assert "LMTR-2 seed 0" not in last_frame
    assert "4/10" in output.getvalue()
