from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from replication.export.about import ExportError
from replication.export.columns import TEXT, WHOLE, column
from replication.files import PROJECT

TABLES = sorted((PROJECT / "figures").glob("*/trials.csv"))


@pytest.mark.parametrize("path", TABLES, ids=lambda path: path.parent.name)
def test_each_column_has_its_type(path: Path) -> None:
    """Every column of every published table is described, and holds what its type says."""
    for name, values in pd.read_csv(path).items():
        kind, words = column(str(name))
        assert words
        if kind != TEXT:
            filled = values.dropna()
            assert not (kind == WHOLE and (filled % 1).any())


def test_an_unknown_column_is_refused() -> None:
    """Nobody exports a column that nobody described."""
    with pytest.raises(ExportError, match=r"describe 'colour' in replication/export/columns\.py"):
        column("colour")
