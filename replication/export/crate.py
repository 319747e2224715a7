"""The published runs as an RO-Crate 1.2 of the profile Process Run Crate 0.5.

Each notebook is a tool, and its run an action that made the published files. That profile fits
since the notebooks are no steps of one workflow: each can be run alone, and what it needs of others
it reads from their published files.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from replication.export.about import About
from replication.export.entity import (
    PYTHON,
    Entity,
    code_entity,
    file_entity,
    ids_in,
    refs,
    types_of,
)
from replication.export.facts import facts
from replication.export.run import LOCK, run_entities
from replication.export.verdicts import CRITERIA, FROZEN, PAPER, claim_entities

METADATA = "ro-crate-metadata.json"
CONTEXT = "https://w3id.org/ro/crate/1.2/context"
CRATE = "https://w3id.org/ro/crate/1.2"
PROFILE = "https://w3id.org/ro/wfrun/process/0.5"

DOCUMENTS = {
    "CITATION.cff": "How to cite the package and the paper",
    "LICENSE": "The licence of everything here",
    "codemeta.json": "The package, as CodeMeta",
    "croissant.json": "The trials and the demonstrations, as Croissant",
    "figures/README.md": "A list of all figures, tables and data files",
    LOCK: "The environment: every package by version and hash",
    "pyproject.toml": "The package and what it needs",
}
"""Files beside those that the runs read and write."""

MENTIONED = ("CreateAction", "Claim", "ClaimReview")


def crate(about: About, names: Sequence[str], made: Mapping[str, Mapping[str, str]]) -> Entity:
    """Return the description of the runs of some notebooks.

    Parameters
    ----------
    about
        What names the package.
    names
        The notebooks.
    made
        The :func:`~replication.export.facts.facts` of files that are made for the export, by name.
    """
    people = _people(about)
    authors = _ids_of(people, about.authors)
    parts = list(_parts(names, about.project["version"], authors))
    others = [
        *people.values(),
        *claim_entities(authors),
        *_names(about),
        about.paper | {"@id": PAPER, "author": _ids_of(people, about.paper["author"])},
    ]
    entities = {entity["@id"]: entity for entity in [*parts, *others]}
    for name in payload(parts):
        entities[name] |= made.get(name) or facts(name)
    head = [_descriptor(), _root(about, authors, parts, others)]
    return {"@context": CONTEXT, "@graph": [*head, *(entities[id] for id in sorted(entities))]}


def payload(entities: Iterable[Entity]) -> list[str]:
    """Return the names of the files among some entities."""
    return sorted({entity["@id"] for entity in entities if "File" in types_of(entity)})


def _parts(names: Sequence[str], version: str, agent: Any) -> Iterator[Entity]:
    """Yield the runs, and all files."""
    runs = [entity for name in names for entity in run_entities(name, version, agent)]
    read = {id for run in runs if "object" in run for id in ids_in(run["object"])}
    known = {*DOCUMENTS, *payload(runs)}
    yield from runs
    for name, words in DOCUMENTS.items():
        yield file_entity(name, Path(name).name, words)
    for name in FROZEN[1:]:
        words = "Source that decides on the verdicts, frozen with the criteria"
        yield code_entity(name, Path(name).name, words) | {"version": version}
    for name in sorted({*read, FROZEN[0]} - known):
        if not name.startswith("#"):
            yield file_entity(name, Path(name).name, "Read by the notebooks")


def _names(about: About) -> Iterator[Entity]:
    """Yield the licence, the language and the profile of the crate."""
    yield {
        "@id": about.license,
        "@type": "CreativeWork",
        "description": f"The {about.cff['license']} licence",
        "name": about.cff["license"],
    }
    yield {
        "@id": PYTHON,
        "@type": "ComputerLanguage",
        "name": "Python",
        "url": "https://www.python.org/",
        "version": about.project["requires-python"],
    }
    yield {
        "@id": PROFILE,
        "@type": ["CreativeWork", "Profile"],
        "name": "Process Run Crate",
        "version": "0.5",
    }


def _descriptor() -> Entity:
    return {
        "@id": METADATA,
        "@type": "CreativeWork",
        "about": refs(["./"]),
        "conformsTo": refs([CRATE]),
        "encodingFormat": "application/ld+json",
        "name": "Description of the crate",
    }


def _root(about: About, authors: Any, parts: Sequence[Entity], others: Sequence[Entity]) -> Entity:
    contained = {id for part in parts for id in ids_in(part.get("hasPart", []))}
    data = {part["@id"] for part in parts if {"File", "Dataset"} & {*types_of(part)}}
    mentioned = [each["@id"] for each in [*parts, *others] if each["@type"] in MENTIONED]
    return {
        "@id": "./",
        "@type": "Dataset",
        "about": refs([PAPER]),
        "author": authors,
        "conformsTo": refs([PROFILE]),
        "datePublished": about.date,
        "description": f"{about.project['description']}: what was run, on what and with which "
        "results, and a verdict on each of the paper's claims.",
        "hasPart": refs(sorted(data - contained)),
        "keywords": about.project["keywords"],
        "license": refs([about.license]),
        "mentions": refs([*mentioned, CRITERIA]),
        "name": about.cff["title"],
        "publisher": authors,
        "version": about.project["version"],
    }


def _people(about: About) -> dict[str, Entity]:
    """Return the authors of the paper and the package, by name."""
    everyone = [*about.authors, *about.paper["author"]]
    return {
        each["name"]: {"@id": f"#{each['name'].lower().replace(' ', '-')}", **each}
        for each in everyone
    }


def _ids_of(people: Mapping[str, Entity], named: Iterable[Mapping[str, str]]) -> Any:
    return refs(people[each["name"]]["@id"] for each in named)
