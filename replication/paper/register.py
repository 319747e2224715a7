"""The register of choices: what the paper leaves open, what we chose, and what else is accepted.

The register itself is the data file ``choices.toml``. A dataclass field declared with
:func:`choice` takes its default from the register and accepts every number that the mathematics
allow, and the registered words; `Choice.registered` takes only what is compared with the paper.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from replication.errors import UserError
from replication.files import read_toml

Value = str | int | float


class ChoiceError(UserError):
    """A name or value of a parameter that is not in the register."""


@dataclass(frozen=True)
class Choice:
    """One entry of the register; ``choices.toml`` explains the fields."""

    id: str
    place: str
    open: str
    default: Value
    rule: str
    alternatives: tuple[Value, ...] = ()
    range: tuple[float, float] | None = None
    field: str = ""
    data: str = ""
    code: str = ""

    @property
    def accepted(self) -> str:
        """The accepted values, in words, for messages and tables."""
        if self.range is not None:
            kind = "a whole number" if isinstance(self.default, int) else "a number"
            return f"{kind} from {self.range[0]} to {self.range[1]}"
        return ", ".join(repr(value) for value in (self.default, *self.alternatives))

    @property
    def others(self) -> str:
        """The other values that the register lists, in words."""
        return ", ".join(map(str, self.alternatives))

    def registered(self, value: Any) -> Value:
        """Return `value` as `check` does; raises `ChoiceError` if it is not listed."""
        checked = self.check(value)
        if self.alternatives and checked not in (self.default, *self.alternatives):
            others = f"use {self.default} or {self.others}"
            raise ChoiceError(f"{self.field} = {value!r} is not registered ({self.id}): {others}")
        return checked

    def check(self, value: Any) -> Value:
        """Return `value` in the type of the default; raises `ChoiceError` if it is not accepted."""
        kind = type(self.default)
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        fits = isinstance(value, str) if kind is str else number
        if fits and self.range is not None:
            low, high = self.range
            fits = low <= value <= high and (kind is float or value == int(value))
        elif fits:
            fits = value in (self.default, *self.alternatives)
        if not fits:
            raise ChoiceError(
                f"{self.field} = {value!r} is not accepted (choice {self.id}): use {self.accepted}"
            )
        return kind(value)


@cache
def load_choices() -> dict[str, Choice]:
    """Return the register: each :class:`Choice` by its id, in the order of the file.

    Raises
    ------
    ChoiceError
        If an entry has an unknown key, or an id occurs twice.
    """
    entries: dict[str, Choice] = {}
    for entry in read_toml(Path(__file__).with_name("choices.toml"))["choice"]:
        lists = {key: tuple(entry[key]) for key in ("alternatives", "range") if key in entry}
        try:
            registered = Choice(**{**entry, **lists})
        except TypeError as error:
            raise ChoiceError(f"choices.toml, entry {entry.get('id')!r}: {error}") from None
        if registered.id in entries:
            raise ChoiceError(f"choices.toml has the id {registered.id!r} twice")
        entries[registered.id] = registered
    return entries


def choice(id: str) -> Any:
    """Declare a dataclass field that holds the registered choice `id`, with its default."""
    return dataclasses.field(default=load_choices()[id].default, metadata={"choice": id})


class Chosen:
    """Base of parameter dataclasses, whose fields are registered choices and are checked."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            entry = load_choices()[field.metadata["choice"]]
            object.__setattr__(self, field.name, entry.check(getattr(self, field.name)))
