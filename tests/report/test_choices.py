from __future__ import annotations

from replication.evidence.specifications import default_of, load_specifications
from replication.report.choices import NAMES, acts, title, value

PLAN = load_specifications()
PARTS = {
    part: {id: {str(v) for v in (*values, default_of(id))} for id, values in part_choices.items()}
    for part, part_choices in (
        ("factorial", PLAN.mazes.factorial.choices),
        ("mazes", PLAN.mazes.single.choices),
        ("soccer", PLAN.soccer.single.choices),
    )
}


def test_names_can_stand_beside_values_in_a_figure() -> None:
    """No two choices have the same title, and none is long or shouts its id."""
    titles = [title(id) for id in NAMES]
    assert len(set(titles)) == len(titles)
    assert all(len(text) <= 24 for text in titles)
    assert not any(id.lower() in text for id, text in zip(NAMES, titles, strict=True) if "-" in id)


def test_values_of_a_choice_can_be_told_apart() -> None:
    """Whatever a specification sets is called by words of its own, without signs of a program."""
    for part in PARTS.values():
        for id, keys in part.items():
            words = [value(id, key) for key in keys]
            assert len(set(words)) == len(words)
            assert not any(sign in text for text in words for sign in "+_=")


def test_a_choice_that_cannot_act_does_not() -> None:
    """Without AdaBoost-IRL or incorrect demonstrations their choices do not act; others always."""
    for claim in PLAN.mazes.claims:
        saves = claim.startswith(("SAVES", "AVOIDS", "ERRS"))
        assert acts("INCORRECT-KINDS", claim) == (saves or claim == "FASTER-WITH")
        assert not (acts("ADABOOST-RULE", claim) and saves)
        assert acts("ALPHA", claim)
    assert acts("ADABOOST-MARGIN", "FASTER")
