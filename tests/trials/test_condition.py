from __future__ import annotations

import pytest

from replication import DemoError, Demos, Params
from replication.paper.register import ChoiceError
from replication.trials.condition import Condition


def test_methods_see_only_the_demonstrations_they_use(small_demos: Demos) -> None:
    """Without a use for incorrect demonstrations a method is given none; else those asked for."""
    params = Params.of(incorrect="hit+detour")
    assert Condition(small_demos, "unified", params).selected.incorrect == ()
    assert set(Condition(small_demos, "unified-incorrect", params).selected.kinds) == {
        "hit",
        "detour",
    }


def test_unknown_method_and_absent_kind_are_refused(small_demos: Demos) -> None:
    """A condition that could not run is refused when it is made."""
    with pytest.raises(ChoiceError, match="unknown method"):
        Condition(small_demos, "unify", Params())
    with pytest.raises(DemoError, match="detour"):
        Condition(small_demos.select("hit"), "unified-incorrect", Params.of(incorrect="detour"))
