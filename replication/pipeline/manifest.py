"""What came out of a run: a manifest in each notebook's folder, and whether it is up to date.

The manifest `provenance.json` is the same for identical runs. It holds the hashes of everything
that the outputs depend on, and of the outputs. What differs from run to run, such as times, is
recorded in `.runs.json` in the folder above, which is not published.
"""

from __future__ import annotations

import datetime
import importlib.metadata
import json
import platform
import subprocess
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import joblib

from replication import files
from replication.files import read_json, write_file
from replication.pipeline.declaration import EXECUTED, MANIFEST
from replication.pipeline.inputs import Inputs, changes, file_hash, text_hash
from replication.pipeline.notebook import INJECTED

FORMAT, VERSION = "replication-provenance", 2

RUNS = ".runs.json"
"""The runs on this machine, in the folder that holds the notebooks' folders."""

REPORTED = ("matplotlib", "numba", "numpy", "pandas", "pymunk", "scipy")
"""Packages whose versions are named in the manifest; the lock's hash covers all."""

FRESH, STALE, MISSING = "fresh", "stale", "missing"


@dataclass(frozen=True)
class State:
    """Whether outputs are up to date: `kind` is "fresh", "stale" or "missing"; `why` says why."""

    kind: str
    why: tuple[str, ...] = ()


def state_of(folder: Path, inputs: Inputs) -> State:
    """Return whether the outputs in a notebook's folder came from these inputs and are whole."""
    manifest = read_manifest(folder)
    if not manifest:
        if not folder.is_dir() or not any(folder.iterdir()):
            return State(MISSING)
        return State(STALE, ("there is no record of how they were made",))
    lost = damaged(folder, manifest)
    if len(lost) == len(manifest["outputs"]) and set(lost.values()) == {"missing"}:
        return State(MISSING)
    why = changes(manifest["inputs"], inputs) + [f"{name} is {how}" for name, how in lost.items()]
    # a manifest says nothing about a file that it does not name
    unnamed = sorted({*inputs["outputs"], EXECUTED} - manifest["outputs"].keys())
    why += [f"{name} is not in {MANIFEST}" for name in unnamed]
    return State(STALE, tuple(why)) if why else State(FRESH)


def read_manifest(folder: Path) -> dict[str, Any]:
    """Return the manifest of a notebook's folder; empty if there is none that can be used."""
    try:
        document = read_json(folder / MANIFEST)
        inputs = [document["inputs"][part] for part in ("parameters", "data", "source")]
        known = (document["format"], document["version"]) == (FORMAT, VERSION)
        usable = known and all(isinstance(part, dict) for part in [document["outputs"], *inputs])
    except (OSError, ValueError, KeyError, TypeError):
        return {}
    return dict(document) if usable else {}


def published_folders(out: Path) -> dict[str, dict[str, Any]]:
    """Return the manifests of all notebooks' folders in `out`, by name."""
    if not out.is_dir():
        return {}
    manifests = {path.name: read_manifest(path) for path in sorted(out.glob("[!.]*"))}
    return {name: manifest for name, manifest in manifests.items() if manifest}


def write_manifest(folder: Path, inputs: Inputs, names: tuple[str, ...]) -> None:
    """Record what the outputs in a folder came from."""
    save_manifest(
        folder, {"inputs": inputs, "outputs": hashes(folder, names), "versions": versions()}
    )


def save_manifest(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Write a manifest."""
    document = {**manifest, "format": FORMAT, "version": VERSION}
    text = json.dumps(document, indent=1, sort_keys=True, ensure_ascii=False)
    write_file(folder / MANIFEST, text + "\n")


def hashes(folder: Path, names: tuple[str, ...]) -> dict[str, str]:
    """Return the hash of each file, by name."""
    return {name: output_hash(folder / name) for name in sorted(names)}


def output_hash(path: Path) -> str:
    """Return the hash of a published file; of the executed notebook, that of what a run gives.

    These are the outputs of its code cells and the injected parameters. Text, code and the version
    of Python are not among them: text is brought up to date without a run.
    """
    try:
        if path.name != EXECUTED:
            return file_hash(path)
        cells = read_json(path)["cells"]
        given = [
            [
                "".join(cell["source"]) if INJECTED in cell["metadata"].get("tags", ()) else "",
                cell["execution_count"],
                cell["outputs"],
            ]
            for cell in cells
            if cell["cell_type"] == "code"
        ]
    except (ValueError, KeyError, TypeError):
        return "unreadable"
    return text_hash(json.dumps(given, sort_keys=True))


def damaged(
    folder: Path, manifest: Mapping[str, Any], names: Collection[str] | None = None
) -> dict[str, str]:
    """Return those of all or some outputs that are "missing" or "changed" since the run, by name.

    An output that the manifest does not know is no output.
    """
    lost = {}
    for name, expected in manifest["outputs"].items():
        if names is not None and name not in names:
            continue
        if not (folder / name).is_file():
            lost[name] = "missing"
        elif output_hash(folder / name) != expected:
            lost[name] = "changed"
    return lost


def versions() -> dict[str, str]:
    """Return the versions of the packages that are named in the manifest."""
    return {name: importlib.metadata.version(name) for name in REPORTED}


def read_runs(out: Path) -> dict[str, Any]:
    """Return the record of the last run of each notebook on this machine, by name.

    What cannot be read counts as not recorded.
    """
    try:
        runs = dict(read_json(out / RUNS))
    except (OSError, ValueError, TypeError):
        return {}
    return {name: entry for name, entry in runs.items() if _is_run(entry)}


def record_run(out: Path, name: str, seconds: float) -> None:
    """Record a notebook's last run: its time, commit and machine."""
    git = [_git("rev-parse", "HEAD"), _git("status", "--porcelain")]
    entry = {
        "commit": git[0] or "",
        "clean": git[1] == "",
        "machine": f"{platform.system()} {platform.machine()}, {joblib.cpu_count()} cores",
        "seconds": round(seconds, 1),
        "finished": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }
    runs = read_runs(out) | {name: entry}
    write_file(out / RUNS, json.dumps(runs, indent=1, sort_keys=True) + "\n")


def _git(*words: str) -> str | None:
    """Return what git says of the project; None without git."""
    try:
        command = ["git", *words]
        done = subprocess.run(
            command, cwd=files.PROJECT, capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()


def _is_run(entry: Any) -> bool:
    try:
        entry["seconds"] + 0.0
        return datetime.datetime.fromisoformat(entry["finished"]).tzinfo is not None
    except (KeyError, TypeError, ValueError):
        return False
