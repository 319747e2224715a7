"""Files that are never half-written: a draft beside the target replaces it in one step."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path


def write_file(path: str | os.PathLike[str], content: str | bytes) -> Path:
    """Write a whole file or leave what is there; the folder is made when missing.

    Text is written as UTF-8 with the line ends it has.

    Raises
    ------
    OSError
        If the folder or the file cannot be written.
    """
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    data = content.encode() if isinstance(content, str) else content
    with tempfile.TemporaryDirectory(prefix=".draft-", dir=target.parent) as folder:
        draft = Path(folder) / "draft"
        try:
            draft.write_bytes(data)
            draft.replace(target)
        except OSError as error:
            error.filename = str(target)  # a full disk names no file, or the draft
            raise
    return target
