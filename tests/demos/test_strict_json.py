from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from replication.demos.checks import DemoError
from replication.demos.strict_json import MAX_BYTES, layout, read_content, read_json

VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**15) + 1, 10**15)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(codec="utf-8"), max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["map", "actions", "a"]) | st.text(max_size=2), inner, max_size=3
        )
    ),
    max_leaves=8,
)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b" \n", "is empty"),
        (b"{", "is not JSON: Expecting property name enclosed in dou"),
        (b"{\n \"format\": 'x'}", "is not JSON: Expecting value at line 2, column 12; fix it"),
        (b"{} {}", "is not JSON: Extra data at line 1, column 4"),
        ("{}".encode("utf-16"), "is not UTF-8 text (byte 1); save it as UTF-8"),
        (b'{"a": "\xff"}', "is not UTF-8 text (byte 8)"),
        (b'{"a": 1, "b": {"c": 1, "c": 2}}', "the field 'c' appears twice in one object; keep one"),
        (b'{"a": NaN}', "the number NaN is too large or not finite; write a small number"),
        (b"[-Infinity]", "the number -Infinity is"),
        (b'{"a": 1e999}', "the number 1e999 is too large"),
        (b'{"a": ' + b"9" * 10_000 + b"}", "the number 9999999999"),
        (b"[" * 100_000, "is nested too deeply"),
        (b'{"a":' * 100_000 + b"1" + b"}" * 100_000, "is nested too deeply"),
        (b" " * (MAX_BYTES + 1), "is larger than 10 MB; drop some demos"),
    ],
)
def test_refusals(content: bytes, message: str) -> None:
    """What is not JSON, or not sane JSON, is refused in one line with its place."""
    with pytest.raises(DemoError) as caught:
        read_json(content)
    assert str(caught.value).startswith(message)
    assert str(caught.value).isprintable()


def test_many_fields_are_refused() -> None:
    """An object may have 50 fields and no more."""
    fields = {f"x{i}": i for i in range(51)}
    with pytest.raises(DemoError, match="an object has 51 fields"):
        read_json(json.dumps([fields]).encode())
    del fields["x0"]
    assert read_json(json.dumps([fields]).encode()) == [fields]


def test_a_byte_order_mark_is_ignored() -> None:
    """An editor's byte order mark does no harm."""
    assert read_json(b'\xef\xbb\xbf{"a": "\xc3\xa4"}') == {"a": "ä"}


@given(value=VALUES)
@settings(max_examples=200, deadline=None)
def test_layout_keeps_the_value(value: Any) -> None:
    """Whatever is laid out is read back the same, by the strict reader and by any other."""
    text = layout(value)
    assert json.loads(text) == value
    assert read_json(text.encode()) == value


def test_layout_of_a_file() -> None:
    """Objects' fields, maps' rows and lists of objects take lines of their own, the rest one."""
    value = {"map": ["S.", ".G"], "correct": [{"name": "ä", "states": [[0, 0], [1, 0]]}], "x": []}
    assert layout(value).splitlines() == [
        "{",
        '  "map": [',
        '    "S.",',
        '    ".G"',
        "  ],",
        '  "correct": [',
        "    {",
        '      "name": "ä",',
        '      "states": [[0,0], [1,0]]',
        "    }",
        "  ],",
        '  "x": []',
        "}",
    ]


@given(
    value=VALUES,
    edits=st.lists(st.tuples(st.integers(0, 60), st.integers(0, 4), st.binary(max_size=4))),
)
@settings(max_examples=300, deadline=None)
@example(value=0, edits=[(0, 1, b"1" * 5000)])
@example(value=0, edits=[(0, 1, b"[" * 100_000)])
def test_any_bytes_are_read_as_elsewhere_or_refused(value: Any, edits: Any) -> None:
    """Spliced bytes give what the standard reader gives, or a DemoError, and nothing else."""
    content = layout(value).encode()
    for start, removed, added in edits:
        content = content[:start] + added + content[start + removed :]
    try:
        read = read_json(content)
    except DemoError as error:
        assert str(error).isprintable()  # noqa: PT017 - refusing is one of two right answers
    else:
        assert read == json.loads(content.decode("utf-8-sig"))


def test_refusals_of_paths(tmp_path: Path) -> None:
    """A missing file, a folder, a pipe and a device are refused at once; a file is read."""
    with pytest.raises(DemoError, match=r"cannot be read \(no such file or directory\)"):
        read_content(tmp_path / "none.json")
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path, tmp_path / "pipe", "/dev/zero"):
        with pytest.raises(DemoError, match="is not a regular file"):
            read_content(path)
    with pytest.raises(DemoError, match="cannot be read"):
        read_content("a\0b")
    (tmp_path / "file").write_bytes(b"\r\n\xff")
    assert read_content(tmp_path / "file") == b"\r\n\xff"


def test_large_files_are_not_read_whole(tmp_path: Path) -> None:
    """Of a large file no more is read than shows that it is too large."""
    path = tmp_path / "large.json"
    with path.open("wb") as file:
        file.truncate(100 * MAX_BYTES)
    with pytest.raises(DemoError, match="is larger than 10 MB"):
        read_content(path)


def test_unreadable_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that may not be opened is refused with the system's reason."""
    path = tmp_path / "file.json"
    path.touch()

    def denied(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "open", denied)
    with pytest.raises(DemoError, match=r"cannot be read \(permission denied\)"):
        read_content(path)
