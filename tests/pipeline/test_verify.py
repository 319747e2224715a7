from __future__ import annotations

from importlib import metadata
from pathlib import Path
from typing import Any

from replication.files import PROJECT
from replication.pipeline.plan import prepare
from replication.pipeline.run import run_notebooks
from replication.pipeline.verify import verify_inputs, verify_outputs, verify_packages


def test_outputs_are_held_against_their_manifests(write: Any, project: Path, begun: Any) -> None:
    """Every file that changed or is gone is named, with the folder it is in."""
    out = project / "figures"
    assert "nothing can be proved" in next(verify_outputs(out))
    code = "[(folder / f'{name}.csv').touch() for name in 'abc']"
    path = write(code, data=["a.csv", "b.csv", "c.csv"])
    run_notebooks([path], profile="paper", out=out)
    assert list(verify_outputs(out)) == []
    (out / "toy" / "a.csv").write_text("a")
    (out / "toy" / "b.csv").unlink()
    assert sorted(verify_outputs(out)) == [
        "toy/a.csv is changed since its run",
        "toy/b.csv is missing since its run",
    ]


def test_what_changed_since_is_stale(write: Any, project: Path, begun: Any) -> None:
    """Outputs of other inputs than those of now, of no notebook, or without record are named."""
    out = project / "figures"
    paths = [write(name=name) for name in ("one", "two", "three")]
    run_notebooks(paths, profile="paper", out=out)
    runs = prepare([paths[0], paths[2]], profile="paper", out=out)
    assert list(verify_inputs(prepare(paths, profile="paper", out=out), out)) == []
    (project / "environment.lock").write_text("numpy==3")
    (out / "three" / "provenance.json").write_text("{")
    assert list(verify_inputs([run.again() for run in runs], out)) == [
        "one is stale: environment.lock has changed",
        f"{out / 'three' / 'provenance.json'} is missing or cannot be read",
        "two made outputs, and is no notebook of this project any more",
    ]


# --- packages --------------------------------------------------------------------------------


def test_packages_are_held_against_the_lock(tmp_path: Path) -> None:
    """Another version and a package that is missing are named; other platforms' pins are not."""
    version = metadata.version("numpy")
    lock = tmp_path / "environment.lock"
    lock.write_text(
        f"# a comment\nnumpy=={version} \\\n    --hash=sha256:00 \\\n    --hash=sha256:11\n"
        f"NumPy=={version}\npandas==0.1 ; python_version > '3'\n"
        "no-such-package==1.0\nno-such-other==1 ; sys_platform == 'none'\n    # via numpy\n"
    )
    pandas = metadata.version("pandas")
    assert list(verify_packages(lock)) == [
        f"pandas {pandas} is installed; the lock pins ==0.1",
        "no-such-package is not installed; the lock pins ==1.0",
    ]


def test_the_projects_lock_can_be_read() -> None:
    """Each pin of environment.lock is understood."""
    for said in verify_packages(PROJECT / "environment.lock"):
        assert "the lock pins ==" in said
