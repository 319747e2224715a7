from __future__ import annotations

import re
from importlib import import_module

import pytest

from replication.baselines import BASELINES, find_method
from replication.files import PROJECT
from replication.irl import METHODS
from replication.paper.params import Update
from replication.paper.register import ChoiceError

EVERY = [*METHODS.values(), *BASELINES.values()]
PAGE = PROJECT / "docs" / "methods.md"


def test_each_method_can_be_told_from_the_others() -> None:
    """Names, labels and colours are all different, those of the paper's methods included."""
    for told in ("name", "label", "colour"):
        values = [getattr(method, told).lower() for method in EVERY]
        assert len(set(values)) == len(values)
    assert all(re.fullmatch("#[0-9A-F]{6}", method.colour) for method in EVERY)
    assert all(re.fullmatch("[a-z]+(-[a-z]+)*", method.name) for method in EVERY)
    assert [*METHODS, *BASELINES] == [method.name for method in EVERY]


def test_each_says_what_it_makes_of_incorrect_demonstrations() -> None:
    """It is one of three; whoever needs some uses some."""
    for method in EVERY:
        assert method.use in ("nothing", "marked pairs", "whole trajectories")
        assert method.uses_incorrect == (method.use != "nothing")
    assert all(method.uses_incorrect for method in BASELINES.values() if method.needs_incorrect)
    assert all(method.baseline in ("", *METHODS, *BASELINES) for method in EVERY)


def test_each_begins_with_a_memory() -> None:
    """A memory has the shape of the table, or holds several such; by default it is empty."""
    for method in EVERY:
        assert method.start((3, 2), Update()).shape[-2:] == (3, 2)
    assert not BASELINES["mwal"].start((3, 2), Update()).any()


@pytest.mark.parametrize("name", [name for name in BASELINES if name != "cloning"])
def test_each_is_what_the_module_of_its_name_computes(name: str) -> None:
    """A method without a loop has its module's search; any other its update, and its start."""
    method, module = (
        BASELINES[name],
        import_module(f"replication.baselines.{name}".replace("-", "_")),
    )
    assert method.find is getattr(module, "find", None)
    for part in ("start", "update"):
        assert getattr(method, part) is getattr(module, part, getattr(BASELINES["cloning"], part))


def test_a_misspelt_method_is_refused_with_the_list() -> None:
    """An unknown name is refused in one line, with the nearest first and all others after it."""
    assert find_method("wary") is BASELINES["wary"]
    assert find_method("unified") is METHODS["unified"]
    with pytest.raises(ChoiceError, match=r"did you mean 'bayesian'\?") as caught:
        find_method("baysian")
    assert "\n" not in str(caught.value)
    assert all(method.name in str(caught.value) for method in EVERY)


def test_the_page_of_methods_lists_each() -> None:
    """It has a row for each baseline and no other, with the use of incorrect demonstrations."""
    rows = re.findall(
        r"^\| `([a-z-]+)` \|.*\| ([a-z ]+) \|$", PAGE.read_text("utf-8"), re.MULTILINE
    )
    said = {name: use.replace("none", "nothing") for name, use in rows}
    assert said == {name: method.use for name, method in BASELINES.items()}
