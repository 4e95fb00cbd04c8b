"""The door for Dask workers: which of them get the jobs of a batch.

A job asks for a resource that a worker has only if it was admitted: if it runs the batch's version of anglecam and sees
the batch's output folder. The scheduler runs the door on every worker, also on one that joins later.
"""

from __future__ import annotations

import sys
from typing import Any

import cloudpickle  # type: ignore[import-untyped]
import distributed

from anglecam.batch.worker import Settings


class Door(distributed.WorkerPlugin):
    """Gives an admitted worker a resource of the name of the batch's run.

    Parameters
    ----------
    settings : Settings
        The settings of the batch.
    """

    def __init__(self, settings: Settings) -> None:
        self.name = f"anglecam-{settings.run}"
        self._settings = vars(settings)

    def reason(self) -> str | None:
        """Return why the worker that calls this is refused; ``None`` if it is admitted."""
        try:
            from anglecam.batch import worker

            return worker.refusal(worker.Settings(**self._settings))
        except (ImportError, AttributeError, TypeError) as problem:  # no anglecam there, or another version
            return f"another version of anglecam, or none ({problem})"

    async def setup(self, worker: Any) -> None:
        """Admit a worker, or leave it to other programs."""
        if self.reason() is None:
            await worker.set_resources(**{self.name: worker.state.nthreads})

    async def teardown(self, worker: Any) -> None:
        """Take the resource back at the end of the batch."""
        if self.name in worker.state.total_resources:
            await worker.set_resources(**{self.name: 0})

    def refused(self, client: distributed.Client) -> list[str]:
        """Return a line for each worker that is refused."""
        reasons = client.run(self.reason)
        return sorted(f"worker {address} gets no jobs: {why}" for address, why in reasons.items() if why is not None)


# the module itself is sent with its objects: a worker of another version need not have it
cloudpickle.register_pickle_by_value(sys.modules[__name__])
