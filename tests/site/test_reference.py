from __future__ import annotations

from typing import Any

from replication.demos.environments import MazeFields
from replication.site.reference import _shorten, _skip_fields, source_of


def test_the_code_of_an_object_is_a_file() -> None:
    """An address leads to the module's text and to the object; what is not ours has none."""
    info = {"module": "replication.site.reference", "fullname": "source_of"}
    assert source_of("py", info) == (
        "code/replication/site/reference.py.txt#:~:text=def%20source_of&text=class%20source_of"
    )
    package = source_of("py", {"module": "replication.site", "fullname": "x"}) or ""
    assert package.startswith("code/replication/site/__init__.py.txt#")
    assert source_of("py", {"module": "numpy", "fullname": "array"}) is None


def test_pydantic_models_are_shown_without_their_machinery() -> None:
    """Their arguments and settings are left out; other signatures and members stay."""
    app: Any = None
    assert _shorten(app, "class", "x", MazeFields) == ("", None)
    assert _shorten(app, "function", "x", source_of) is None
    assert _skip_fields(app, "class", "model_config", {}, False, None) is True
    assert _skip_fields(app, "class", "build", source_of, False, None) is None
