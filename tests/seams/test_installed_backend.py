"""A backend in a package of its own, installed into an environment of its own: nothing here knows it."""

from __future__ import annotations

import base64
import hashlib
import json
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest
from tests import roads

BACKEND = '''
"""Full braking along the path, nothing else."""

from dataclasses import dataclass, replace

import numpy as np

from repair import BackendSpec, Capabilities, FrenetTrajectory, SolveResult, SolveStatus
from repair.curves.fitting import fit_to_curve
from repair.settings import setting


@dataclass
class FullBrakingConfig:
    """How hard."""

    deceleration: float = setting(6.0, "how hard it brakes [m/s²]", low=0.5, high=12.0)
    spacing: float = setting(0.2, "knot spacing [s]", low=0.05, high=1.0)


class FullBraking:
    """Brakes from t_rep on until the ego stands."""

    name = "full_braking"
    capabilities = Capabilities()

    def __init__(self, settings):
        self.settings = settings

    def solve(self, problem, *, warm_start=None, time_limit=None):
        start, hard = problem.start, self.settings.deceleration
        stop = max(start[1, 0], 0.0) / hard

        class Braking:
            t_start, t_end = problem.t_rep, problem.t_end

            def sample(self, t):
                tau = np.clip(np.asarray(t) - problem.t_rep, 0.0, stop)
                s = start[0, 0] + start[1, 0] * tau - 0.5 * hard * tau**2
                zero = np.zeros_like(s)
                columns = (s, start[1, 0] - hard * tau, np.where(tau < stop, -hard, 0.0), zero)
                return FrenetTrajectory(np.asarray(t), *(np.column_stack([c, zero]) for c in columns))

        n = int(np.ceil((problem.t_end - problem.t_rep) / self.settings.spacing)) + 3
        curve = fit_to_curve(Braking(), problem.t_rep, n, 3, self.settings.spacing)
        points = curve.points.copy()  # that never decrease: it does not roll back
        points[2:, 0] = np.maximum.accumulate(points[2:, 0])
        return SolveResult(SolveStatus.SOLVED, replace(curve, points=points), objective=hard)


SPEC = BackendSpec(
    lambda config: FullBraking(config.section("full_braking")), FullBrakingConfig, says="full braking"
)
'''

BROKEN = "raise RuntimeError('it does not even import')\n"


def wheel(folder: Path) -> Path:
    """A wheel of two modules, each the entry point of a backend; the second cannot be imported."""
    info = "toy_backend-1.0.dist-info"
    files = {
        "toy_backend.py": BACKEND,
        "toy_broken.py": BROKEN,
        f"{info}/METADATA": "Metadata-Version: 2.1\nName: toy-backend\nVersion: 1.0\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: tests\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        f"{info}/entry_points.txt": (
            "[repair.backends]\nfull_braking = toy_backend:SPEC\nbroken = toy_broken:SPEC\n"
        ),
    }
    rows = []
    for name, text in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(text.encode()).digest()).decode().rstrip("=")
        rows.append(f"{name},sha256={digest},{len(text.encode())}")
    files[f"{info}/RECORD"] = "\n".join([*rows, f"{info}/RECORD,,"]) + "\n"
    path = folder / "toy_backend-1.0-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return path


@pytest.fixture(scope="module")
def python(tmp_path_factory) -> Path:
    """Return the interpreter of a new environment with this one's packages and the toy."""
    folder = tmp_path_factory.mktemp("environment")
    venv.EnvBuilder(symlinks=True).create(folder / "env")
    interpreter = folder / "env" / "bin" / "python"
    ours = sysconfig.get_path("purelib")
    site = next((folder / "env" / "lib").glob("python*")) / "site-packages"
    (site / "ours.pth").write_text(f"import site; site.addsitedir({ours!r})\n")
    pip = [sys.executable, "-m", "pip", "--python", str(interpreter), "install", "--quiet", "--no-index"]
    subprocess.run([*pip, "--no-deps", "--disable-pip-version-check", str(wheel(folder))], check=True)
    return interpreter


@pytest.fixture(scope="module")
def scenario(tmp_path_factory) -> Path:
    """Return a straight road with a slower car ahead."""
    path = tmp_path_factory.mktemp("scenario") / "ZAM_Test-1_1_T-1.xml"
    path.write_text(roads.scenario(), encoding="utf-8")
    return path


def repair(python: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    command = [str(python), "-W", "ignore", "-m", "repair", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_it_runs_with_a_key_of_its_own(python, scenario, tmp_path):
    done = repair(
        python, "run", scenario, "--backend", "full_braking", "--reference", "constant",
        "--set", "full_braking.deceleration=5", "--out", tmp_path, "--no-figure",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "Backend   full_braking" in done.stdout
    result = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert result["status"] == "found"
    assert result["config"]["full_braking"] == {"deceleration": 5.0, "spacing": 0.2}
    assert result["peak_deceleration_mps2"] == pytest.approx(-5.0, abs=1.0)
    certified = repair(python, "certify", tmp_path)
    assert "Traceback" not in certified.stderr
    assert "solution_feasible" in certified.stdout


def test_its_keys_are_like_any_other(python, scenario, tmp_path):
    table = repair(python, "config", "--table").stdout
    assert "| `full_braking.deceleration` | `6.0` | 0.5 to 12 | how hard it brakes [m/s²] |" in table
    wrong = repair(
        python, "run", scenario, "--backend", "full_braking", "--set", "full_braking.decelaration=5"
    )
    assert wrong.returncode == 2
    assert "did you mean 'full_braking.deceleration'" in wrong.stderr
    beyond = repair(python, "run", scenario, "--set", "full_braking.deceleration=50", "backend=full_braking")
    assert beyond.returncode == 2
    assert "must lie in [0.5, 12]" in beyond.stderr
    file = tmp_path / "settings.yaml"
    file.write_text("for_backend: {full_braking: {full_braking: {deceleration: 3.0}}}\n", encoding="utf-8")
    shown = repair(python, "config", "--config", file, "--backend", "full_braking").stdout
    assert "deceleration: 3.0" in shown


def test_one_that_cannot_be_loaded_hurts_who_asks_for_it_alone(python, scenario):
    listed = repair(python, "backends")
    assert listed.returncode == 0
    assert "full_braking" in listed.stdout
    assert "it does not even import" in listed.stdout
    asked = repair(python, "run", scenario, "--backend", "broken")
    assert asked.returncode == 2
    assert "'broken' of an installed package cannot be loaded" in asked.stderr
