from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from replication.pipeline.notebook import NotebookError
from replication.pipeline.plan import prepare

NEEDS = 'out = "x"\nresults = "figures"'


def names(*paths: Path) -> list[str]:
    """Return the names of notebooks in the order in which they are run."""
    runs = prepare(paths, profile="paper", out=paths[0].parent / "figures")
    return [run.name for run in runs]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"trails": 3}, "unknown parameter 'trails' (did you mean 'trials'?)"),
        ({"trials": "3"}, "parameter 'trials' is a whole number, such as 3; '3' is text"),
        ({"trials": True}, "'trials' is a whole number, such as 3; True is true or false"),
        ({"trials": 3.0}, "'trials' is a whole number, such as 3; 3.0 is a number"),
        ({"alpha": float("nan")}, "'alpha' is a number, such as 0.5; nan is a number"),
        ({"name": Path("a")}, "'name' is text"),
        ({"choices": {"a": (1, 2)}}, "'choices' is an object"),
        ({"choices": []}, "'choices' is an object, such as {}; [] is a list"),
        ({"out": "elsewhere"}, "use --out"),
        ({"results": "elsewhere"}, "use --out"),
    ],
)
def test_bad_parameters_are_refused(write: Any, given: dict[str, Any], message: str) -> None:
    """A parameter that only the second notebook cannot take is refused before the first runs."""
    more = "\ntrails = 1" * ("trails" in given)
    first = write(
        name="first",
        parameters='trials = 3\nalpha = 0.5\nname = "a"\nchoices = {}\nout = "x"' + more,
    )
    second = write(name="second")
    with pytest.raises(NotebookError, match=re.escape(message)):
        prepare([first, second], profile="paper", out=first.parent / "f", parameters=given)


def test_what_is_needed_runs_first(write: Any) -> None:
    """Notebooks keep the order in which they are given, but for those that others need."""
    paths = {name: write(name=name) for name in ("b", "c", "d")}
    paths["a"] = write(name="a", parameters=NEEDS, needs=["d", "b"])
    paths["e"] = write(name="e", parameters=NEEDS, needs=["a"])
    assert names(paths["e"], paths["a"], paths["b"], paths["c"], paths["d"]) == list("dbaec")
    assert names(paths["c"], paths["b"]) == ["c", "b"]


def test_needs_that_cannot_be_met_are_refused(write: Any) -> None:
    """A notebook that is neither asked for nor published, unknown, or needs itself, is named."""
    maze = write(name="maze")
    judge = write(name="judge", parameters=NEEDS, needs=["maze"])
    with pytest.raises(NotebookError, match=r"needs the outputs of maze; .*run maze --out"):
        names(judge)
    assert names(judge, maze) == ["maze", "judge"]
    with pytest.raises(NotebookError, match=r"unknown notebook 'mace' \(did you mean 'maze'"):
        names(write(name="judge", parameters=NEEDS, needs=["mace"]))
    write(name="maze", parameters=NEEDS, needs=["judge"])
    with pytest.raises(NotebookError, match="needs itself: judge needs maze needs judge"):
        names(write(name="judge", parameters=NEEDS, needs=["maze"]), maze)


def test_two_notebooks_of_one_name_are_refused(write: Any) -> None:
    """Each notebook has a folder of its own, so names are told apart."""
    path = write()
    other = path.parent / "below" / path.name
    other.parent.mkdir()
    other.write_text(path.read_text())
    with pytest.raises(NotebookError, match=r"below/toy\.ipynb: has the name of .*toy\.ipynb"):
        names(path, other)
