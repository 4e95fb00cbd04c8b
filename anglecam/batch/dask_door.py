"""The door for Dask workers: which of them get the jobs of a batch.

A job asks for a resource that a worker has only if it was admitted: if it runs the batch's version of anglecam and sees
the batch's output folder. The scheduler runs the door on every worker, also on one that joins later.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import distributed

from anglecam.batch.worker import Settings


def name_of(settings: Settings) -> str:
    """Return the name of the resource that admitted workers have."""
    return f"anglecam-{settings.run}"


def reason_to_refuse(settings: Settings) -> Callable[[], str | None]:
    """Return a function that states on a worker why it is refused; ``None`` if it is admitted.

    It is defined here because Dask sends a local function by its content: a worker of another version need not have
    this module.
    """
    values = vars(settings)

    def reason() -> str | None:
        try:
            from anglecam.batch import worker

            return worker.refusal(worker.Settings(**values))
        except (ImportError, AttributeError, TypeError) as problem:  # no anglecam there, or another version
            return f"another version of anglecam, or none ({problem})"

    return reason


def door(settings: Settings) -> distributed.WorkerPlugin:
    """Return the plugin that gives an admitted worker the resource; a local class, for the same reason."""
    resource, reason = name_of(settings), reason_to_refuse(settings)

    class Door(distributed.WorkerPlugin):
        name = resource

        async def setup(self, worker: Any) -> None:
            if reason() is None:
                await worker.set_resources(**{resource: worker.state.nthreads})

        async def teardown(self, worker: Any) -> None:
            if resource in worker.state.total_resources:
                await worker.set_resources(**{resource: 0})

    return Door()


def refused(client: distributed.Client, settings: Settings) -> list[str]:
    """Return a line for each worker that is refused."""
    reasons = client.run(reason_to_refuse(settings), on_error="return")  # a worker may end before it answers
    return sorted(f"worker {address} gets no jobs: {why}" for address, why in reasons.items() if why is not None)
