"use strict";
(function () {
  const data = JSON.parse(document.getElementById("data").textContent);
  const by = (id) => document.getElementById(id);
  const look = { responsive: true, displayModeBar: false };
  const base = {
    margin: { l: 56, r: 12, t: 12, b: 84 }, paper_bgcolor: "white", plot_bgcolor: "white", hovermode: "closest",
    legend: { orientation: "h", yref: "container", y: 0, yanchor: "bottom", x: 0, font: { size: 11 } }, font: { size: 12 },
  };
  const axis = (title, more) => Object.assign({ title: { text: title }, gridcolor: "#eee", zerolinecolor: "#ccc" }, more);

  // What takes a while comes one after the other, so that the page can be read and used meanwhile.
  const jobs = [];
  const later = () => setTimeout(() => { if (jobs.length) { jobs.shift()(); later(); } }, 0);
  const all = () => { while (jobs.length) jobs.shift()(); };
  // On paper everything is there, and a figure no wider than its place on the sheet.
  window.addEventListener("beforeprint", () => {
    all();
    shownRows = Infinity;
    fill();
    zoomed((place) => Math.min(1, (place.closest(".full") ? 960 : 470) / place.clientWidth));
  });
  window.addEventListener("afterprint", () => zoomed(() => ""));
  function zoomed(by) {
    for (const place of document.querySelectorAll(".js-plotly-plot")) {
      const zoom = by(place);
      place.firstElementChild.style.zoom = zoom;
      place.style.height = zoom === "" ? place.dataset.height : parseFloat(place.dataset.height) * zoom + "px";
    }
  }

  // A figure with as much room below it as its legend takes.
  function drawn(id, traces, layout) {
    const place = by(id), named = traces.filter((each) => each.showlegend !== false && each.name);
    const longest = Math.max(...named.map((each) => each.name.length), 1);
    const across = Math.max(Math.floor(place.clientWidth / (60 + 6.5 * longest)), 1);
    const below = 50 + (layout.showlegend === false ? 0 : 19 * Math.ceil(named.length / across));
    place.dataset.height = place.style.height = (place.closest(".full") ? 420 : 270) + below + "px";
    const margin = Object.assign({}, base.margin, { b: below });
    return Plotly.react(place, traces, Object.assign({}, base, layout, { margin: margin }), look);
  }

  // -- of all rows ----------------------------------------------------------------------------------
  if (!document.body.classList.contains("one")) {
    for (const figure of data.figures) {
      jobs.push(() => drawn("figure-" + figure.id, figure.data, figure.layout));
    }
  }

  const table = by("rows"), head = table.tHead, body = table.tBodies[0];
  const shown = (value) => value === null || value === undefined ? "" :
    typeof value === "number" ? String(Math.round(value * 1e5) / 1e5) : String(value);
  const texts = data.rows.map((row) => row.map(shown));
  const found = texts.map((row) => row.join(" ").toLowerCase());
  let order = data.rows.map((_, k) => k), sorted = null, down = false;

  const line = head.insertRow();
  data.columns.forEach((name, column) => {
    const cell = document.createElement("th");
    cell.textContent = name;
    cell.scope = "col";
    cell.tabIndex = 0;
    const sort = () => {
      down = sorted === column ? !down : false;
      sorted = column;
      const value = (k) => data.rows[k][column];
      order.sort((a, b) => {
        const x = value(a), y = value(b);
        if (x === null || x === "" || y === null || y === "") {
          return (x === null || x === "") - (y === null || y === "") || a - b; // what is not there comes last
        }
        const less = typeof x === "number" && typeof y === "number" ? x - y : String(x).localeCompare(String(y));
        return (down ? -less : less) || a - b;
      });
      for (const other of line.cells) other.removeAttribute("aria-sort");
      cell.setAttribute("aria-sort", down ? "descending" : "ascending");
      fill();
    };
    cell.addEventListener("click", sort);
    cell.addEventListener("keydown", (event) => { if (event.key === "Enter") sort(); });
    line.append(cell);
  });

  const step = 100; // rows at a time: a browser lays out ten thousand cells as slowly as all else together
  let shownRows = step, chosenRow = -1;
  const lines = new Map();
  function lineOf(k) {
    if (lines.has(k)) return lines.get(k);
    const made = document.createElement("tr");
    for (const text of texts[k]) {
      const cell = document.createElement("td");
      cell.textContent = text;
      made.append(cell);
    }
    made.addEventListener("click", () => choose(k, true));
    made.classList.toggle("chosen", k === chosenRow);
    lines.set(k, made);
    return made;
  }

  function fill() {
    const words = by("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
    const kept = order.filter((k) => words.every((word) => found[k].includes(word)));
    body.replaceChildren(...kept.slice(0, shownRows).map(lineOf));
    by("count").textContent = kept.length + " of " + order.length + " rows";
    by("more").hidden = kept.length <= shownRows;
    by("more").textContent = "Show more: " + Math.min(step, kept.length - shownRows) + " of the other " + (kept.length - shownRows);
  }
  by("filter").addEventListener("input", () => { shownRows = step; fill(); });
  by("more").addEventListener("click", () => { shownRows += step; fill(); });
  fill();

  // -- of one row -----------------------------------------------------------------------------------
  async function opened(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return JSON.parse(await new Response(stream).text());
  }

  let one = null, road = null, lastChosen = 0;

  async function choose(k, scroll) {
    const turn = ++lastChosen;
    chosenRow = k;
    lines.forEach((row, j) => row.classList.toggle("chosen", j === k));
    by("detail").hidden = false;
    by("detail-title").textContent = data.names[k];
    if (data.details[k] === null) {
      one = null;
      by("detail-sentence").textContent = "The result of this row was not kept.";
      return;
    }
    const detail = await opened(data.details[k]);
    const around = data.cases[data.names[k]] ? await opened(data.cases[data.names[k]]) : null;
    if (turn !== lastChosen) return; // another one was chosen meanwhile
    one = detail;
    road = around;
    by("detail-sentence").textContent = one.sentence;
    by("facts").replaceChildren(...data.columns.flatMap((column, j) => {
      if (texts[k][j] === "" || ["file", "reference", "detail"].includes(column)) return [];
      const pair = document.createElement("div");
      for (const [tag, text] of [["dt", column], ["dd", texts[k][j]]]) {
        const part = document.createElement(tag);
        part.textContent = text;
        pair.append(part);
      }
      return [pair];
    }));
    by("notes").replaceChildren(...one.notes.map((note) => {
      const item = document.createElement("li");
      item.textContent = note;
      return item;
    }));
    const rowOf = (cells) => {
      const row = document.createElement("tr");
      for (const text of cells) row.insertCell().textContent = text;
      return row;
    };
    by("probes").tBodies[0].replaceChildren(...one.probes.map((probe) =>
      rowOf([probe.t.toFixed(2), probe.by, probe.ok ? "feasible" : "rejected", probe.words, probe.why])));
    by("certificate").hidden = !one.certificate;
    by("certificate-words").textContent = one.certificate ? one.certificate.sentence : "";
    by("certificate-rows").replaceChildren(...(one.certificate ? one.certificate.rows : []).map(rowOf));
    one.repairs = one.lines.filter((each) => each.kind === "repair").sort((a, b) => a.t_rep - b.t_rep);
    const best = one.repairs.findLastIndex((each) => one.f_ttr !== null && Math.abs(each.t_rep - one.f_ttr) < 1e-6);
    const slider = by("slider");
    slider.max = Math.max(one.repairs.length - 1, 0);
    slider.value = best < 0 ? 0 : best;
    slider.disabled = one.repairs.length < 2;
    const reference = one.lines.find((each) => each.kind === "reference");
    // Where the reference goes far, the few metres that decide are nothing to be seen.
    by("relative").checked = Boolean(reference) && one.lines.length > 1 && reference.s.at(-1) - reference.s[0] > 50;
    draw();
    if (scroll) by("detail").scrollIntoView({ behavior: "smooth", block: "start" });
  }

  // The value at a time between those that are there; null outside of them.
  function between(times, values, t) {
    const last = times.length - 1;
    if (t < times[0] - 1e-9 || t > times[last] + 1e-9) return null;
    let k = times.findIndex((each) => each >= t);
    if (k < 1) return k === 0 ? values[0] : values[last];
    const share = (t - times[k - 1]) / Math.max(times[k] - times[k - 1], 1e-9);
    return values[k - 1] + share * (values[k] - values[k - 1]);
  }

  // Shortly before a repair is somewhere else than the reference; 0 where the way there is short.
  function begins(reference) {
    if (reference.s.at(-1) - reference.s[0] < 50 || one.ttc === null || !one.repairs.length) return 0;
    const left = one.repairs.map((line) => line.t.find((t, k) =>
      Math.hypot(line.s[k] - at(reference, t), line.beside[k]) > 0.5)).filter((t) => t !== undefined);
    return Math.max(Math.min(one.f_ttr ?? one.ttc, one.ttc, ...left) - 1, 0);
  }

  // Where the reference is at a time; after its end it keeps its speed.
  function at(reference, t) {
    const inside = between(reference.t, reference.s, t);
    return inside !== null ? inside : reference.s.at(-1) + reference.v.at(-1) * (t - reference.t.at(-1));
  }

  function verdictOf(line) {
    const probes = one.probes.filter((each) => Math.abs(each.t - line.t_rep) < 1e-6);
    return probes.find((each) => each.ok) || probes[0];
  }

  function draw() {
    const reference = one.lines.find((each) => each.kind === "reference");
    if (!reference) {
      by("slider-words").textContent = "";
      by("probe-why").textContent = "Nothing was drawn of this row.";
      return;
    }
    const chosen = one.repairs[Number(by("slider").value)];
    const probe = chosen ? verdictOf(chosen) : null;
    by("slider-words").textContent = chosen ?
      chosen.t_rep.toFixed(2) + " s: " + (probe && probe.ok ? "feasible" : "rejected") : "no repair was drawn";
    by("probe-why").textContent = probe ? probe.words + (probe.ok || !probe.why ? "" : ". " + probe.why) : "";
    const good = !probe || probe.ok, colour = good ? "#0072b2" : "#d55e00";
    const after = chosen && Math.abs(chosen.t_rep - one.f_ttr) < 1e-6 && good ?
      one.lines.filter((each) => each.kind === "continuation" || each.kind === "onward") : [];
    const name = chosen ? (good ? "repair" : "rejected") + ", " + chosen.t_rep.toFixed(2) + " s" : "";

    const moving = by("relative").checked;
    const shown = (t, s) => moving ? s - at(reference, t) : s - one.start;
    const placed = (line) => line.s.map((s, k) => shown(line.t[k], s));
    function curves(column, more) {
      const valued = (each) => column === "s" ? placed(each) : each[column];
      const made = one.repairs.filter((each) => each !== chosen).map((each) => ({
        x: each.t, y: valued(each), mode: "lines", line: { color: "#c8c8c8", width: 1 }, showlegend: false,
        hovertemplate: "t_rep " + each.t_rep.toFixed(2) + " s<extra></extra>",
      }));
      made.push({ x: reference.t, y: valued(reference), mode: "lines", name: "reference",
        line: { color: "#555", dash: "dash", width: 1.5 } });
      if (chosen) made.push({ x: chosen.t, y: valued(chosen), mode: "lines", name: name, line: { color: colour, width: 2.5 } });
      for (const each of after) {
        made.push({ x: each.t, y: valued(each), mode: "lines", name: each.kind === "onward" ? "onward" : "stop after it",
          line: { color: colour, width: 1.5, dash: "dot" } });
      }
      return made.concat(more || []);
    }
    const limit = (value, text) => value === null || value === undefined ? [] : [{
      x: [0, one.until], y: [value, value], mode: "lines", name: text, line: { color: "#b00020", width: 1, dash: "dashdot" },
    }];
    const moments = [];
    if (one.ttc !== null) moments.push([one.ttc, "TTC"]);
    if (chosen) moments.push([chosen.t_rep, "t_rep"]);
    const shapes = moments.map(([t]) => ({ type: "line", x0: t, x1: t, y0: 0, y1: 1, yref: "paper",
      line: { color: "#888", width: 1, dash: "dot" } }));
    const labels = moments.map(([t, text], k) => ({ x: t, y: 1, yref: "paper", yanchor: "top", xanchor: k ? "right" : "left",
      text: text, showarrow: false, font: { size: 11, color: "#555" } }));
    const time = axis("t [s]");
    const panel = (id, title, traces, more) => drawn(id, traces,
      { xaxis: time, yaxis: axis(title, more), shapes: shapes, annotations: labels });

    // Distance: the ego's own length, and the others without the margin.
    const half = one.length / 2, others = [];
    for (const box of road ? road.boxes : []) {
      box.runs.forEach((run) => others.push({
        x: run[0].concat(run[0].slice().reverse()),
        y: [run[1], run[2].slice().reverse()].flatMap((ends, j) =>
          ends.map((s, k) => shown(run[0][j ? run[0].length - 1 - k : k], s))),
        fill: "toself",
        mode: "lines", line: { color: "#444", width: 1 }, fillcolor: "rgba(60,60,60,0.55)", showlegend: false,
        hoverinfo: "text", text: "obstacle " + box.id,
      }));
    }
    const on = chosen || reference;
    const middle = placed(on);
    const band = { x: on.t.concat(on.t.slice().reverse()),
      y: middle.map((s) => s + half).concat(middle.map((s) => s - half).reverse()), fill: "toself", mode: "none",
      fillcolor: chosen ? (good ? "rgba(0,114,178,0.22)" : "rgba(213,94,0,0.22)") : "rgba(90,90,90,0.2)", name: "the ego's length", hoverinfo: "skip" };
    // Where the picture has the ego on somebody, and the check has not: it is beside it.
    const free = chosen ? good : one.status === "no_conflict";
    const overlaps = (k) => (road ? road.boxes : []).some((box) => box.runs.some((run) => {
      const low = between(run[0], run[1], on.t[k]), high = between(run[0], run[2], on.t[k]);
      return low !== null && on.s[k] + half > low && on.s[k] - half < high;
    }));
    const aside = middle.map((s, k) => free && overlaps(k) ? s : null);
    const beside = { x: on.t, y: aside, mode: "markers", marker: { symbol: "circle-open", size: 7, color: colour },
      name: "beside it, as from above: no contact", hoverinfo: "skip" };
    const seen = one.lines.filter((each) => each.kind !== "continuation" && each.kind !== "onward").flatMap(placed);
    const low = Math.min(...seen) - half, high = Math.max(...seen) + half, room = 0.06 * (high - low) + 1;
    panel("plot-s", moving ? "ahead of the reference [m]" : "distance driven [m]", others.concat([band], curves("s"), aside.some((s) => s !== null) ? [beside] : []),
      { range: [low - Math.max(room, half), high + Math.max(room, half)] });
    panel("plot-l", "l [m], left is positive", curves("l"));
    panel("plot-v", "v [m/s]", curves("v", limit(one.limits.v_max, "largest speed")), speedRange());
    panel("plot-a", "a [m/s²]", curves("a", limit(one.limits.a_min, "smallest").concat(limit(one.limits.a_max, "largest"))));
    panel("plot-across", "a [m/s²], left is positive",
      curves("across", limit(one.limits.a_lat, "largest").concat(limit(-one.limits.a_lat, "to the other side"))));

    function speedRange() { // a limit that is far away would press everything else flat
      const speeds = one.lines.flatMap((each) => each.v), top = Math.max(...speeds, 1);
      return { range: [Math.min(...speeds, 0) - 0.05 * top, top * 1.15] };
    }

    const turn = Array.from({ length: 73 }, (_, k) => k * Math.PI / 36), radius = one.limits.a_total;
    drawn("plot-circle", [
      { x: turn.map((w) => radius * Math.cos(w)), y: turn.map((w) => radius * Math.sin(w)), mode: "lines", name: "limit",
        line: { color: "#b00020", width: 1, dash: "dashdot" }, hoverinfo: "skip" },
      { x: reference.across, y: reference.a, mode: "lines", name: "reference", line: { color: "#555", dash: "dash", width: 1 } },
    ].concat(chosen ? [{ x: chosen.across, y: chosen.a, mode: "lines+markers", name: name, marker: { size: 4, color: colour },
      line: { color: colour, width: 1.5 } }] : []), {
      xaxis: axis("across [m/s²]"), yaxis: axis("along [m/s²]", { scaleanchor: "x" }) });
    birdseye(reference, chosen, after, name, colour);
  }

  function birdseye(reference, chosen, after, name, colour) {
    const traces = [];
    const filled = (xy, fill, edge, text, legend) => ({ x: xy[0], y: xy[1], mode: "lines", fill: "toself", fillcolor: fill,
      line: { color: edge, width: 1 }, hoverinfo: text ? "text" : "skip", text: text, showlegend: Boolean(legend), name: legend });
    for (const area of road ? road.areas : []) traces.push(filled(area, "#eceff1", "#b0bec5"));
    const step = road ? road.steps[0] : 0;
    for (const body of road ? road.bodies : []) {
      if (body.path[0].length > 1) traces.push({ x: body.path[0], y: body.path[1], mode: "lines", line: { color: "#bbb", width: 1 },
        showlegend: false, hoverinfo: "skip" });
      const at = body.shapes[String(step)];
      if (at) traces.push(filled(at, "rgba(60,60,60,0.6)", "#333", "obstacle " + body.id));
    }
    traces.push({ x: reference.x, y: reference.y, mode: "lines", name: "reference", line: { color: "#555", dash: "dash" } });
    if (chosen) traces.push({ x: chosen.x, y: chosen.y, mode: "lines", name: name, line: { color: colour, width: 3 } });
    for (const each of after) traces.push({ x: each.x, y: each.y, mode: "lines", name: "after it", line: { color: colour, dash: "dot" } });
    const on = chosen || reference, at = step * one.dt;
    let k = 0;
    on.t.forEach((t, j) => { if (Math.abs(t - at) < Math.abs(on.t[k] - at)) k = j; });
    const next = Math.min(k + 1, on.t.length - 1), before = Math.max(next - 1, 0);
    let w = Math.atan2(on.y[next] - on.y[before], on.x[next] - on.x[before]);
    if (one.ego && one.ego.length && (!chosen || Math.abs(chosen.t_rep - one.f_ttr) < 1e-6)) {
      w = one.ego.reduce((a, b) => Math.abs(b[3] - step) < Math.abs(a[3] - step) ? b : a)[2]; // of who stands, too
    }
    const corners = [[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]].map(([a, b]) => [a * one.length / 2, b * one.width / 2]);
    traces.push(filled([corners.map(([a, b]) => on.x[k] + a * Math.cos(w) - b * Math.sin(w)),
      corners.map(([a, b]) => on.y[k] + a * Math.sin(w) + b * Math.cos(w))], "rgba(0,114,178,0.5)", colour, "the ego",
      "the ego, all at " + on.t[k].toFixed(1) + " s"));
    const from = begins(reference), kept = (column) => one.lines.flatMap((each) => each[column].filter((_, k) => each.t[k] >= from));
    const xs = kept("x"), ys = kept("y");
    drawn("plot-bird", traces, {
      xaxis: axis("x [m]", { range: [Math.min(...xs) - 8, Math.max(...xs) + 8] }),
      yaxis: axis("y [m]", { range: [Math.min(...ys) - 8, Math.max(...ys) + 8], scaleanchor: "x" }) });
  }

  by("relative").addEventListener("change", () => { if (one) draw(); });
  by("slider").addEventListener("input", () => { if (one) draw(); });
  const status = data.columns.indexOf("status"), kept = data.details.map((each) => each !== null);
  const repaired = kept.findIndex((there, k) => there && data.rows[k][status] === "found");
  const first = repaired >= 0 ? repaired : kept.indexOf(true);
  if (first >= 0) jobs.push(() => choose(first, false));
  later();
})();
