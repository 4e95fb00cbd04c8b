"""The output folder: where a batch keeps its database, its lock and its unfinished files, below ``DIR/.anglecam``.

Every file is made in a separate folder, ``.anglecam/unfinished/RUN``, and then moved. A file under its final name is
therefore whole, and everything that a killed batch leaves behind lies in one place, which the next batch clears.
"""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from pathlib import Path

from anglecam.batch.records import key


@dataclass(frozen=True)
class OutputFolder:
    """The paths inside an output folder."""

    path: Path
    """The output folder, absolute."""

    @property
    def lock_file(self) -> Path:
        """The file whose lock keeps a second batch out."""
        return self.path / ".anglecam" / "lock"

    @property
    def run_file(self) -> Path:
        """The file that names the process and the run that hold the lock."""
        return self.path / ".anglecam" / "run"

    @property
    def database_file(self) -> Path:
        """The SQLite database of job records."""
        return self.path / ".anglecam" / "batch.sqlite"

    def unfinished(self, run: str = "") -> Path:
        """Return the folder in which the results of a run are made; without a run, the folder of all runs."""
        return self.path / ".anglecam" / "unfinished" / run

    def cached_series(self, address: str) -> str:
        """Return where a clip's series is cached for the fit of its session, relative to the output folder."""
        return f".anglecam/series/{key(address)}.nc"

    def clear_unfinished(self) -> None:
        """Remove what earlier runs have left behind."""
        shutil.rmtree(self.unfinished(), ignore_errors=True)

    def has(self, files: dict[str, int]) -> bool:
        """Return whether all files exist with the stated sizes, in bytes; paths are relative to the output folder."""
        try:
            return all((self.path / file).stat().st_size == size for file, size in files.items())
        except OSError:
            return False

    def write(self, content: bytes, path: Path, run: str) -> None:
        """Write a file in the run's unfinished folder and move it to its path, so that it appears whole or not at all.

        Parameters
        ----------
        content : bytes
            The file's content.
        path : Path
            The file.
        run : str
            The run.

        Raises
        ------
        OSError
            If the file cannot be written.
        """
        self.unfinished(run).mkdir(parents=True, exist_ok=True)
        path.parent.mkdir(parents=True, exist_ok=True)
        made = self.unfinished(run) / f"{path.name}.{os.urandom(4).hex()}"
        try:
            made.write_bytes(content)
            made.replace(path)
        finally:
            made.unlink(missing_ok=True)
