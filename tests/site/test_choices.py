from __future__ import annotations

import re

import pandas as pd

from replication.paper.register import load_choices
from replication.site.choices import choices

SHARES = pd.DataFrame(
    [
        ("SAVES-OPEN", "ALPHA", 0.06),
        ("FASTER", "MAP", 0.5),
        ("SAVES-OPEN", "MAP", 0.2),
        ("FASTER", "TIES", 0.01),
        ("FASTER", "noise", 0.3),
        ("ZERO-OPEN", "TIES", 0.9),
        ("AVOIDS-OPEN", "TIES", 0.1),
        ("AVOIDS-OPEN", "noise", 0.6),
    ],
    columns=["claim", "choice", "share"],
)


def test_every_choice_is_described() -> None:
    """Each entry of the register has a section that its id leads to, with all that it says."""
    text = choices(SHARES)
    sections = re.split(r"^(?=\(choice-)", text, flags=re.MULTILINE)[1:]
    assert len(sections) == len(load_choices())
    for entry, section in zip(load_choices().values(), sections, strict=True):
        assert section.startswith(f"(choice-{entry.id.lower()})=\n\n### ")
        assert f"\n{entry.id} · {entry.place} · `" in section
        assert entry.rule in section
        said = entry.open.removeprefix("stated: ").lower()
        assert set(re.findall(r"\w+", said)) <= set(re.findall(r"\w+", section.lower()))


def test_choices_stand_by_kind() -> None:
    """The headings are those of the register's file."""
    headings = re.findall(r"^## (.+)$", choices(SHARES), flags=re.MULTILINE)
    assert headings[:3] == ["The task", "The demonstrations", "Robot soccer"]
    assert len(headings) == 7


def test_what_matters_comes_first() -> None:
    """The choices with a large share, largest first; none of a claim that chance decides."""
    table, _, rest = choices(SHARES).partition("\n\n")
    assert "| [Rate α of the trace](#choice-alpha) |" in re.sub(" +", " ", table)
    names = [line.split("|")[1].strip() for line in table.splitlines()[2:]]
    assert [name.partition("]")[2] for name in names] == ["(#choice-map-open)", "(#choice-alpha)"]
    assert "faster than AdaBoost-IRL (50%), saves iterations (20%)" in table
    assert "noise" not in table
    assert rest.startswith(
        "None of these claims hangs by 5% or more on how ties are broken. "
        "The effects of others vary mostly by chance: collides less at first.\n"
    )
