from __future__ import annotations

import pytest

from replication import METHODS
from replication.irl import get_method
from replication.paper.register import ChoiceError


def test_names_are_keys_and_labels_are_distinct() -> None:
    """A method is found under its own name, and no two look alike in a table."""
    assert all(name == method.name for name, method in METHODS.items())
    assert len({method.label for method in METHODS.values()}) == len(METHODS)


def test_reconstruction_is_labelled() -> None:
    """Wherever AdaBoost-IRL's label appears, it says which reconstruction it is."""
    assert "R1" in METHODS["adaboost"].label


def test_misspelt_method_is_refused_with_the_list() -> None:
    """An unknown name raises, suggests the nearest and lists the rest."""
    with pytest.raises(ChoiceError, match=r"did you mean 'unified'.*adaboost"):
        get_method("unifed")
