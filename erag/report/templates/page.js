"use strict";
(() => {
  const $ = (id) => document.getElementById(id);
  const data = JSON.parse($("data").textContent);
  const [ID, NAME, CAPTION, TIME, READINGS, X, Y, ABOVE, OBJECT, PLACE] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9];
  const [CID, TITLE, LEVEL, OVER, VIEWS, CX, CY] = [0, 1, 2, 3, 4, 5, 6];
  const { nodes, clusters, questions, pictures, unit, size } = data;
  const svg = $("map"), frame = $("frame"), dots = $("dots"), tip = $("tip");
  const circles = new Array(nodes.length);
  for (const circle of dots.querySelectorAll("circle")) circles[+circle.dataset.node] = circle;
  const view = { x: 0, y: 0, w: size[0], h: size[1] };
  const state = { kept: -1, hover: -1, question: -1, cluster: -1, matches: null };
  const narrow = matchMedia("(max-width: 60rem)");

  // The view: a box in units with the shape of the frame.

  const pixel = () => view.w / Math.max(frame.clientWidth, 1); // units of a CSS pixel
  const dotPixels = () => {
    const each = Math.sqrt((size[0] * size[1]) / Math.max(nodes.length, 1)) / pixel();
    return Math.min(8, Math.max(2.4, each * 0.17));
  };
  let due = 0;
  const redraw = () => {
    if (!due) due = requestAnimationFrame(() => { due = 0; draw(); });
  };
  function draw() {
    svg.setAttribute("viewBox", [view.x, view.y, view.w, view.h].map((v) => v.toFixed(2)).join(" "));
    svg.style.setProperty("--u", pixel());
    svg.style.setProperty("--dot", dotPixels());
    drawScale();
    drawLabels();
    drawGoal();
  }
  function show(x0, y0, x1, y1) {
    const ratio = Math.max(frame.clientWidth, 1) / Math.max(frame.clientHeight, 1);
    const w = Math.max(x1 - x0, (y1 - y0) * ratio, 40);
    Object.assign(view, { w, h: w / ratio, x: (x0 + x1 - w) / 2, y: (y0 + y1 - w / ratio) / 2 });
    redraw();
  }
  const showAll = () => show(0, 0, size[0], size[1]);
  function showPoints(points, spare) {
    if (!points.length) return;
    const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]);
    const [x0, x1, y0, y1] = [least(xs), -least(xs.map((v) => -v)), least(ys), -least(ys.map((v) => -v))];
    const edge = Math.max((x1 - x0) * 0.18, (y1 - y0) * 0.18, spare);
    show(x0 - edge, y0 - edge, x1 + edge, y1 + edge);
  }
  const least = (values) => values.reduce((a, b) => Math.min(a, b), Infinity);
  function zoom(factor, px, py) {
    const w = Math.min(Math.max(view.w * factor, 20), 60 * size[0]), f = w / view.w;
    const u = pixel(), cx = view.x + px * u, cy = view.y + py * u;
    Object.assign(view, { w, h: view.h * f, x: cx - (cx - view.x) * f, y: cy - (cy - view.y) * f });
    redraw();
  }
  const zoomCentre = (factor) => zoom(factor, frame.clientWidth / 2, frame.clientHeight / 2);
  function reveal(row) {
    const [x, y] = [nodes[row][X], nodes[row][Y]], edge = view.w * 0.06;
    const seen = x > view.x + edge && x < view.x + view.w - edge && y > view.y + edge && y < view.y + view.h - edge;
    if (!seen) { view.x = x - view.w / 2; view.y = y - view.h / 2; redraw(); }
  }

  // What is drawn over the map.

  function drawScale() {
    const most = 110 * pixel() * unit, power = 10 ** Math.floor(Math.log10(most));
    const metres = [5, 2, 1].map((n) => n * power).find((n) => n <= most) || power;
    $("scale-bar").style.width = `${metres / unit / pixel()}px`;
    $("scale-text").textContent = metres >= 1000 ? `${metres / 1000} km` : `${+metres.toPrecision(1)} m`;
  }
  const bySize = clusters.map((_, i) => i).filter((i) => clusters[i][OVER] >= 0 || clusters.length === 1)
    .sort((a, b) => clusters[a][LEVEL] - clusters[b][LEVEL] || clusters[b][VIEWS] - clusters[a][VIEWS]);
  function text(x, y, said, kind) {
    const made = document.createElementNS(svg.namespaceURI, "text");
    made.setAttribute("x", x); made.setAttribute("y", y);
    if (kind) made.setAttribute("class", kind);
    made.textContent = said;
    $("labels").append(made);
  }
  function drawLabels() {
    $("labels").replaceChildren();
    const u = pixel(), taken = [], most = Math.max(4, Math.min(14, frame.clientWidth / 55));
    const place = (x, y, said, height) => {
      const half = said.length * 3.6 * u, box = [x - half, y - height * u, x + half, y + 5 * u];
      const clash = taken.some((b) => box[0] < b[2] && box[2] > b[0] && box[1] < b[3] && box[3] > b[1]);
      const outside = box[0] < view.x || box[2] > view.x + view.w || box[1] < view.y || box[3] > view.y + view.h;
      if (clash || outside) return false;
      taken.push(box);
      return true;
    };
    const question = questions[state.question];
    if (question) {
      question.hits.forEach((row, i) => {
        const [x, y] = [nodes[row][X] + 12 * u, nodes[row][Y] + 4 * u];
        if (row !== question.goal && place(x, y, "1", 11)) text(x, y, String(i + 1), "number");
      });
      if (question.goal !== null) taken.push(around(nodes[question.goal][X], nodes[question.goal][Y], u));
    }
    if (!$("names").checked) return;
    for (const i of bySize) {
      if (taken.length > (state.question >= 0 ? most / 2 : most)) break;
      const [x, y, title] = [clusters[i][CX], clusters[i][CY], clusters[i][TITLE]];
      const said = title.length > 26 ? `${title.slice(0, 25)}…` : title;
      if (place(x, y, said, 13)) text(x, y, said);
    }
  }
  const around = (x, y, u) => [x - 14 * u, y - 34 * u, x + 14 * u, y + 8 * u];
  function drawGoal() {
    const question = questions[state.question], u = pixel();
    if (!question || question.goal === null) { $("goal").setAttribute("d", ""); return; }
    const [x, y] = [nodes[question.goal][X], nodes[question.goal][Y]];
    const p = (dx, dy) => `${(x + dx * u).toFixed(1)} ${(y + dy * u).toFixed(1)}`;
    const pin = `M${p(0, 0)}C${p(-3, -8)} ${p(-10, -12)} ${p(-10, -20)}C${p(-10, -33)} ${p(10, -33)} ${p(10, -20)}`;
    $("goal").setAttribute("d", `${pin}C${p(10, -12)} ${p(3, -8)} ${p(0, 0)}Z`);
  }
  function drawWay(question) {
    const points = question ? question.way.map((row) => [nodes[row][X], nodes[row][Y]]) : [];
    if (question && question.start && points.length) points.unshift(question.start);
    if (points.length && question.goal !== null && question.goal !== question.way[question.way.length - 1])
      points.push([nodes[question.goal][X], nodes[question.goal][Y]]);
    const path = points.length > 1 ? `M${points.map((p) => p.join(" ")).join("L")}` : "";
    $("way").setAttribute("d", path);
    $("way-case").setAttribute("d", path);
    const start = question && question.start;
    $("start").toggleAttribute("hidden", !start);
    if (start) { $("start").setAttribute("cx", start[0]); $("start").setAttribute("cy", start[1]); }
    return points;
  }
  function light(rows) {
    for (const circle of dots.querySelectorAll(".on")) circle.classList.remove("on");
    dots.classList.toggle("dim", rows !== null);
    if (rows) for (const row of rows) circles[row].classList.add("on");
  }

  // The card of a node.

  function card(row) {
    const node = nodes[row];
    $("card-name").textContent = node[NAME] || node[ID];
    $("card-id").textContent = node[NAME] ? node[ID] : "";
    const readings = node[READINGS].map(([channel, value]) => `${channel} ${value}`);
    $("card-facts").textContent = [node[OBJECT] ? "object" : "place", node[TIME], ...readings, node[PLACE]].filter(Boolean).join(" · ");
    $("card-caption").firstElementChild.textContent = node[CAPTION] || (node[NAME] ? "" : "Nothing is said of it.");
    const picture = pictures[row];
    $("card-picture").hidden = !picture;
    if (picture) { $("card-picture").src = picture; $("card-picture").alt = `Image of ${node[NAME] || node[ID]}`; }
    const path = [];
    for (let i = node[ABOVE]; i >= 0; i = clusters[i][OVER]) path.unshift(i);
    $("card-path").replaceChildren(...path.flatMap((i, at) => {
      const button = document.createElement("button");
      button.type = "button"; button.textContent = clusters[i][TITLE]; button.dataset.jump = i;
      return at ? [" › ", button] : [button];
    }));
    $("card").scrollTop = 0;
  }
  function ring(row) {
    $("ring").toggleAttribute("hidden", row < 0);
    if (row >= 0) { $("ring").setAttribute("cx", nodes[row][X]); $("ring").setAttribute("cy", nodes[row][Y]); }
  }
  function keep(row, byPerson = true) {
    state.kept = row;
    ring(row);
    $("card").classList.toggle("kept", row >= 0 && byPerson);
    if (row >= 0) { card(row); if (byPerson) reveal(row); }
  }
  function hover(row, px, py) {
    state.hover = row;
    tip.hidden = row < 0;
    if (row < 0) { if (state.kept >= 0) card(state.kept); return; }
    tip.textContent = [nodes[row][ID], nodes[row][NAME]].filter(Boolean).join("  ");
    const left = Math.min(px + 14, frame.clientWidth - tip.offsetWidth - 6);
    tip.style.left = `${Math.max(left, 4)}px`;
    tip.style.top = `${py > 50 ? py - 34 : py + 18}px`;
    if (!narrow.matches) card(row);
  }
  function nearest(px, py, within) {
    const u = pixel(), x = view.x + px * u, y = view.y + py * u;
    let best = -1, least2 = (within * u) ** 2;
    nodes.forEach((node, row) => {
      const d2 = (node[X] - x) ** 2 + (node[Y] - y) ** 2;
      if (d2 < least2) { best = row; least2 = d2; }
    });
    return best;
  }
  function step(dx, dy) {
    if (state.kept < 0) { keep(Math.max(nearest(frame.clientWidth / 2, frame.clientHeight / 2, 1e6), 0)); return; }
    const from = nodes[state.kept];
    let best = -1, least = Infinity;
    nodes.forEach((node, row) => {
      const along = (node[X] - from[X]) * dx + (node[Y] - from[Y]) * dy;
      const aside = Math.abs((node[X] - from[X]) * dy) + Math.abs((node[Y] - from[Y]) * dx);
      if (along > 0 && aside <= along && along + aside < least) { best = row; least = along + aside; }
    });
    if (best >= 0) keep(best);
  }

  // Questions, clusters and searches: one of them is lit at a time.

  function chip(said) {
    $("clear").hidden = !said;
    $("clear").textContent = said ? `${said}  ✕` : "";
  }
  function clearAll() {
    Object.assign(state, { question: -1, cluster: -1, matches: null });
    for (const chosen of document.querySelectorAll(".cluster.chosen")) chosen.classList.remove("chosen");
    light(null); drawWay(null); chip(""); $("found").textContent = "";
    redraw();
  }
  function selectQuestion(i) {
    clearAll();
    $("search").value = "";
    state.question = i;
    const question = questions[i], rows = [...new Set([...question.hits, ...question.seen])];
    const points = drawWay(question);
    if (rows.length) { light(rows); chip("Answer"); }
    const first = question.goal ?? question.seen[0] ?? question.hits[0];
    if (first === undefined) keep(-1, false); else keep(first, false);
    showPoints([...points, ...rows.map((row) => [nodes[row][X], nodes[row][Y]])], 500);
  }
  function selectCluster(i) {
    clearAll();
    state.cluster = i;
    const inside = new Uint8Array(clusters.length), rows = [];
    for (let at = 0; at < clusters.length; at++)
      for (let up = at; up >= 0; up = clusters[up][OVER]) if (up === i) { inside[at] = 1; break; }
    nodes.forEach((node, row) => { if (node[ABOVE] >= 0 && inside[node[ABOVE]]) rows.push(row); });
    light(rows);
    chip(clusters[i][TITLE]);
    const details = document.querySelector(`[data-cluster="${i}"]`);
    details.classList.add("chosen");
    showPoints(rows.map((row) => [nodes[row][X], nodes[row][Y]]), 250);
  }
  function jump(i) {
    const details = document.querySelector(`[data-cluster="${i}"]`);
    for (let up = details; up; up = up.parentElement.closest("details")) up.open = true;
    details.scrollIntoView({ block: narrow.matches ? "end" : "center" });
    details.querySelector("summary").focus({ preventScroll: true });
    selectCluster(i);
  }
  function search() {
    const words = $("search").value.toLowerCase().split(/\s+/).filter(Boolean);
    clearAll();
    if (!words.length) return;
    const hit = (node) => words.every((w) => `${node[ID]} ${node[NAME]} ${node[CAPTION]}`.toLowerCase().includes(w));
    state.matches = nodes.map((_, row) => row).filter((row) => hit(nodes[row]));
    light(state.matches);
    $("found").textContent = `${state.matches.length.toLocaleString("en")} of ${nodes.length.toLocaleString("en")}`;
  }

  // Listeners.

  const at = (event) => { const box = svg.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
  const pointers = new Map();
  let moved = 0;
  svg.addEventListener("pointerdown", (event) => {
    pointers.set(event.pointerId, at(event));
    if (pointers.size === 1) moved = 0;
    svg.setPointerCapture(event.pointerId);
  });
  svg.addEventListener("pointermove", (event) => {
    const now = at(event), before = pointers.get(event.pointerId);
    if (!before) { hover(nearest(...now, 14), ...now); return; }
    const others = [...pointers].filter(([id]) => id !== event.pointerId).map(([, p]) => p);
    const u = pixel();
    moved += Math.hypot(now[0] - before[0], now[1] - before[1]);
    if (others.length) {
      const [far] = others, apart = (p) => Math.max(Math.hypot(p[0] - far[0], p[1] - far[1]), 1);
      zoom(apart(before) / apart(now), (now[0] + far[0]) / 2, (now[1] + far[1]) / 2);
    } else if (moved > 4) {
      svg.classList.add("drag");
      view.x -= (now[0] - before[0]) * u; view.y -= (now[1] - before[1]) * u;
      hover(-1);
      redraw();
    }
    pointers.set(event.pointerId, now);
  });
  const release = (event) => {
    const single = pointers.size === 1 && pointers.has(event.pointerId) && event.type === "pointerup";
    pointers.delete(event.pointerId);
    svg.classList.remove("drag");
    if (single && moved <= 4) keep(nearest(...at(event), event.pointerType === "touch" ? 26 : 14));
  };
  for (const type of ["pointerup", "pointercancel"]) svg.addEventListener(type, release);
  svg.addEventListener("pointerleave", () => hover(-1));
  svg.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(Math.max(-120, Math.min(120, event.deltaY)) * 0.0022), ...at(event));
  }, { passive: false });
  svg.addEventListener("keydown", (event) => {
    const act = {
      ArrowLeft: () => step(-1, 0), ArrowRight: () => step(1, 0), ArrowUp: () => step(0, -1), ArrowDown: () => step(0, 1),
      Enter: () => { if (state.kept >= 0) keep(state.kept); }, Escape: () => { keep(-1); clearAll(); },
      "+": () => zoomCentre(0.7), "=": () => zoomCentre(0.7), "-": () => zoomCentre(1.4), 0: showAll,
    }[event.key];
    if (act && !event.ctrlKey && !event.metaKey && !event.altKey) { event.preventDefault(); act(); }
  });
  $("in").addEventListener("click", () => zoomCentre(0.7));
  $("out").addEventListener("click", () => zoomCentre(1.4));
  $("fit").addEventListener("click", showAll);
  $("clear").addEventListener("click", () => { clearAll(); showAll(); });
  $("close").addEventListener("click", () => keep(-1));
  $("names").addEventListener("change", redraw);
  $("search").addEventListener("input", search);
  $("search").addEventListener("keydown", (event) => {
    if (event.key !== "Enter" || !state.matches || !state.matches.length) return;
    keep(state.matches[(state.matches.indexOf(state.kept) + 1) % state.matches.length]);
  });
  for (const box of document.querySelectorAll(".legend [data-kind]"))
    box.addEventListener("change", () => {
      svg.querySelector(`.edge[data-kind="${box.dataset.kind}"]`).classList.toggle("off", !box.checked);
    });
  document.addEventListener("click", (event) => {
    const button = event.target.closest("button[data-node], button[data-jump]");
    if (button && button.dataset.jump) jump(+button.dataset.jump);
    else if (button) keep(+button.dataset.node);
  });
  for (const summary of document.querySelectorAll(".cluster > summary"))
    summary.addEventListener("click", () => selectCluster(+summary.parentElement.dataset.cluster));
  for (const details of document.querySelectorAll(".question"))
    details.addEventListener("toggle", () => {
      const i = +details.dataset.question;
      if (details.open && state.question !== i) selectQuestion(i);
      else if (!details.open && state.question === i) clearAll();
    });
  new ResizeObserver(() => show(view.x, view.y, view.x + view.w, view.y + view.h)).observe(frame);

  for (const button of document.querySelectorAll(".hits button[data-node]")) {
    if (!pictures[button.dataset.node]) continue;
    const picture = document.createElement("img");
    picture.alt = "";
    picture.loading = "lazy";
    picture.src = pictures[button.dataset.node];
    button.querySelector(".rank").after(picture);
  }
  dots.classList.toggle("many", nodes.length > 400);
  ring(-1);
  drawWay(null);
  showAll();
  const open = document.querySelector(".question[open]");
  if (open) selectQuestion(+open.dataset.question);
  draw(); // a page that is printed or read before its first frame is complete
})();
