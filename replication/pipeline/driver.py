"""The process that executes one notebook: papermill, and a kernel that does not outlive it.

`python -m replication.pipeline.driver FOLDER` reads FOLDER/options.json, the arguments of
papermill, and leaves the executed notebook. An error of a cell is in that notebook; anything else
that went wrong is in FOLDER/fault.json.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from pathlib import Path
from typing import Any

import papermill
import psutil
from papermill.exceptions import PapermillExecutionError

STARTS = 3
"""Attempts at starting a kernel: now and then another program takes its port."""


def main(folder: Path) -> None:
    """Execute the notebook that the options in a folder name."""
    options: dict[str, Any] = json.loads((folder / "options.json").read_text(encoding="utf-8"))
    threading.Thread(target=_end_with, args=(options.pop("parent"),), daemon=True).start()
    begun: list[int] = []
    for attempt in range(1, STARTS + 1):
        try:
            papermill.execute_notebook(
                **options,
                on_cell_execute=lambda cell, cell_index: begun.append(cell_index),
                progress_bar=False,
                log_output=False,
                iopub_timeout=60,
                shutdown_kernel="immediate",
                record_timing=False,
                coalesce_streams=True,  # where a stream is cut depends on the time
            )
        except PapermillExecutionError:
            pass
        except Exception as error:
            if not begun and attempt < STARTS:
                continue
            cell = begun[-1] if begun else None
            fault = {"cell": cell, "kind": type(error).__name__, "message": str(error)}
            (folder / "fault.json").write_text(json.dumps(fault), encoding="utf-8")
        return


def _end_with(parent: int) -> None:
    """End this process and its kernel soon after the process that started it was killed."""
    while os.getppid() == parent:
        time.sleep(0.2)
    for child in psutil.Process().children(recursive=True):
        child.kill()
    os._exit(1)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
