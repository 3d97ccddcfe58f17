"""Registered models: MLflow's list of what can be loaded by name, a version for each model."""

import tempfile
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from services.tracking.run import reported

if TYPE_CHECKING:
    from mlflow import MlflowClient

ARTIFACT = "replanner"
"""Name of a registered model's files among those of its run."""


@dataclass(frozen=True)
class Servable:
    """What a version of a registered model is made of.

    Attributes:
        data: Folder that the loader reads.
        loader: Module whose ``_load_pyfunc(path)`` gives an object with ``predict``.
        inputs: Numbers in a row of the input, float64.
        outputs: Numbers in a row of the output, float64.
        requirements: What pip would have to install for the loader.
    """

    data: Path
    loader: str
    inputs: int
    outputs: int
    requirements: tuple[str, ...]


class Registry:
    """Registered models of a tracker; made by :attr:`Tracker.registry`."""

    def __init__(self, client: "MlflowClient") -> None:
        self._client = client

    def version_of(self, name: str, key: str, value: str) -> str | None:
        """The version of ``name`` that has this tag, if there is one."""
        with reported(f"registered model {name!r}"):
            found = self._client.search_model_versions(
                f"name = '{name}' AND tags.{key} = '{value}'"
            )
        return str(found[0].version) if found else None

    def register(
        self, name: str, run_id: str, servable: Servable, tags: Mapping[str, str], told: str
    ) -> str:
        """Make a version of ``name`` of files that go to a run; returns its number.

        Args:
            name: The registered model, which is made if need be.
            run_id: Run that made it.
            servable: What it is made of.
            tags: What it is found by.
            told: Description for people.
        """
        with (
            reported(f"registered model {name!r}"),
            tempfile.TemporaryDirectory(prefix="lmtr-register-") as scratch,
        ):
            folder = Path(scratch, ARTIFACT)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # that there is no example of an input
                _save(servable, folder)
            self._client.log_artifacts(run_id, str(folder), ARTIFACT)
            self._require(name)
            place = self._client.get_run(run_id).info.artifact_uri
            made = self._client.create_model_version(
                name, f"{place}/{ARTIFACT}", run_id, tags=dict(tags), description=told
            )
        return str(made.version)

    def _require(self, name: str) -> None:
        """Make the registered model unless it is there, or another process is quicker."""
        from mlflow.exceptions import MlflowException

        try:
            self._client.create_registered_model(name)
        except MlflowException as error:
            if error.error_code != "RESOURCE_ALREADY_EXISTS":
                raise


def _save(servable: Servable, folder: Path) -> None:
    import mlflow.pyfunc
    import numpy as np
    from mlflow.models import ModelSignature
    from mlflow.types import Schema, TensorSpec

    float64 = np.dtype(np.float64)
    mlflow.pyfunc.save_model(
        str(folder),
        loader_module=servable.loader,
        data_path=str(servable.data),
        signature=ModelSignature(
            inputs=Schema([TensorSpec(float64, (-1, servable.inputs))]),
            outputs=Schema([TensorSpec(float64, (-1, servable.outputs))]),
        ),
        # Named, since MLflow would else start a process for each model to find them out.
        pip_requirements=list(servable.requirements),
    )
