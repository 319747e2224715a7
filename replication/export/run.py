"""A notebook's run: what executed it, what it read and what it published.

When a run took place is not among what is published, so that identical runs give identical files;
hence it has no time.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from replication import files
from replication.errors import compact
from replication.export.entity import Entity, code_entity, file_entity, properties, refs
from replication.files import read_json
from replication.pipeline.declaration import EXECUTED, MANIFEST, TRIALS
from replication.pipeline.index import label, shown_outputs
from replication.pipeline.manifest import read_manifest

FIGURES = "figures"
LOCK = "environment.lock"

KINDS = {".csv": "numbers", ".html": "player", ".md": "table", ".png": "picture", ".svg": "drawing"}
"""What the files of an output are, by suffix."""

SPECIAL = {EXECUTED: "The executed notebook", TRIALS: "All trials, one in a row"}


def run_entities(notebook: str, version: str, agent: Any) -> Iterator[Entity]:
    """Yield a notebook of some version, its run by an agent, and what it read and made."""
    manifest = read_manifest(files.PROJECT / FIGURES / notebook)
    id, place = f"#run/{notebook}", f"{FIGURES}/{notebook}"
    source = _source(notebook) | {"softwareRequirements": refs([LOCK]), "version": version}
    outputs = [_output(notebook, *item) for item in _named(place, manifest["outputs"])]
    record = file_entity(
        f"{place}/{MANIFEST}",
        f"Provenance of {notebook}",
        "Hashes of all that the outputs depend on, and of the outputs",
    )
    given = manifest["inputs"]["parameters"].items()
    parameters = properties(id, {name: {"value": _plain(value)} for name, value in sorted(given)})
    read = [_place(name) for name in sorted(manifest["inputs"]["data"])]
    made = [output["@id"] for output in outputs]
    yield from [source, *outputs, record | {"about": refs([id])}, *parameters]
    yield {
        "@id": f"{place}/",
        "@type": "Dataset",
        "description": f"What the notebook {notebook} published",
        "hasPart": refs([*made, record["@id"]]),
        "name": notebook,
    }
    yield {
        "@id": id,
        "@type": "CreateAction",
        "actionStatus": "http://schema.org/CompletedActionStatus",
        "agent": agent,
        "description": f"Executed {source['@id']} and published what it gave in {place}",
        "instrument": refs([source["@id"]]),
        "name": f"Run of {notebook}",
        "object": refs([*read, LOCK, *(parameter["@id"] for parameter in parameters)]),
        "result": refs(made),
        "subjectOf": refs([record["@id"]]),
    }


def _source(notebook: str) -> Entity:
    name = f"notebooks/{notebook}.ipynb"
    cells = read_json(files.PROJECT / name)["cells"]
    lines = [line for cell in cells for line in "".join(cell["source"]).splitlines()]
    title = next((line[2:] for line in lines if line.startswith("# ")), notebook)
    return code_entity(name, title, f"The notebook {notebook}, as it is executed")


def _named(place: str, names: Mapping[str, str]) -> Iterator[tuple[str, str, str]]:
    """Yield each file that a notebook published, with what readers call it and its words."""
    shown: dict[str, tuple[str, str]] = {}
    for entry, heading in shown_outputs(files.PROJECT / place):
        before = shown.get(entry["name"], ("", ""))
        words = " ".join(entry.get("alt", "").split())
        shown[entry["name"]] = label(entry["name"], heading), words or before[1]
    for name in sorted(names):
        stem = Path(name).stem
        yield name, *shown.get(stem, (stem.replace("_", " "), ""))


def _output(notebook: str, name: str, what: str, words: str) -> Entity:
    """Return a published file; a picture is described in words."""
    suffix = Path(name).suffix
    title = SPECIAL.get(name) or f"{what}: {KINDS.get(suffix, 'file')}"
    other = f"Published by the notebook {notebook}"
    described = words if words and suffix in (".png", ".svg", ".html") else other
    return file_entity(f"{FIGURES}/{notebook}/{name}", title, described)


def _place(name: str) -> str:
    """Return where a file lies that a notebook read: what others published is named from there."""
    return f"{FIGURES}/{name}" if (files.PROJECT / FIGURES / name).is_file() else name


def _plain(value: Any) -> Any:
    """Return a value that is no list or object, of which an entity cannot have any."""
    return value if isinstance(value, str | int | float) else compact(value)
