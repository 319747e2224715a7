"""The public interface, which is imported name by name."""

import subprocess
import sys

import replication


def test_every_public_name_is_there() -> None:
    """Each name is what its module calls so, and is listed."""
    assert set(replication.__all__) <= set(dir(replication))
    for name in replication.__all__:
        assert getattr(replication, name) is not None
    assert not hasattr(replication, "nothing")


def test_what_one_uses_first_is_light() -> None:
    """Learning imports nothing that draws, tabulates, runs notebooks or computes in parallel."""
    heavy = {"matplotlib", "pandas", "IPython", "nbformat", "papermill", "joblib", "distributed"}
    code = f"import sys, replication; replication.fit; print({heavy} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_the_package_alone_is_light() -> None:
    """Nothing is imported before it is used, and no module hides a name."""
    code = (
        "import sys, replication\n"
        "print({'numpy', 'numba', 'pydantic'} & set(sys.modules))\n"
        "for name in replication.__all__: getattr(replication, name)\n"
        "for name in replication.__all__: print(type(getattr(replication, name)).__name__)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    first, *kinds = done.stdout.splitlines()
    assert first == "set()"
    assert "module" not in kinds
