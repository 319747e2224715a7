"""Files as other programs know them: size, hash and format."""

from __future__ import annotations

import hashlib
from pathlib import PurePosixPath

from replication import files
from replication.files import read_file

FORMATS = {
    ".cff": "application/yaml",
    ".csv": "text/csv",
    ".html": "text/html",
    ".ipynb": "application/x-ipynb+json",
    ".json": "application/json",
    ".md": "text/markdown",
    ".png": "image/png",
    ".py": "text/x-python",
    ".svg": "image/svg+xml",
    ".toml": "application/toml",
}
"""By suffix; everything else is plain text."""


def facts(name: str) -> dict[str, str]:
    """Return the format, the size in bytes and the SHA-256 of a file of the project."""
    return described(name, read_file(files.PROJECT / name))


def described(name: str, content: bytes) -> dict[str, str]:
    """Return the same of a file with some content."""
    return {
        "contentSize": str(len(content)),
        "encodingFormat": FORMATS.get(PurePosixPath(name).suffix, "text/plain"),
        "sha256": hashlib.sha256(content).hexdigest(),
    }
