"""papermill's engine, mended where a run is interrupted: the kernel ends, and nothing complains."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from nbclient.util import run_sync
from papermill.clientwrap import PapermillNotebookClient
from papermill.engines import NBClientEngine, papermill_engines
from papermill.log import logger

ENGINE = "replication"


class Client(PapermillNotebookClient):
    """Runs the cells of a notebook in a kernel that never outlives them."""

    @contextmanager
    def setup_kernel(self, **kwargs: Any) -> Iterator[None]:
        """Have a kernel; nbclient would leave it behind if its start were interrupted."""
        try:
            with super().setup_kernel(**kwargs):
                yield
        finally:
            if self.km is not None:
                self._cleanup_kernel()

    async def _async_cleanup_kernel(self) -> None:
        # What an interruption left waiting would find the kernel dead, and nobody hears it say so.
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)
        await super()._async_cleanup_kernel()

    _cleanup_kernel = run_sync(_async_cleanup_kernel)


class Engine(NBClientEngine):
    """Runs notebooks by :class:`Client`."""

    @classmethod
    def execute_managed_notebook(
        cls, nb_man: Any, kernel_name: str, *, execution_timeout: int, **options: Any
    ) -> Any:
        """Run a notebook; the options are those of nbclient, and some that papermill adds."""
        for name in ("input_path", "start_timeout", "log_output", "stdout_file", "stderr_file"):
            options.pop(name, None)
        client = Client(
            nb_man, kernel_name=kernel_name, timeout=execution_timeout, log=logger, **options
        )
        return client.execute()


papermill_engines.register(ENGINE, Engine)
