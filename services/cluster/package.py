"""Files that travel with a job, as Ray's head takes them: a zip archive known by its content."""

import hashlib
import io
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass

from services.cluster.head import Head
from services.errors import ClusterError

SAME_DAY = (2000, 1, 1, 0, 0, 0)
"""The time of all files, so that the same ones make the same archive."""


@dataclass(frozen=True)
class Package:
    """An archive.

    Attributes:
        content: The zip file.
    """

    content: bytes

    @classmethod
    def of(cls, files: Mapping[str, str]) -> "Package":
        """The archive of files by name, all in one folder."""
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, text in sorted(files.items()):
                archive.writestr(zipfile.ZipInfo(name, SAME_DAY), text.encode())
        return cls(buffer.getvalue())

    @property
    def name(self) -> str:
        """What the head keeps it as."""
        return f"_ray_pkg_{hashlib.sha256(self.content).hexdigest()[:32]}.zip"

    @property
    def uri(self) -> str:
        """What a job calls its working directory by."""
        return f"gcs://{self.name}"

    def upload(self, head: Head) -> None:
        """Give it to the head, if that has it not yet.

        Raises:
            ClusterError: The head does not take it.
        """
        path = f"/api/packages/gcs/{self.name}"
        # Asking also makes the head keep it until a job holds it.
        if head.ask("GET", path).status == 200:
            return
        answer = head.ask("PUT", path, data=self.content)
        if answer.status != 200:
            raise ClusterError(
                f"cluster {head.url}: it does not take the job's files: {answer.reason}; look at "
                "the log of its head, and submit again"
            )
