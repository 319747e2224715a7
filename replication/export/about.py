"""The package and the paper as pyproject.toml and CITATION.cff describe them."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import yaml

from replication import files
from replication.errors import UserError
from replication.files import read_text


class ExportError(UserError):
    """Something that keeps what is published from being described; the message is one line."""


@dataclass(frozen=True)
class About:
    """What names the package; `project` is the table of pyproject.toml, `cff` the citation."""

    project: Mapping[str, Any]
    cff: Mapping[str, Any]
    date: str

    @property
    def license(self) -> str:
        """The address of the licence."""
        return f"https://spdx.org/licenses/{self.cff['license']}"

    @property
    def authors(self) -> list[dict[str, str]]:
        """The authors of the package."""
        return [agent(entry) for entry in self.cff["authors"]]

    @property
    def paper(self) -> dict[str, Any]:
        """The paper that is replicated."""
        paper = self.cff["references"][0]
        return {
            "@type": "ScholarlyArticle",
            "author": [agent(entry) for entry in paper["authors"]],
            "headline": paper["title"],
            "name": paper["title"],
        }


def about() -> About:
    """Return what names the package.

    Raises
    ------
    ExportError
        If nothing says when the results were published.
    """
    project = files.read_toml(files.PROJECT / "pyproject.toml")["project"]
    cff = yaml.safe_load(read_text(files.PROJECT / "CITATION.cff"))
    return About(project, cff, str(cff.get("date-released") or committed()))


def agent(entry: Mapping[str, str]) -> dict[str, str]:
    """Return a person or a group of CITATION.cff as schema.org has it.

    Examples
    --------
    >>> agent({"name": "The authors"})
    {'@type': 'Organization', 'name': 'The authors'}
    >>> agent({"given-names": "Ada", "family-names": "Lovelace"})["name"]
    'Ada Lovelace'
    """
    if "name" in entry:
        return {"@type": "Organization", "name": entry["name"]}
    given, family = entry["given-names"], entry["family-names"]
    name = f"{given} {family}"
    return {"@type": "Person", "name": name, "givenName": given, "familyName": family}


def committed() -> str:
    """Return the day of the commit that last changed what is published."""
    command = ["git", "log", "-1", "--format=%cs", "--", "figures"]
    try:
        done = subprocess.run(
            command, cwd=files.PROJECT, capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        done = None
    if done is None or not done.stdout.strip():
        raise ExportError(
            "CITATION.cff: has no date-released, and git does not know when figures/ was "
            "published; add a line such as date-released: 2026-01-31"
        )
    return done.stdout.strip()
