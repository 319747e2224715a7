from __future__ import annotations

import json
from importlib import metadata
from pathlib import Path

import pytest

from replication.files import PROJECT
from replication.pipeline.manifest import hashes, read_manifest, save_manifest
from replication.pipeline.plan import Run, prepare
from replication.pipeline.run import run_notebooks
from replication.pipeline.verify import (
    verify_folder,
    verify_outputs,
    verify_packages,
    verify_records,
)
from tests.pipeline.conftest import Write

TRIALS = """
given = os.environ.get("REPLICATION_GIVEN")
trials = Path(given, "trials.csv").read_text() if given else "1,2,3"
(folder / "trials.csv").write_text(trials)
(folder / "sum.csv").write_text(str(sum(map(int, trials.split(",")))))
"""


@pytest.fixture
def out(write: Write, project: Path) -> Path:
    """Publish a notebook that adds up its trials; return the folder of all folders."""
    path = write(TRIALS, data=["sum.csv"], trials=True)
    run_notebooks([path], profile="paper", out=project / "figures", echo=lambda _: None)
    return project / "figures"


def planned(out: Path) -> Run:
    """Return the notebook's run as it is now."""
    (run,) = prepare([out.parent / "notebooks" / "toy.ipynb"], profile="paper", out=out)
    return run


def remade(out: Path, scratch: Path) -> list[str]:
    """Return the files that come out otherwise, and what was said."""
    scratch.mkdir()
    return list(verify_outputs(planned(out), scratch, timeout=600, echo=print))


def forge(path: Path, text: str) -> None:
    """Change a published file, and the manifest with it, as a forger would."""
    path.write_text(text)
    manifest = read_manifest(path.parent)
    save_manifest(path.parent, manifest | {"outputs": hashes(path.parent, (*manifest["outputs"],))})


# --- records ---------------------------------------------------------------------------------


def test_what_was_published_is_sound(out: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing is wrong after a run, and what is made again has the same bytes."""
    run = planned(out)
    assert list(verify_folder([run], out)) == list(verify_records(run)) == []
    assert remade(out, out.parent / "again") == []
    assert (
        capsys.readouterr().out == "toy: made again from trials.csv, 4 files have the same bytes\n"
    )


def test_the_notebook_says_what_should_be_there(out: Path) -> None:
    """What is missing, belongs to no notebook or is no file is named, whatever the manifest has."""
    folder = out / "toy"
    manifest = read_manifest(folder)
    del manifest["outputs"]["sum.csv"]
    save_manifest(folder, manifest)
    (folder / "sum.csv").unlink()
    (folder / "more").mkdir()
    (folder / "more" / "x.csv").touch()
    (folder / "trials.csv").rename(out.parent / "t.csv")
    (folder / "trials.csv").symlink_to(out.parent / "t.csv")
    assert list(verify_records(planned(out))) == [
        "toy/more belongs to no notebook",
        "toy/more/x.csv belongs to no notebook",
        "toy/sum.csv is missing",
        "toy/trials.csv is no regular file",
    ]


def test_files_of_no_notebook_are_named(out: Path) -> None:
    """Beside the notebooks' folders there is their index, and nothing else."""
    (out / "mine.txt").touch()
    (out / "README.md").write_text("# Other figures")
    (out / "toy").rename(out.parent / "elsewhere")
    (out / "toy").symlink_to(out.parent / "elsewhere")
    assert list(verify_folder([planned(out)], out)) == [
        "mine.txt belongs to no notebook",
        "toy is a symbolic link",
        "README.md is not the page that belongs to these folders",
    ]


def test_a_folder_without_record_proves_nothing(out: Path) -> None:
    """A manifest that is damaged or gone, or a folder that is, is one line."""
    manifest = out / "toy" / "provenance.json"
    manifest.write_text("{")
    assert list(verify_records(planned(out))) == ["toy/provenance.json cannot be read"]
    manifest.unlink()
    assert list(verify_records(planned(out))) == ["toy/provenance.json is missing"]
    (out / "toy").rename(out.parent / "elsewhere")
    assert list(verify_records(planned(out))) == ["toy: nothing is published"]


def test_records_are_held_against_the_project(out: Path, project: Path) -> None:
    """Inputs of now, the hashes of the files and the versions of the packages count."""
    (out / "toy" / "sum.csv").write_text("7")
    (project / "environment.lock").write_text("numpy==3")
    manifest = read_manifest(out / "toy")
    manifest["versions"]["numpy"] = "0.1"
    save_manifest(out / "toy", manifest)
    assert list(verify_records(planned(out))) == [
        "toy is stale: environment.lock has changed",
        "toy/sum.csv is changed since its run",
        "toy/provenance.json names other versions of packages than are installed",
    ]


# --- outputs ---------------------------------------------------------------------------------


def test_a_consistent_forgery_of_an_output_is_found(out: Path) -> None:
    """A table that was changed together with its hash does not follow from the trials."""
    forge(out / "toy" / "sum.csv", "7")
    assert list(verify_records(planned(out))) == []
    assert remade(out, out.parent / "again") == [
        "toy/sum.csv has other bytes than its notebook gives",
        "toy/provenance.json has other bytes than its notebook gives",
    ]


def test_other_trials_give_other_outputs(out: Path) -> None:
    """Whoever forges the trials has to forge all that follows from them."""
    forge(out / "toy" / "trials.csv", "1,2,4")
    assert "toy/sum.csv has other bytes than its notebook gives" in remade(out, out.parent / "1")
    forge(out / "toy" / "sum.csv", "7")
    assert remade(out, out.parent / "2") == []


@pytest.mark.parametrize("part", ["source", "outputs", "text"])
def test_an_executed_notebook_is_compared_as_a_whole(out: Path, part: str) -> None:
    """Code, outputs and text of the executed notebook are those of the notebook."""
    path = out / "toy" / "notebook.ipynb"
    document = json.loads(path.read_text())
    code = [cell for cell in document["cells"] if cell["cell_type"] == "code"]
    if part == "source":
        code[-1]["source"] = ["1 + 1"]
    elif part == "outputs":
        code[-1]["outputs"] = []
    else:
        document["cells"][0]["source"] = ["# Toys"]
    forge(path, json.dumps(document))
    assert "toy/notebook.ipynb has other bytes than its notebook gives" in remade(
        out, out.parent / "again"
    )


def test_trials_that_break_the_notebook_are_one_line(out: Path) -> None:
    """If a notebook cannot be executed with its trials, that is what is wrong."""
    forge(out / "toy" / "trials.csv", "one")
    (line,) = remade(out, out.parent / "again")
    assert line.startswith("toy cannot be made again: ")
    assert "invalid literal" in line


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
