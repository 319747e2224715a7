"""The page of choices: those that matter first, then each in words, by kind."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pandas as pd

from replication.evidence.claims import load_claims, short_label
from replication.evidence.sensitivity import NOISE
from replication.paper.groups import choice_groups
from replication.paper.register import Choice
from replication.report.choices import NAMES, title
from replication.report.findings import MATTERS, MOSTLY
from replication.report.readable import markdown


def choices(shares: pd.DataFrame) -> str:
    """Return every choice in words: those that matter first, then all, by kind.

    Parameters
    ----------
    shares
        By claim and choice, the share of the variance of the claim's effect over specifications.
    """
    lines = [_matter(shares)]
    for heading, entries in choice_groups().items():
        lines.append(f"## {_capital(heading)}\n")
        for entry in entries:
            lines += _section(entry)
    return "\n".join(lines)


def _matter(shares: pd.DataFrame) -> str:
    """Return a table of the choices that were varied, by how much hangs on each of them.

    Whether the error falls to zero is left out: only for the other method does anything hang on it.
    So are claims whose effect varies mostly by chance.
    """
    zero = shares["claim"].map(lambda id: load_claims().by_id(id).statistic == "share")
    chance = shares.loc[(shares["choice"] == NOISE) & (shares["share"] > MOSTLY), "claim"]
    left_out = zero.astype(bool) | shares["claim"].isin(chance)
    known = shares[shares["choice"].isin(NAMES) & ~left_out]
    most = known.groupby("choice")["share"].max().sort_values(ascending=False)
    rows = []
    for id in most[most >= MATTERS].index:
        part = known[(known["choice"] == id) & (known["share"] >= MATTERS)]
        on = [
            f"{short_label(row.claim)} ({row.share:.0%})"
            for row in part.sort_values("share", ascending=False).itertuples()
        ]
        name = f"[{_capital(title(id))}](#choice-{PLACES.get(id, id).lower()})"
        rows.append({"Choice": name, "What hangs on it (share of the variance)": ", ".join(on)})
    small = ", ".join(NAMES[id] for id in most[most < MATTERS].index)
    rest = f"None of these claims hangs by {MATTERS:.0%} or more on {small}." if small else ""
    if len(chance):
        names = ", ".join(map(short_label, chance))
        rest += f" The effects of others vary mostly by chance: {names}."
    return f"{markdown(pd.DataFrame(rows))}\n{rest.strip()}\n"


PLACES = {"MAP": "MAP-OPEN"}
"""Where a choice is described whose name in the specifications is not in the register."""


def _section(entry: Choice) -> Iterator[str]:
    name, rest = _split(entry.open)
    where = entry.field or entry.data or entry.code
    yield f"(choice-{entry.id.lower()})=\n"
    yield f"### {name}\n"
    if rest:
        yield f"{rest}\n"
    yield f"**Ours:** `{entry.default}`. {entry.rule}"
    own = f" In a task of your own: {entry.accepted}." if entry.range else ""
    yield f"**Also listed:** {entry.others or 'nothing else'}.{own}\n"
    yield f"{{.provenance}}\n{entry.id} · {entry.place} · `{where}`\n"


def _split(text: str) -> tuple[str, str]:
    """Return what is open as a title, and what else is said of it.

    Examples
    --------
    >>> _split("stated: learning rate 0.7 (mazes)")
    ('Learning rate 0.7 (mazes)', '')
    >>> _split("Whether Eq. 9 holds. The text does not say.")
    ('Whether Eq. 9 holds', 'The text does not say.')
    """
    text = text.removeprefix("stated: ")
    first, _, rest = re.sub(r"(?<!Eq)(?<!Fig)[.:;](?: |$)", "\n", text, count=1).partition("\n")
    return _capital(first), _capital(rest)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
