"""Trials that the lab's scripts compute, apart from its controls."""

from __future__ import annotations

from typing import Any

from playwright.sync_api import Page

from replication import Demos, Maze
from replication.lab.page import lab_data

CORE = """(() => new Function(
  document.getElementById("lab-worker").textContent
  + "; return { learnPlainly, compileLearner, runTrial, digest };"
)())()"""
"""What the worker of the page computes with."""

WASM = lab_data()["wasm"]


def task_of(demos: Demos) -> dict[str, Any]:
    """Return demonstrations as the page's scripts take them."""
    maze = demos.environment
    assert isinstance(maze, Maze)

    def way(demo: Any) -> dict[str, Any]:
        return {"states": demo.states.tolist(), "actions": demo.actions.tolist()}

    world: dict[str, Any] = {"states": maze.n_states, "start": maze.start, "goal": maze.goal}
    world["moves"] = maze.next_state.ravel().tolist()
    return {
        "world": world,
        "correct": way(demos.correct[0]),
        "incorrect": [way(demo) for demo in demos.incorrect],
    }


def computed(page: Page, jobs: list[dict[str, Any]], *, plainly: bool) -> list[list[Any]]:
    """Return iterations, steps and digest of each job's trial, by the plain learner or the fast."""
    found: list[list[Any]] = page.evaluate(
        f"""([wasm, plainly, jobs]) => {{
          const core = {CORE};
          const fast = core.compileLearner(Uint8Array.from(atob(wasm), c => c.charCodeAt(0)));
          const learn = plainly ? core.learnPlainly : fast;
          return Promise.all(jobs.map(async ({{ task, method, params, root, trial }}) => {{
            task.world.moves = Int32Array.from(task.world.moves);
            const found = core.runTrial(task, method, params, root, trial, learn);
            return [found.iterations, found.steps, await core.digest(found)];
          }}));
        }}""",
        [WASM, plainly, jobs],
    )
    return found
