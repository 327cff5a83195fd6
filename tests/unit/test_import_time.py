"""What start-up loads: modules, not seconds, which say more about the machine."""

from __future__ import annotations

import subprocess
import sys

import pytest

# Each of these takes longer to import than `repair --help` may last.
HEAVY = {
    *("casadi", "clarabel", "commonroad", "commonroad_dc", "daqp", "matplotlib", "networkx", "osqp"),
    *("qpsolvers", "scipy.interpolate", "scipy.optimize", "shapely", "vehiclemodels"),
}

QUIET = "import contextlib, io, sys\nout = io.StringIO()\n"
CLI = (
    QUIET
    + "from repair.cli import main\nwith contextlib.redirect_stdout(out), contextlib.suppress(SystemExit):\n"
)


def loaded(code: str) -> set[str]:
    """The modules that a fresh interpreter holds after ``code``."""
    code += "\nimport sys\nprint('\\n' + ' '.join(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, check=True
    )
    return set(done.stdout.splitlines()[-1].split())


@pytest.mark.parametrize(
    "code",
    [
        "import repair",
        "import repair; dir(repair); repair.__version__; repair.SearchStatus; repair.RepairError",
        "from repair import load_config, preset_names, backend_names; load_config(preset=preset_names()[0])",
        CLI + "    main(['--help'])",
        CLI + "    main(['run', '--help'])",
        CLI + "    main(['--version'])",
        CLI + "    main(['presets'])",
        CLI + "    main(['config'])",
        CLI + "    main(['run', 'no-such-file.xml'])",
    ],
    ids=[
        "import",
        "light names",
        "configuration",
        "help",
        "run help",
        "version",
        "presets",
        "config",
        "wrong file",
    ],
)
def test_start_up_is_light(code: str) -> None:
    assert not loaded(code) & HEAVY


def test_a_backend_loads_its_own_solver_only() -> None:
    modules = loaded(
        "from repair import load_config\nfrom repair.solvers.registry import make_backend\n"
        "make_backend('ego', load_config())"
    )
    assert not modules & {"casadi", "clarabel", "daqp", "matplotlib", "osqp", "qpsolvers"}


def test_import_loads_numpy_at_most() -> None:
    foreign = {name.partition(".")[0] for name in loaded("import repair") - loaded("import numpy")}
    assert foreign <= {"repair"} | sys.stdlib_module_names
