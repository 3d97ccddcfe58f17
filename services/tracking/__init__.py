"""Experiment tracking with MLflow, embedded: a SQLite file and a folder, no server unless named.

``tracker`` (experiments and runs) → ``run`` (what one run records), ``registry`` (models by name);
``page`` serves MLflow's web page on demand. MLflow itself takes seconds to import and is imported
on first use.
"""

from services.tracking.page import ui_command, ui_environment
from services.tracking.registry import Servable
from services.tracking.tracker import Tracker, is_server

__all__ = ["Servable", "Tracker", "is_server", "ui_command", "ui_environment"]
