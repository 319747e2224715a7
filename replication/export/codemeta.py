"""The package as CodeMeta 3.0."""

from __future__ import annotations

from typing import Any

from packaging.requirements import Requirement

from replication.export.about import About

CONTEXT = "https://w3id.org/codemeta/3.0"


def codemeta(about: About) -> dict[str, Any]:
    """Return the description of the package."""
    project = about.project
    return {
        "@context": CONTEXT,
        "@type": "SoftwareSourceCode",
        "author": about.authors,
        "dateModified": about.date,
        "description": project["description"],
        "keywords": project["keywords"],
        "license": about.license,
        "name": project["name"],
        "operatingSystem": ["Linux", "macOS"],
        "programmingLanguage": {"@type": "ComputerLanguage", "name": "Python"},
        "referencePublication": about.paper,
        "runtimePlatform": f"Python {project['requires-python']}",
        "softwareRequirements": [_requirement(text) for text in project["dependencies"]],
        "version": project["version"],
    }


def _requirement(text: str) -> dict[str, str]:
    needed = Requirement(text)
    version = {"version": str(needed.specifier)} if needed.specifier else {}
    return {"@type": "SoftwareApplication", "name": needed.name, **version}
