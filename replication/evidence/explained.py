"""What explains the iterations: the margin of the bound, and the plain length of the path."""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy import stats

Z = float(stats.norm.ppf(0.975))


def share_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return how much of the iterations the margin explains, and the plain length of the path.

    `table` is a :func:`~replication.evidence.bound.bound_table`.

    Returns
    -------
    DataFrame
        One row for each run, cause ("margin" for 1 / delta^2, or "length") and `among`: "shapes" of
        a maze are cases whose paths are about equally long; "all" are all cases. `share` is the
        squared correlation of the logarithms over `cases`, of mean iterations and cause; its 95 %
        interval `low` to `high` is that of the correlation by Fisher's z (1921), squared, and
        begins at 0 if the correlation may have either sign. Cases of one maze are not independent,
        so that it is rather narrow. `slope` is that of the logarithms. `right` is the share of
        `pairs` of which the one with the greater cause needs more iterations; a pair does not count
        if their causes are equal, and counts half if their iterations are.
    """
    rows = []
    for (method, reading, solver), run in table.groupby(
        ["method", "reading", "solver"], sort=False
    ):
        for among, own in (("shapes", run[run["vary"] == "shape"]), ("all", run)):
            effect = np.log(own["mean"].to_numpy())
            causes = {"margin": own["delta"].to_numpy() ** -2.0, "length": own["length"].to_numpy()}
            for cause, values in causes.items():
                x = np.log(values)
                r = float(np.corrcoef(x, effect)[0, 1])
                ends = np.tanh(np.arctanh(r) + np.array([-1, 1]) * Z / np.sqrt(len(x) - 3)) ** 2
                i, j = np.triu_indices(len(x), 1)
                signs = np.sign((x[i] - x[j]) * (effect[i] - effect[j]))[x[i] != x[j]]
                spans = bool(np.abs(np.arctanh(r)) * np.sqrt(len(x) - 3) <= Z)
                rows.append(
                    {
                        "method": method,
                        "reading": reading,
                        "solver": solver,
                        "among": among,
                        "cause": cause,
                        "cases": len(x),
                        "correlation": r,
                        "share": r**2,
                        "low": 0.0 if spans else float(ends.min()),
                        "high": float(ends.max()),
                        "slope": float(np.polyfit(x, effect, 1)[0]),
                        "pairs": len(signs),
                        "right": float((1 + signs.mean()) / 2),
                    }
                )
    return pd.DataFrame(rows)
