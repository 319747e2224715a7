from __future__ import annotations

import hashlib

from replication.export.facts import described


def test_a_file_is_known_by_its_bytes() -> None:
    """Size and hash are those of the content, the format is that of the suffix."""
    assert described("a/b.csv", b"x,y\n") == {
        "contentSize": "4",
        "encodingFormat": "text/csv",
        "sha256": hashlib.sha256(b"x,y\n").hexdigest(),
    }
    assert described("LICENSE", b"")["encodingFormat"] == "text/plain"
