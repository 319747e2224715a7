"""Check that environment.lock holds hashed pins only and meets every requirement of pyproject.toml.

It reads these two files and nothing else; whether the pins fit each other is for `make lock`.
"""

import re
import sys
import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

PYTHONS = ("3.11", "3.12", "3.13")
UNLOCKED = ("croissant", "wasm")  # extras that are not locked, pyproject.toml says why
PIN = re.compile(r"([\w-]+==[\w.!+]+(?: ; [^@]+?)?)((?: --hash=sha256:[0-9a-f]{64})+)")


def read_pins(lock: str) -> list[Requirement]:
    """Return the pins in the text of a lock.

    Raises
    ------
    ValueError
        On an entry that is not ``name==version [; marker] --hash=...``: an option, an address, a
        path, a pin without hashes.
    """
    code = re.sub(r"^\s*#.*\n", "", lock, flags=re.MULTILINE)
    pins = []
    for entry in re.sub(r"\s*\\\n\s*", " ", code).splitlines():
        match = PIN.fullmatch(entry)
        if match is None:
            raise ValueError(f"not a pin with hashes: {entry[:80]}")
        pins.append(Requirement(match[1]))
    return pins


def read_requirements(project: str) -> list[Requirement]:
    """Return what the text of a pyproject.toml asks for: to build, to run and for each extra."""
    table = tomllib.loads(project)
    extras = table["project"].get("optional-dependencies", {})
    locked = [texts for extra, texts in extras.items() if extra not in UNLOCKED]
    groups = [table["build-system"]["requires"], table["project"]["dependencies"], *locked]
    return [Requirement(text) for group in groups for text in group]


def unmet(requirements: list[Requirement], pins: list[Requirement], python: str) -> list[str]:
    """Return the requirements that no pin meets on one version of Python, such as "3.12"."""
    environment = {"python_version": python, "python_full_version": f"{python}.0"}

    def applies(requirement: Requirement) -> bool:
        return requirement.marker is None or requirement.marker.evaluate(environment)

    versions = {
        canonicalize_name(pin.name): next(iter(pin.specifier)).version
        for pin in filter(applies, pins)
    }

    def met(wanted: Requirement) -> bool:
        version = versions.get(canonicalize_name(wanted.name))
        return version is not None and wanted.specifier.contains(version)

    return [str(wanted) for wanted in filter(applies, requirements) if not met(wanted)]


def main() -> str | None:
    """Return what is wrong, in one line, or None."""
    try:
        pins = read_pins(Path("environment.lock").read_text())
    except ValueError as error:
        return f"error: environment.lock: {error}; run `make lock`"
    requirements = read_requirements(Path("pyproject.toml").read_text())
    for python in PYTHONS:
        if missing := ", ".join(unmet(requirements, pins, python)):
            return f"error: environment.lock lacks {missing} (Python {python}); run `make lock`"
    print(f"environment.lock: {len(pins)} pins meet the {len(requirements)} requirements")
    return None


if __name__ == "__main__":
    sys.exit(main())
