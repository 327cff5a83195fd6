"""The page of a study: what it says, that it needs nothing from elsewhere, and what a browser makes of it."""

from __future__ import annotations

import base64
import gzip
import json
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from tests import roads

import repair
from repair.cli import main
from repair.report.page.detail import detail_of
from repair.report.page.figures import figures_of, performance_profile, summary_of, verdict
from repair.report.page.html import study_page
from repair.study.plan import Study, tasks_of
from repair.study.rows import failed_row, strict
from repair.study.store import Store
from repair.study.task import Kept, row_of, unpacked

pytest.importorskip("plotly")
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def made(file, backend, status, **values):
    row = strict(failed_row(file, backend, "constant", status, ""))
    row.update(probes="0:+", search_time_s=0.1, ttc_s=2.0, ttr_s=1.0)
    return row | values


ROWS = [
    made("a.xml", "ego", "found", f_ttr_s=1.0, search_time_s=0.1),
    made("a.xml", "qptr", "found", f_ttr_s=0.5, search_time_s=0.4),
    made("b.xml", "ego", "found", f_ttr_s=1.0, search_time_s=0.2),
    made("b.xml", "qptr", "none_feasible", probes="0:-margin-limits"),
    made("c.xml", "ego", "no_conflict", probes=""),
    made("c.xml", "qptr", "timeout", probes=None, detail="</script><b>no answer</b>"),
]


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """Return a folder with a study of one scenario, and its report."""
    folder = tmp_path_factory.mktemp("study")
    file = folder / "ZAM_Test-1_1_T-1.xml"
    file.write_text(roads.scenario(), encoding="utf-8")
    study = Study((file,), ("ego", "qptr"), ("constant",), settings={"fallback": []}, official=False)
    kept = Kept()
    with Store(folder) as store:
        tasks = tasks_of(study)
        store.plan(tasks)
        store.tell(command="repair study <test>.yaml")
        for task in tasks:
            store.add(task, *row_of(task, kept))
    assert main(["report", str(folder)]) == 0
    return folder


def figure(name):
    return next(each for each in figures_of(ROWS) if each["id"] == name)


# -- figures ---------------------------------------------------------------------------------------


def test_the_sentence_and_the_table_count():
    text = verdict(ROWS)
    assert text.startswith(
        "6 rows of 3 scenarios: 3 repaired, 1 without a conflict, 1 without a repair, "
        "1 that could not be run."
    )
    assert "was not asked" in text
    judged = [row | {"official_feasible": True, "official_collision_free": k != 1, "official_on_road": True}
              for k, row in enumerate(ROWS[:2])]  # fmt: skip
    assert "rejected 1 of 2" in verdict(judged)
    _, body = summary_of(ROWS)
    assert body[0][:8] == ["ego", "3", "1", "2", "0", "0", "0", "1.00"]
    assert body[1][:8] == ["qptr", "3", "0", "1", "0", "1", "1", "0.50"]


def test_a_performance_profile_by_hand():
    profile = performance_profile(ROWS)
    assert profile["ego"] == ([1.0, 1.0, 1.0, 100.0], [0.0, 0.5, 1.0, 1.0])  # fastest in both cases
    assert profile["qptr"] == ([1.0, 4.0, 100.0], [0.0, 0.5, 0.5])  # four times as long, and the other never
    assert performance_profile(ROWS[4:]) == {}


def test_agreement_and_failures():
    (matrix,) = figure("agreement")["data"]
    assert matrix["z"] == [[100.0, 0.0], [0.0, 100.0]]
    assert matrix["text"][0][1] == "0 of 3 alike; the row's later in 3"
    (bars,) = figure("failures")["data"]
    assert dict(zip(bars["x"], bars["y"], strict=True)) == {"margin": 1, "limits": 1, "timeout": 1}
    assert [trace["name"] for trace in figure("against-ttc_s")["data"]] == ["ego", "qptr", "equal"]


# -- one row ---------------------------------------------------------------------------------------


def test_lateral_acceleration_of_a_circle():
    t = np.linspace(0.0, 5.0, 101)
    radius, speed = 20.0, 8.0
    x, y = radius * np.cos(speed / radius * t), radius * np.sin(speed / radius * t)
    line = {"kind": "reference", "name": "", "t_rep_s": None, "t": t.tolist(), "s": (speed * t).tolist(),
            "l": [0.0] * len(t), "x": x.tolist(), "y": y.tolist(), "speed": [speed] * len(t),
            "acceleration": [0.0] * len(t)}  # fmt: skip
    drawing = {"start_s_m": 0.0, "s_offset_m": 2.5, "until_s": 5.0, "steps": [0], "lines": [line],
               "boxes": [], "body": [[2, 1], [-2, 1], [-2, -1], [2, -1]], "ego": [[0.0, 0.0, 0.0]],
               "unrepaired": None,
               "bodies": [], "areas": [], "edges": []}  # fmt: skip
    record = {"status_sentence": "", "status": "no_conflict", "ttc_s": None, "f_ttr_s": None, "probes": [],
              "limits": {}, "notes": [], "trajectory": {"dt_s": 0.1}}  # fmt: skip
    detail = detail_of(record, drawing)
    across = np.array(detail["lines"][0]["across"])
    np.testing.assert_allclose(across, speed**2 / radius, rtol=0.01)  # to the left
    assert (detail["length"], detail["width"]) == (4.0, 2.0)


def test_what_is_shown_is_what_is_stored(stored):
    with Store(stored, readonly=True) as store:
        whole = unpacked(store.whole(0))
    detail = detail_of(whole["record"], whole["drawing"])
    assert [probe["t"] for probe in detail["probes"]] == [p["t_rep_s"] for p in whole["record"]["probes"]]
    reference = next(line for line in whole["drawing"]["lines"] if line["kind"] == "reference")
    shown = next(line for line in detail["lines"] if line["kind"] == "reference")
    for key in ("s", "x", "y"):
        expected = np.interp(shown["t"], reference["t"], reference[key])
        np.testing.assert_allclose(shown[key], expected, atol=0.15)  # of times rounded to 0.01 s
    assert shown["t"][0] == reference["t"][0]
    assert abs(shown["t"][-1] - reference["t"][-1]) < 0.01


def test_the_certificate_is_kept_and_shown(stored, tmp_path):
    """With every margin, as `repair certify` prints them."""
    file = stored / "ZAM_Test-1_1_T-1.xml"
    study = replace(Study((file,)), references=("constant",), official=False, certify=True)
    row, whole = row_of(tasks_of(study)[0], Kept())
    assert row["certificate"] == "ok"
    certificate = unpacked(whole)["certificate"]
    assert certificate["sentence"].startswith("certified")
    assert "obstacle_collision" in [line[0] for line in certificate["rows"]]
    assert {line[4] for line in certificate["rows"]} <= {"ok", "told"}
    detail = detail_of(unpacked(whole)["record"], unpacked(whole)["drawing"], certificate)
    assert detail["certificate"] == certificate
    page = study_page([row], [unpacked(whole)], {}, {})
    packed = json.loads(re.search(r'id="data">(.*?)</script>', page, re.DOTALL).group(1))["details"][0]
    assert json.loads(gzip.decompress(base64.b64decode(packed)))["certificate"] == certificate


# -- the page --------------------------------------------------------------------------------------


class Balanced(HTMLParser):
    """Elements that are opened and closed, and what they refer to."""

    def __init__(self):
        super().__init__()
        self.open, self.ids, self.refers = [], [], []

    def handle_starttag(self, tag, attributes):
        if tag not in ("meta", "link", "input", "br"):
            self.open.append(tag)
        for name, value in attributes:
            if name == "id":
                self.ids.append(value)
            if name in ("src", "href", "action"):
                self.refers.append(value)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_the_page_stands_by_itself(stored):
    page = (stored / "report.html").read_text("utf-8")
    parser = Balanced()
    parser.feed(page)
    assert parser.open == []
    assert len(parser.ids) == len(set(parser.ids))
    assert parser.refers == ["data:,"]  # no icon is asked for
    assert "@import" not in page.split("</style>")[0]
    assert "repair study &lt;test&gt;.yaml" in page
    assert f"numpy {np.__version__}" in page  # what the rows were made with
    assert len(page) < 8e6


def test_what_ends_a_script_is_data(stored):
    page = study_page(ROWS, [None] * len(ROWS), {}, {})
    assert page.lower().count("</script>") == 3
    data = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    rows = json.loads(data.group(1))["rows"]
    assert rows[-1][-1] == "</script><b>no answer</b>"
    data = re.search(r'id="data">(.*?)</script>', (stored / "report.html").read_text("utf-8"), re.DOTALL)
    content = json.loads(data.group(1))
    assert content["names"] == ["ZAM_Test-1_1_T-1.xml constant"] * 2
    case = json.loads(gzip.decompress(base64.b64decode(content["cases"][content["names"][0]])))
    assert [box["id"] for box in case["boxes"]] == [30]


def test_the_page_of_one_result(tmp_path, capsys):
    file = tmp_path / "ZAM_Test-1_1_T-1.xml"
    file.write_text(roads.scenario(), encoding="utf-8")
    repair.repair(file, overrides=["reference.source=constant"]).save(tmp_path / "out", figure=False)
    assert main(["report", str(tmp_path / "out"), "--out", str(tmp_path / "page.html")]) == 0
    assert "One result: found." in (tmp_path / "page.html").read_text("utf-8")
    capsys.readouterr()
    assert main(["report", str(tmp_path)]) == 2
    assert "holds no result.json" in capsys.readouterr().err


_DRIVEN = """<script>
const tell = (found) => parent.postMessage(JSON.stringify(found), "*");
window.addEventListener("error", (event) => tell({ error: event.message }));
window.addEventListener("unhandledrejection", (event) => tell({ error: String(event.reason) }));
console.error = (...words) => tell({ error: words.join(" ") });
window.addEventListener("load", async () => {
  const wait = (ms) => new Promise((done) => setTimeout(done, ms));
  const body = () => [...document.querySelectorAll("#rows tbody tr")].map((row) => row.cells[2].textContent);
  for (let k = 0; k < 100 && document.querySelectorAll("#plot-bird .trace").length < 1; k++) await wait(100);
  const slider = document.getElementById("slider"), said = [], curve = [];
  for (const place of [slider.min, slider.max]) {
    slider.value = place;
    slider.dispatchEvent(new Event("input"));
    await wait(300);
    said.push(document.getElementById("slider-words").textContent);
    curve.push(JSON.stringify(document.getElementById("plot-v").data.at(-1).y.slice(0, 5)) +
      document.getElementById("plot-v").data.map((each) => each.name).join());
  }
  const before = body();
  document.querySelectorAll("#rows th")[2].click();
  document.querySelectorAll("#rows th")[2].click();
  const sorted = body();
  const filter = document.getElementById("filter");
  filter.value = "QPTR";
  filter.dispatchEvent(new Event("input"));
  const kept = body(), page = document.documentElement;
  const plots = () => [...document.querySelectorAll(".js-plotly-plot")].map((place) =>
    [place.id, place.querySelector(".main-svg").getBoundingClientRect().width, place.style.height]);
  const screen = plots();
  document.getElementById("plot-v").style.width = "900px"; // as on a wide screen
  await Plotly.Plots.resize("plot-v");
  window.dispatchEvent(new Event("beforeprint"));
  const paper = plots();
  window.dispatchEvent(new Event("afterprint"));
  document.getElementById("plot-v").style.width = "";
  await Plotly.Plots.resize("plot-v");
  tell({ said, curve, before, sorted, kept, screen, paper, after: plots(),
    width: page.clientWidth, wide: page.scrollWidth - page.clientWidth });
});
</script></body>"""


_TELEPHONE = """<!DOCTYPE html><body>
<iframe src="driven.html" style="width: 390px; height: 800px; border: 0"></iframe>
<script>
window.addEventListener("message", (event) => { document.body.dataset.found ??= event.data; });
</script></body>"""


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")
def test_in_a_browser(stored, tmp_path):
    page = (stored / "report.html").read_text("utf-8")
    (tmp_path / "driven.html").write_text(page.replace("</body>", _DRIVEN), encoding="utf-8")
    frame = tmp_path / "frame.html"  # Chromium's own window is never as narrow
    frame.write_text(_TELEPHONE, encoding="utf-8")
    argv = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu",
            f"--user-data-dir={tmp_path / 'profile'}",
            "--virtual-time-budget=60000", "--dump-dom", frame.as_uri()]  # fmt: skip
    done = subprocess.run(argv, capture_output=True, text=True, timeout=300, check=True)
    told = re.search(r'data-found="(.*?)"', done.stdout)
    assert told is not None
    found = json.loads(told.group(1).replace("&quot;", '"').replace("&gt;", ">"))
    assert "error" not in found
    assert found["said"][0] != found["said"][1]
    assert found["curve"][0] != found["curve"][1]
    assert found["before"] == ["ego", "qptr"]
    assert found["sorted"] == ["qptr", "ego"]
    assert found["kept"] == ["qptr"]
    assert found["width"] <= 390
    assert found["wide"] <= 0  # nothing hangs over at the width of a telephone
    assert len(found["screen"]) == 12
    # On paper no figure is cut, however wide the screen was; then all is as it was.
    most = {name: 961.0 if name == "plot-bird" else 471.0 for name, _, _ in found["paper"]}
    assert all(width <= most[name] for name, width, _ in found["paper"])
    assert {name: width for name, width, _ in found["paper"]}["plot-v"] > 460.0
    assert found["after"] == found["screen"]


_MANY = """<script>
window.addEventListener("load", () => {
  const shown = () => document.querySelectorAll("#rows tbody tr").length, told = [shown()];
  document.getElementById("more").click();
  told.push(shown());
  const filter = document.getElementById("filter");
  filter.value = "timeout";
  filter.dispatchEvent(new Event("input"));
  document.body.dataset.found = JSON.stringify([...told, shown(),
    document.getElementById("count").textContent]);
});
</script></body>"""


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")
def test_very_many_rows_are_shown_by_and_by(tmp_path):
    rows = [row | {"file": f"{k}-{row['file']}"} for k in range(50) for row in ROWS]
    driven = tmp_path / "driven.html"
    page = study_page(rows, [None] * len(rows), {}, {})
    driven.write_text(page.replace("</body>", _MANY), encoding="utf-8")
    argv = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu",
            f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", driven.as_uri()]  # fmt: skip
    done = subprocess.run(argv, capture_output=True, text=True, timeout=300, check=True)
    told = re.search(r'data-found="(.*?)"', done.stdout)
    assert told is not None
    found = json.loads(told.group(1).replace("&quot;", '"'))
    assert found == [100, 200, 50, "50 of 300 rows"]


def test_a_study_without_results_has_a_table(stored, tmp_path):
    file = stored / "ZAM_Test-1_1_T-1.xml"
    study = replace(Study((file,)), references=("constant",), official=False, results=False)
    with Store(tmp_path) as store:
        tasks = tasks_of(study)
        store.plan(tasks)
        store.add(tasks[0], *row_of(tasks[0], Kept()))
    assert main(["report", str(tmp_path)]) == 0
    assert '"details":[null]' in (tmp_path / "report.html").read_text("utf-8")
