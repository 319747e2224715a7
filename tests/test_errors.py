from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from replication.errors import clip, compact, show, unknown


def test_near_miss_is_suggested() -> None:
    """An unknown name is answered with the nearest known one, and with all of them."""
    message = unknown("aplha", ["alpha", "beta"], "parameter")
    assert message == ("unknown parameter 'aplha' (did you mean 'alpha'?); known: alpha, beta")
    assert "did you mean" not in unknown("xyz", ["alpha", "beta"], "parameter")


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    )
)
def test_any_value_is_shown_in_a_few_words(value: Any) -> None:
    """Whatever a file may hold is named in one printable line of at most 60 characters."""
    shown = show(value)
    assert shown.isprintable()
    assert 0 < len(shown) <= 60


def test_words() -> None:
    """Texts are cut to their length, JSON is compact."""
    assert clip("abcdefgh", 6) == "abc..."
    assert clip("abcdef", 6) == "abcdef"
    assert compact({"a": [1, "ä"]}) == '{"a":[1,"ä"]}'
