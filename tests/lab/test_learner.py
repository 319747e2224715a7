"""The learner as WebAssembly: it is what its source says, and returns the bits of the reference."""

from __future__ import annotations

from collections.abc import Callable
from importlib import resources
from typing import Any, NamedTuple

import numpy as np
import pytest
import wasmtime
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from replication.learning import reference

FILES = resources.files("replication.lab")

RECORD = np.dtype(
    [
        ("q", "<f8", 4),
        ("weights", "<f8", 4),
        ("moves", "<i4", 4),
        ("best", "<f8"),
        ("greedy", "u1", 16),
    ]
)
"""What the learner's memory holds of a state."""

Learned = tuple[NDArray[np.float64], list[int], int, int]


class Case(NamedTuple):
    """The arguments of a call."""

    moves: NDArray[np.int64]
    weights: NDArray[np.float64]
    q: NDArray[np.float64]
    stream: list[int]
    scalars: dict[str, Any]


@pytest.fixture(scope="module")
def learn() -> Callable[[Case], Learned]:
    """Return the committed learner, called as the page calls it."""
    store = wasmtime.Store()
    module = wasmtime.Module(store.engine, FILES.joinpath("learner.wasm").read_bytes())
    exports = wasmtime.Instance(store, module, []).exports(store)
    memory: Any = exports["memory"]
    function: Any = exports["learn"]
    assert RECORD.itemsize == 104

    def place(state: Any) -> Any:
        return 32 + RECORD.itemsize * state

    def learn(case: Case) -> Learned:
        table = np.zeros(len(case.moves), RECORD)
        table["q"], table["weights"], table["moves"] = case.q, case.weights, place(case.moves)
        memory.write(store, np.array(case.stream, np.uint64).tobytes() + table.tobytes(), 0)
        scalars = case.scalars
        steps, collisions = function(
            store,
            len(case.moves),
            place(scalars["start"]),
            place(scalars["goal"]),
            scalars["episodes"],
            scalars["horizon"],
            scalars["beta"],
            scalars["gamma"],
            float(round(scalars["epsilon"] * 2**32)),
            scalars["tolerance"],
            scalars["random_ties"],
        )
        after = bytes(memory.read(store, 0, place(len(case.moves))))
        q = np.frombuffer(after[32:], RECORD)["q"]
        return q, np.frombuffer(after[:32], np.uint64).tolist(), int(steps), int(collisions)

    return learn


@st.composite
def cases(draw: st.DrawFn) -> Case:
    """Draw any table of moves, values that often tie, zeros of both signs, and any parameters."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    n = draw(st.integers(1, 12))
    few = draw(
        st.sampled_from([[0.0, -0.0], [0.0, -0.0, 1.0, 1.0 + 1e-12], list(rng.normal(size=9))])
    )
    share = st.sampled_from([0.0, 0.1, 0.5, 0.9, 1.0])
    scalars = {
        "start": draw(st.integers(0, n - 1)),
        "goal": draw(st.integers(0, n - 1)),
        "episodes": draw(st.integers(1, 20)),
        "horizon": draw(st.integers(1, 30)),
        "beta": draw(share),
        "gamma": draw(share),
        "epsilon": draw(share),
        "tolerance": draw(st.sampled_from([0.0, 1e-12, 1e-3, 0.5])),
        "random_ties": draw(st.booleans()),
    }
    stream = rng.integers(0, 2**64, 4, dtype=np.uint64).tolist()
    weights, q = rng.choice(few, (n, 4)), rng.choice(few, (n, 4))
    return Case(rng.integers(0, n, (n, 4)), weights, q, stream, scalars)


@settings(max_examples=400)
@given(case=cases())
def test_it_is_the_reference(learn: Callable[[Case], Learned], case: Case) -> None:
    """On any table, with any parameters: the same Q, stream, steps and collisions, bit by bit."""
    q, *rest = learn(case)
    expected, *others = reference.learn(
        case.moves.tolist(), case.weights.tolist(), case.q.tolist(), case.stream, **case.scalars
    )
    assert q.tobytes() == np.array(expected).tobytes()
    assert rest == others


def test_it_is_made_from_its_source() -> None:
    """The committed file is what the pinned assembler makes of learner.wat, byte by byte."""
    made = wasmtime.wat2wasm(FILES.joinpath("learner.wat").read_text())
    assert bytes(made) == FILES.joinpath("learner.wasm").read_bytes()
