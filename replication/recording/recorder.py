"""Recording by hand, without the terminal: keys come in, and text for the screen goes out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count

import numpy as np

from replication.demos.files import summary
from replication.demos.model import Demo, Demos
from replication.errors import UserError, compact
from replication.recording.keys import action_keys, legend
from replication.recording.question import Question, wrap
from replication.recording.worlds import World

FRAME = 0.25
"""Seconds that a replay shows a step."""

LEAST = 10
"""Lines that a picture may have before the legend of keys takes room from it."""


class Recorder:
    """Turns keys into demonstrations; each is saved when it is finished.

    Parameters
    ----------
    world
        Where the demonstrations are made.
    task
        Name of the task, if there are no demonstrations yet.
    demos
        Demonstrations that are there already; they are kept.
    save
        Is given all demonstrations whenever one is finished.

    Attributes
    ----------
    demos
        All that is finished; None if nothing is.
    done
        Whether the user wants to stop.

    Raises
    ------
    UserError
        If there are more actions than keys.
    """

    def __init__(
        self,
        world: World,
        task: str,
        demos: Demos | None = None,
        save: Callable[[Demos], object] = lambda _: None,
    ) -> None:
        self.demos, self.done = demos, False
        self._world, self._task, self._save = world, task, save
        self._keys = action_keys(world.environment.actions)
        self._attempt, self._quits = -1, False
        self._question: Question | None = None
        self._last: tuple[list[int], int] = [], 0
        self._begin("")

    @property
    def pause(self) -> float | None:
        """Seconds after which :meth:`tick` shows the next step of a replay; None without one."""
        return None if self._film is None else FRAME

    def press(self, key: str) -> None:
        """Take a key: a character, or "up", "down", "left", "right", "enter", "back", "escape"."""
        quits, self._quits = self._quits, False
        if self._film is not None:
            self._end_replay()
        elif self._question:
            self._answer(self._question, key)
        elif key in self._keys:
            self._take(self._keys[key])
        elif key in ("u", "back"):
            self._undo()
        elif key == "r":
            self._begin("started again")
        elif key == "p":
            self._replay()
        elif key == "enter":
            self._finish()
        elif key in ("q", "w"):
            self.done = quits or not self._actions
            self._quits = True
            number = len(self._actions)
            steps, them = ("step is", "it") if number == 1 else ("steps are", "them")
            self._note = f"{number} {steps} not finished: Enter finishes {them}, q drops {them}"
        else:
            self._note = "no such key"

    # --- moving ------------------------------------------------------------------------------

    def _begin(self, note: str) -> None:
        """Go to the start, with the luck of a new attempt."""
        self._attempt += 1
        self._actions: list[int] = []
        self._film: Iterator[tuple[list[int], int, str]] | None = None
        self._look([], self._attempt, note)

    def _look(self, actions: list[int], attempt: int, note: str) -> None:
        """Show where actions lead; begin anew if that cannot be seen again."""
        try:
            self._scene = self._world.play(actions, attempt)
        except UserError as error:
            self._begin(str(error))
        else:
            self._seen, self._note = actions, note

    def _take(self, action: int) -> None:
        if self._scene.over:
            self._note = "it is over here: Enter finishes, u takes the last step back"
            return
        self._actions = [*self._actions, action]
        self._look(self._actions, self._attempt, "")
        told = f": {self._scene.told}" if self._scene.told else ""
        self._note = f"{self._world.environment.actions[action]}{told}"

    def _undo(self) -> None:
        if not self._actions:
            self._note = "there is nothing to undo"
            return
        *self._actions, undone = self._actions
        note = f"took back: {self._world.environment.actions[undone]}"
        self._look(self._actions, self._attempt, note)

    # --- replaying ---------------------------------------------------------------------------

    def _replay(self) -> None:
        """Show what is being recorded, or else what was finished last, step by step."""
        actions, attempt = (self._actions, self._attempt) if self._actions else self._last
        if not actions:
            self._note = "there is nothing to replay"
            return
        self._film = (
            (actions[:step], attempt, f"replay: step {step} of {len(actions)}; any key ends it")
            for step in range(len(actions) + 1)
        )
        self.tick()

    def tick(self) -> None:
        """Show the next step of a replay; after the last one it is over."""
        if self._film and (scene := next(self._film, None)):
            self._look(*scene)
        elif self._film:
            self._end_replay()

    def _end_replay(self) -> None:
        self._film = None
        self._look(self._actions, self._attempt, "")

    # --- finishing ---------------------------------------------------------------------------

    def _finish(self) -> None:
        if not self._actions:
            self._note = "take a step first"
            return
        goal = self._world.environment.goal_step(self._actions)
        offered = ["correct"] if self._scene.over or goal is not None else []
        if self.demos is None and not offered:
            self._note = (
                "the first demonstration must be correct, and so reach the goal; mistakes come "
                "after it"
            )
            return
        self._question = Question([*offered, *(self.demos.kinds if self.demos else ())])
        self._note = ""

    def _answer(self, question: Question, key: str) -> None:
        self._note = ""
        if key == "escape":
            self._question = None
        elif key != "enter":
            question.press(key)
        elif question.answer:
            self._keep(question.answer)
        else:
            self._note = "type what kind of mistake this is, such as: hit"

    def _keep(self, kind: str) -> None:
        """Add what was recorded to the demonstrations, and save them; or say why it cannot be."""
        present = [*self.demos.correct, *self.demos.incorrect] if self.demos else []
        names = {demo.name for demo in present}
        name = next(f"{kind}-{n}" for n in count(1) if f"{kind}-{n}" not in names)
        demo = Demo(name, kind, np.array(self._scene.states), np.array(self._actions))
        try:
            demos = self._with(demo)
            self._save(demos)
        except UserError as error:
            self._note = str(error)
            return
        self.demos = demos
        self._last = self._actions, self._attempt
        self._question = None
        self._begin(f"kept as {name}; back at the start, p shows it")

    def _with(self, demo: Demo) -> Demos:
        correct, incorrect = ((demo,), ()) if demo.kind == "correct" else ((), (demo,))
        if self.demos is None:
            return Demos(self._task, self._world.environment, correct, incorrect)
        return replace(
            self.demos,
            correct=self.demos.correct + correct,
            incorrect=self.demos.incorrect + incorrect,
        )

    # --- the screen --------------------------------------------------------------------------

    def screen(self, columns: int, lines: int) -> str:
        """Return the text of a screen; what has no room is left out, the legend first."""
        head = [f"{self._task}: {summary(self.demos)}", ""]
        environment, state = self._world.environment, self._scene.states[-1]
        cell = environment.cell(state)
        place = f"state {state}" + (f" {compact(cell)}" if len(cell) > 1 else "")
        below = ["", f"step {len(self._seen)}, {place}", *wrap(self._note, columns)]
        if self._question:
            below += ["", *self._question.lines(columns)]
            keys = []
        else:
            keys = ["", *legend(environment.actions, columns)]
        room = lines - len(head) - len(below)
        if room - len(keys) < min(len(self._draw(columns, lines)), LEAST):
            keys = []
        picture = self._draw(columns, max(room - len(keys), 1))
        text = [*head, *picture, *below, *keys]
        return "\n".join(text[-lines:] if self._question else text[:lines])

    def _draw(self, columns: int, lines: int) -> list[str]:
        return self._world.draw(self._seen, self._scene, columns, lines)
