"""The trials and the demonstrations as Croissant 1.1."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from typing import Any

from replication import files
from replication.export.about import About
from replication.export.columns import TEXT, column
from replication.export.facts import facts
from replication.files import read_text
from replication.pipeline.declaration import TRIALS

CROISSANT = "http://mlcommons.org/croissant/1.1"

LANGUAGE = {"@container": "@language"}
TERMS = (
    *("arrayShape", "citeAs", "column", "containedIn", "equivalentProperty", "extract", "field"),
    *("fileProperty", "fileObject", "fileSet", "format", "includes", "isArray", "isLiveDataset"),
    *("jsonPath", "key", "md5", "parentField", "path", "recordSet", "references", "regex"),
    *("repeated", "replace", "samplingRate", "separator", "source", "subField", "transform"),
)
CONTEXT = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "conformsTo": "dct:conformsTo",
    "cr": "http://mlcommons.org/croissant/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "description": LANGUAGE,
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "name": LANGUAGE,
    "rai": "http://mlcommons.org/croissant/RAI/",
    "sc": "https://schema.org/",
    **{term: f"cr:{term}" for term in TERMS},
}
"""The context that the standard prescribes."""

PARTS = ("correct", "incorrect")
"""The lists of a file of demonstrations.

Each has a file object of its own: mlcroissant reads all that is extracted from one as columns of
one table, so that they would have to be equally long.
"""

SHOWN = {
    "name": "Name of the demonstration",
    "kind": "Kind of the mistake",
    "actions": "The actions, in order",
}
"""The fields of a demonstration; one that is correct has no kind."""


def croissant(about: About, names: Sequence[str]) -> dict[str, Any]:
    """Return the description of the published tables of trials, and of data/demos."""
    tables = [name for name in names if (files.PROJECT / f"figures/{name}/{TRIALS}").is_file()]
    demos = sorted(
        path.stem
        for path in (files.PROJECT / "data" / "demos").glob("*.json")
        if path.name != "schema.json"
    )
    return {
        "@context": CONTEXT,
        "@type": "sc:Dataset",
        "citeAs": f"{about.cff['title']}, version {about.cff['version']}",
        "conformsTo": CROISSANT,
        "creator": about.authors,
        "datePublished": about.date,
        "description": "Every trial of the replication, a row each, with its seed, its measures "
        "and a digest of its bits; and the demonstrations from which the methods learn.",
        "distribution": [
            *(_file(f"figures/{name}/{TRIALS}") for name in tables),
            *(_file(f"data/demos/{name}.json", f"#{part}") for name in demos for part in PARTS),
        ],
        "keywords": about.project["keywords"],
        "license": about.license,
        "name": about.project["name"],
        "recordSet": [*map(_trials, tables), *(each for name in demos for each in _demos(name))],
        "version": about.project["version"],
    }


def _file(name: str, part: str = "") -> dict[str, Any]:
    known = facts(name)
    size = {"contentSize": f"{known['contentSize']} B"}
    names = {"@id": f"{name}{part}", "contentUrl": name, "name": f"{name}{part}"}
    return {"@type": "cr:FileObject", **names, **known, **size}


def _trials(name: str) -> dict[str, Any]:
    """Return the records of a table of trials."""
    file = f"figures/{name}/{TRIALS}"
    header = next(csv.reader(io.StringIO(read_text(files.PROJECT / file))))
    return {
        "@id": name,
        "@type": "cr:RecordSet",
        "description": f"The trials of the notebook {name}",
        "field": [
            _field(name, each, *column(each), {"fileObject": file, "extract": {"column": each}})
            for each in header
        ],
        "name": name,
    }


def _demos(name: str) -> Iterator[dict[str, Any]]:
    """Yield the records of a file of demonstrations: the correct ones and the incorrect ones."""
    for part in PARTS:
        id = f"{name}-{part}"
        fields = []
        for each, words in SHOWN.items():
            if (part, each) != ("correct", "kind"):
                file = f"data/demos/{name}.json#{part}"
                source = {"fileObject": file, "extract": {"jsonPath": f"$.{part}[*].{each}"}}
                fields.append(_field(id, each, TEXT, words, source))
        yield {
            "@id": id,
            "@type": "cr:RecordSet",
            "description": f"The {part} demonstrations of the task {name}",
            "field": fields,
            "name": id,
        }


def _field(
    records: str, name: str, kind: str, words: str, source: dict[str, Any]
) -> dict[str, Any]:
    shape = {"isArray": True, "arrayShape": "-1"} if name == "actions" else {}
    return {
        "@id": f"{records}/{name}",
        "@type": "cr:Field",
        "dataType": kind,
        "description": words,
        "name": name,
        "source": source | {"fileObject": {"@id": source["fileObject"]}},
        **shape,
    }
