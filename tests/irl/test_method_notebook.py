from __future__ import annotations

import ast
from typing import Any

import nbformat
import pytest

from replication import Params, fit
from replication.files import PROJECT

CODE = [
    cell.source
    for cell in nbformat.read(PROJECT / "notebooks" / "method.ipynb", as_version=4).cells
    if cell.cell_type == "code"
]


def run(**parameters: Any) -> dict[str, Any]:
    """Run the notebook's code with other values of some parameters; return what it defines."""
    names: dict[str, Any] = {}
    for cell in CODE:
        exec(cell, names)
        names |= {name: value for name, value in parameters.items() if name in names}
    return names


@pytest.mark.parametrize("cells", [3, 6])
def test_derivation_equals_the_package(cells: int) -> None:
    """Under either reading of Eq. 9 and Q kept or reset, the plain loop has the package's bits."""
    names = run(cells=cells, seed=5)  # the notebook asserts it for the defaults itself
    for reading in ("printed", "updated"):
        for q_start in ("kept", "reset"):
            choices = {"f_index": reading, "q_start": q_start, "incorrect": "all"}
            params = Params.of(**names["params"].values() | choices)
            result = fit(names["demos"], params=params, seed=8)
            plain = names["learn_reward"](names["incorrect"], 8, reading, q_start)
            assert plain == (result.errors.tolist(), result.weights.tolist(), result.q.tolist())
            assert plain[0][-1] == 0


def test_functions_are_short_and_documented() -> None:
    """A function has at most 15 lines and a docstring of one; together they are about 60."""
    functions = [
        node for cell in CODE for node in ast.parse(cell).body if isinstance(node, ast.FunctionDef)
    ]
    lengths = [(node.end_lineno or 0) - node.lineno + 1 for node in functions]
    assert max(lengths) <= 15
    assert 50 <= sum(lengths) <= 75
    assert all("\n" not in (ast.get_docstring(node) or "\n") for node in functions)
