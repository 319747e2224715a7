"""Make all that a notebook publishes, in a folder that is not published yet."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from replication.files import write_file
from replication.pipeline.declaration import EXECUTED
from replication.pipeline.folders import store_file
from replication.pipeline.inputs import changes
from replication.pipeline.manifest import write_manifest
from replication.pipeline.notebook import RunError
from replication.pipeline.plan import Run
from replication.pipeline.publish import check_outputs


def store_of(run: Run) -> Path:
    """Return the file in which a run keeps its trials."""
    given = {"store": "build/trials.sqlite", **run.notebook.literals, **run.values}
    return store_file(given["store"], run.out)


def produce(run: Run, stage: Path, *, store: Path, failed: Path, **options: Any) -> None:
    """Execute a notebook and write all that it publishes, the manifest included, into a folder.

    Parameters
    ----------
    run
        What to execute.
    stage
        The folder, which is empty.
    store
        The file of finished trials.
    failed, **options
        Those of :func:`execute.execute`.

    Raises
    ------
    UserError, RunError
        As `execute.execute`; also if the outputs are not those declared, cannot be written, or if
        something that they depend on was edited meanwhile.
    """
    from replication.pipeline import execute  # loads nbformat, which takes a second

    notebook = run.notebook
    folders = {"results": run.out.resolve(), "store": store}
    values = {name: str(path) for name, path in folders.items() if name in notebook.literals}
    shown = {stage.resolve(): run.folder, run.out.resolve(): run.out}
    executed = execute.execute(
        notebook,
        {**run.values, **values},
        stage.resolve(),
        folders=shown,
        failed=failed,
        **options,
    )
    check_outputs(notebook, stage)
    if changed := changes(run.inputs, run.again().inputs):
        reasons = ", ".join(f"{reason} during the run" for reason in changed)
        raise RunError(f"{notebook.path}: {reasons}: nothing is published; run it again")
    try:
        write_file(stage / EXECUTED, executed)
        write_manifest(stage, run.inputs, notebook.published)
    except OSError as error:
        raise unpublished(run, error) from error


def unpublished(run: Run, error: OSError) -> RunError:
    """Return what to raise if a folder cannot be written; the path of a draft would not help."""
    reason = error.strerror or str(error)
    return RunError(f"{run.notebook.path}: cannot publish to {run.out}: {reason}")
