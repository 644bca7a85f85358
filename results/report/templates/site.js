// The leaderboard: one table with views, filters and ranks; two models side by side.
const LEVELS = [1, 2, 3, 4, 5];
const view = document.getElementById("view");
const filters = document.getElementById("filter");
const pair = document.getElementById("pair");
const ROWS = Object.keys(data.rows); // overall, dimensions, categories, tasks
const tasksOf = (category) => ROWS.filter((r) => data.rows[r].category === category);
const categories = ROWS.filter((r) => data.rows[r].kind === "category");
const rowName = (row) => words(data.rows[row].name);
const value = (model, column) => model.values[column.metric]?.[column.row]?.[column.level] || null;
// The official metric that stands beside one by the first choice; models are ranked by the latter.
const BESIDE = { sr1: "sr", onta1: "onta" };
const official = (model, column) => BESIDE[column.metric] ? value(model, { ...column, metric: BESIDE[column.metric] }) : null;
const shownValue = (model, column) => value(model, column) || official(model, column);
// As `rounding.shown`: noise of the last bits does not decide what is half.
const percent = (x) => (Math.sign(x) * Math.floor(Math.abs(x.toFixed(9)) * 10 + 0.5) / 10).toFixed(1);
const interval = (v) => `[${percent(v[1])}, ${percent(v[2])}]`;

// Two intervals make that of the difference (MOVER); `many` comparisons share the 5 %.
function difference(a, b) {
  return [a[0] - b[0], a[0] - b[0] - Math.hypot(a[0] - a[1], b[2] - b[0]),
    a[0] - b[0] + Math.hypot(a[2] - a[0], b[0] - b[1])];
}
function isBetter(a, b, many) {
  const [lead, low] = difference(a, b);
  return lead > 0 && data.critical[0] * lead > data.critical[Math.min(many, data.critical.length) - 1] * (lead - low);
}
const alike = (a, b) => a.group !== "" && a.group === b.group; // "": not known, so nobody's
// The ranks that a model may have in its group, by who is better and worse than it, and who cannot be
// told from it (tied); best: nobody there is better, and somebody is worse.
function ranks(models, column) {
  const found = new Map();
  const known = models.filter((m) => BESIDE[column.metric] && m.ranks[column.row]?.includes(column.level) && value(m, column));
  for (const model of known) {
    const others = known.filter((o) => o !== model && alike(o, model));
    const ahead = others.filter((o) => isBetter(value(o, column), value(model, column), others.length));
    const behind = others.filter((o) => isBetter(value(model, column), value(o, column), others.length));
    const tied = others.filter((o) => !ahead.includes(o) && !behind.includes(o));
    const rank = 1 + ahead.length;
    found.set(model, { text: tied.length ? `${rank}–${rank + tied.length}` : String(rank), best: !ahead.length && behind.length > 0, tied: tied.map((o) => o.name) });
  }
  return found;
}

// Which columns a view has.
function fill(select, pairs, kept = select.value) {
  select.replaceChildren(...pairs.map(([v, text]) => make("option", { value: v }, text)));
  if (pairs.some(([v]) => v === kept)) select.value = kept;
}
const hasRow = (metric, row) => data.models.some((m) => m.values[metric]?.[row] || m.values[BESIDE[metric]]?.[row]);
function columnsOf() {
  const show = view.elements.show.value;
  const metric = show === "overview" ? "sr1" : view.elements.metric.value;
  const level = Number(view.elements.level.value);
  const of = view.elements.of;
  const rows = ROWS.filter((r) => hasRow(metric, r));
  if (show === "levels") fill(of, rows.map((r) => [r, rowName(r)]));
  if (show === "tasks") fill(of, categories.filter((c) => rows.includes(c)).map((c) => [c, rowName(c)]));
  of.parentElement.hidden = !["levels", "tasks"].includes(show);
  view.elements.metric.parentElement.hidden = show === "overview";
  view.elements.level.parentElement.hidden = !["categories", "tasks"].includes(show);
  const at = (label, kind, row, n, title = "") => ({ label, metric: kind, row, level: n, title });
  if (show === "levels") return [at("all", metric, of.value, 0), ...LEVELS.map((n) => at("L" + n, metric, of.value, n))];
  if (show === "categories") return categories.filter((c) => rows.includes(c)).map((c) => at(c, metric, c, level, rowName(c)));
  if (show === "tasks") return [at(of.value, metric, of.value, level, rowName(of.value)),
    ...tasksOf(of.value).map((t) => at(rowName(t), metric, t, level))];
  return [...["overall", "spatial", "procedural"].map((r) => at(r, "sr1", r, 0, "SR@1")),
    at("ONTA@1", "onta1", "spatial", 0, "beyond guessing, spatial"), at("PS", "ps", "procedural", 0, "progress, procedural"),
    ...LEVELS.map((n) => at("L" + n, "sr1", "overall", n, "SR@1, overall"))];
}
const ABOUT = [["badge", (m) => data.badges[m.badge], (m) => -Object.keys(data.badges).indexOf(m.badge)],
  ["size", (m) => m.parameters, (m) => m.count]];

// The table: a part for every group, with ranks of its own.
const GROUPS = [...data.groups, { key: "", title: "Embodiment, scenes, instructions or suite not stated", note: "No ranks." }];
const head = document.querySelector("#board thead tr");
const board = document.getElementById("board");
let order = { name: "", down: true };
let columns = [];

function chosen() {
  const want = Object.fromEntries(new FormData(filters));
  const terms = want.text.toLowerCase().split(/\s+/).filter(Boolean);
  return data.models.filter((m) => ["embodiment", "mode", "suite", "track", "training", "scenes"].every((n) => !want[n] || m[n] === want[n]) &&
    (!want.badge || m.badges.includes(want.badge)) &&
    terms.every((t) => (m.name + "\n" + m.team).toLowerCase().includes(t)));
}
function sorted(models, column) {
  const extra = ABOUT.find((a) => a[0] === order.name);
  const key = order.name === "model" ? (m) => m.name : extra ? extra[2] || extra[1] : (m) => shownValue(m, column)?.[0] ?? null;
  const sign = order.down ? -1 : 1;
  return models.map((m) => [key(m), m]).sort(([a], [b]) =>
    (a === null) - (b === null) || sign * (typeof a === "number" ? a - b : String(a).localeCompare(String(b)))).map((p) => p[1]);
}
function heading(row, label, style, title, click) {
  const button = make("button", { type: "button", title }, label);
  const cell = make("th", { className: style, scope: "col" }, button);
  cell.dataset.name = label;
  button.addEventListener("click", click);
  row.append(cell);
}
function sortBy(name, down) {
  order = { name, down: order.name === name ? !order.down : down };
  draw(name);
}
// Who has the highest values of a group, by more than chance explains where ranks say so.
function leaders(own) {
  const led = new Map();
  let ranked = false;
  for (const row of ["overall", "spatial", "procedural", ...categories]) {
    const column = { metric: "sr1", row, level: 0 };
    const known = own.filter((m) => shownValue(m, column)).sort((a, b) => shownValue(b, column)[0] - shownValue(a, column)[0]);
    const best = [...ranks(own, column)].filter(([, place]) => place.best).map(([m]) => m);
    ranked ||= best.length > 0;
    for (const m of best.length ? best : known.slice(0, 1)) led.set(m.name, [...led.get(m.name) ?? [], `${row} ${percent(shownValue(m, column)[0])}`]);
  }
  const texts = [...led].map(([name, rows]) => `${name} (${rows.join(", ")})`);
  return own.length > 1 && texts.length ? [make("div", {}, (ranked ? "Leading significantly: " : "Highest, not ranked: ") + texts.join(", "))] : [];
}
function draw(focus) {
  const present = chosen();
  columns = columnsOf().filter((c, n) => !n || present.some((m) => shownValue(m, c))).map((c) =>
    BESIDE[c.metric] && !present.some((m) => value(m, c)) ? { ...c, metric: BESIDE[c.metric], label: c.label.replace("@1", ""), title: c.title.replace("@1", "") } : c);
  const by = columns.find((c) => c.label === order.name) || columns[0];
  const models = sorted(present, by);
  const places = columns.map((c) => ranks(models, c));
  const main = places[columns.indexOf(by)];
  const intervals = view.elements.intervals.checked;
  head.replaceChildren(...main.size ? [make("th", { scope: "col", className: "num", title: "by " + by.label }, "rank")] : []);
  heading(head, "model", "name", "", () => sortBy("model", false));
  for (const c of columns) heading(head, c.label, "num", c.title, () => sortBy(c.label, true));
  for (const [name] of ABOUT) heading(head, name, name === "size" ? "num" : "", "", () => sortBy(name, false));
  for (const cell of head.children) {
    if (cell.dataset.name === order.name) cell.setAttribute("aria-sort", order.down ? "descending" : "ascending");
    if (focus && cell.dataset.name === focus) cell.querySelector("button").focus({ preventScroll: true });
  }
  const line = (m) => {
    const row = make("tr");
    const tied = main.get(m)?.tied ?? [];
    if (main.size) row.append(make("td", { className: "num rank", title: tied.length ? "not distinguishable from " + tied.join(", ") : "" },
      main.get(m)?.text ?? (["published", "reproduced"].includes(m.badge) ? "–" : "claim")));
    const link = make("a", { href: `models/${m.id}/index.html` }, m.name);
    const more = [m.team, data.training[m.training]].filter(Boolean).join(" · ");
    row.append(make("th", { className: "name", scope: "row" }, link, make("small", {}, more)));
    const gap = longestGap(m);
    columns.forEach((c, n) => {
      if (n === gap.from) row.append(make("td", { className: "some", colSpan: gap.length }, partsRun(m)));
      if (n >= gap.from && n < gap.from + gap.length) return;
      const v = shownValue(m, c);
      const other = official(m, c);
      const place = places[n].get(m);
      const cell = make("td", { className: "num" + (place?.best ? " best" : "") }, v ? percent(v[0]) : "–");
      if (v && intervals) cell.append(make("small", {}, interval(v)));
      if (other) cell.append(make("small", { title: "by the official rule" }, data.metrics[BESIDE[c.metric]] + (other === v ? "" : " " + percent(other[0]))));
      row.append(cell);
    });
    for (const [name, text] of ABOUT) {
      const content = name === "badge" ? make("span", { className: "mark " + m.badge }, text(m)) : text(m);
      row.append(make("td", { className: name === "size" ? "num" : "" }, content));
    }
    return row;
  };
  for (const old of board.querySelectorAll("tbody")) old.remove();
  const shown = GROUPS.map((group) => [group, models.filter((m) => m.group === group.key)]).filter(([, own]) => own.length);
  for (const [group, own] of shown) {
    const text = make("th", { className: "group", colSpan: head.children.length, scope: "rowgroup" }, make("span", {}, group.title));
    if (group.note) text.append(make("small", {}, group.note));
    text.append(...leaders(own));
    board.append(make("tbody", {}, make("tr", { className: "group" }, text), ...own.map(line)));
  }
  document.getElementById("shown").textContent = models.length
    ? `${models.length} of ${data.models.length} models, ${main.size ? "ranked" : "sorted"} by ${by.title ? by.label + " (" + by.title + ")" : by.label}` +
      (shown.length > 1 ? ", each group separately" : "") : "no model matches";
}
// The longest run of columns, of three at least, of which a model has no values.
function longestGap(m) {
  let longest = { from: -1, length: 2 };
  columns.forEach((_, from) => {
    const length = [...columns.slice(from), null].findIndex((c) => !c || shownValue(m, c));
    if (length > longest.length) longest = { from, length };
  });
  return longest.from < 0 ? { from: -1, length: 0 } : longest;
}
// What a model has values of that such columns do not show: categories, else tasks.
function partsRun(m) {
  const at = (metric, row) => value(m, { metric, row, level: 0 });
  for (const [kind, metric] of ["category", "task"].flatMap((k) => [[k, "sr1"], [k, "sr"]])) {
    const rows = ROWS.filter((r) => data.rows[r].kind === kind && at(metric, r));
    if (rows.length) return `${data.metrics[metric]}: ` + rows.map((r) => `${kind === "task" ? rowName(r) : r} ${percent(at(metric, r)[0])}`).join(", ");
  }
  return "–";
}
function change() {
  columns = columnsOf();
  if (![...columns.map((c) => c.label), "model", ...ABOUT.map((a) => a[0])].includes(order.name)) order = { name: columns[0].label, down: true };
  draw();
}

// Two models side by side.
const SVG = "http://www.w3.org/2000/svg";
function shape(name, attributes, text = "") {
  const element = document.createElementNS(SVG, name);
  for (const [key, v] of Object.entries(attributes)) element.setAttribute(key, v);
  element.textContent = text;
  return element;
}
function chart(title, width, height, parts) {
  const svg = shape("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": title });
  svg.append(...parts);
  return make("figure", {}, make("h3", {}, title), svg);
}
const topOf = (all) => [10, 20, 40, 60, 80].find((x) => all.every((v) => v <= x)) || 100;
function radar(sides, metric, level) {
  const axes = categories.filter((c) => hasRow(metric, c));
  const top = topOf(sides.flatMap((m) => axes.map((c) => value(m, { metric, row: c, level })?.[0] ?? 0)));
  const at = (n, x) => {
    const angle = 2 * Math.PI * n / axes.length - Math.PI / 2;
    const r = 110 * Math.max(0, x) / top;
    return [170 + r * Math.cos(angle), 140 + r * Math.sin(angle)];
  };
  const ring = (x) => axes.map((c, n) => at(n, x).map((p) => p.toFixed(1)).join(",")).join(" ");
  const parts = [top / 2, top].map((x) => shape("polygon", { class: "grid", points: ring(x) }));
  axes.forEach((c, n) => {
    const [x, y] = at(n, top);
    const [tx, ty] = at(n, top * 1.13);
    parts.push(shape("line", { class: "grid", x1: 170, y1: 140, x2: x, y2: y }),
      shape("text", { x: tx, y: ty + 4, "text-anchor": "middle" }, c));
  });
  parts.push(shape("text", { x: 174, y: 140 - 110 + 12 }, top + " %"));
  sides.forEach((m, side) => {
    const points = axes.map((c, n) => [n, value(m, { metric, row: c, level })]).filter(([, v]) => v).map(([n, v]) => at(n, v[0]));
    const style = ["one", "two"][side];
    if (points.length > 2) parts.push(shape("polygon", { class: style, points: points.map((p) => p.map((x) => x.toFixed(1)).join(",")).join(" ") }));
    else parts.push(...points.map(([cx, cy]) => shape("circle", { class: style + " dot", cx, cy, r: 3.5 })));
  });
  return chart("Categories, " + (level ? "L" + level : "all levels"), 340, 280, parts);
}
function curve(sides, metric) {
  const rows = [metric.startsWith("sr") ? "overall" : metric.startsWith("onta") ? "spatial" : "procedural", ...categories];
  const row = rows.find((r) => sides.every((m) => value(m, { metric, row: r, level: 0 }))) || rows[0];
  const found = sides.map((m) => LEVELS.map((level) => value(m, { metric, row, level })));
  const top = topOf(found.flat().map((v) => (v ? v[2] : 0)));
  const x = (n) => 40 + 65 * n;
  const y = (v) => 240 - 210 * Math.max(0, v) / top;
  const parts = [0, top / 2, top].flatMap((v) => [shape("line", { class: "grid", x1: 36, x2: 310, y1: y(v), y2: y(v) }),
    shape("text", { x: 30, y: y(v) + 4, "text-anchor": "end" }, String(v))]);
  LEVELS.forEach((l, n) => parts.push(shape("text", { x: x(n), y: 260, "text-anchor": "middle" }, "L" + l)));
  found.forEach((values, side) => {
    const style = ["one", "two"][side];
    const known = values.map((v, n) => [n, v]).filter(([, v]) => v);
    parts.push(shape("polyline", { class: style, points: known.map(([n, v]) => `${x(n)},${y(v[0]).toFixed(1)}`).join(" ") }));
    for (const [n, v] of known) parts.push(shape("line", { class: style, "stroke-dasharray": "none", x1: x(n), x2: x(n), y1: y(v[1]), y2: y(v[2]) }),
      shape("circle", { class: style + " dot", cx: x(n), cy: y(v[0]), r: 3.5 }));
  });
  return chart(rowName(row) + " by level [%]", 340, 280, parts);
}
const HOW = {
  paired: "Paired: both ran the same seeds, and each trial is compared with the other's in the same scene. The difference is first minus second with its 95 % interval; won alone counts the trials in which only the first or only the second did better. Shaded: significantly better (q < 0.05: McNemar's test or the interval, corrected for the number of tasks or categories).",
  apart: "The difference is first minus second with its 95 % interval on unrelated seeds. Shaded: significantly better, corrected for the number of rows shown.",
  unlike: "The difference is first minus second with its 95 % interval. No value is shaded, because these two belong to different groups.",
  wait: "Loading the trials that both ran on equal seeds.",
  lost: "The trials that both ran on equal seeds could not be loaded: differences are computed as for unrelated seeds.",
};
const loaded = new Map(); // "first/second" -> paired differences by metric, row, level
function pairLoaded(key, rows) { loaded.set(key, rows); compare(); }
// Paired differences of two models, turned so that `a` is first; null if there are none (yet).
function pairOf(a, b) {
  const key = data.pairs.find((k) => k === `${a.id}/${b.id}` || k === `${b.id}/${a.id}`);
  if (!key) return { how: "apart", at: () => null };
  if (!loaded.has(key)) {
    loaded.set(key, null);
    const script = make("script", { src: `pairs/${key}.js` });
    script.addEventListener("error", () => { loaded.set(key, {}); compare(); });
    document.head.append(script);
  }
  const found = loaded.get(key);
  if (!found || !Object.keys(found).length) return { how: found ? "lost" : "wait", at: () => null };
  const turned = key !== `${a.id}/${b.id}`;
  return { how: "paired", at: (metric, row, level) => {
    const v = found[metric]?.[row]?.[level];
    return !v || !turned ? v : [-v[0], -v[2], -v[1], v[4], v[3], v[5]];
  } };
}
const PARTS = { suite: "suite", embodiment: "embodiment", mode: "scenes", split: "instructions", track: "track" };
// What differs between two models of different groups, in a sentence or two.
function differing(a, b) {
  const parts = Object.keys(PARTS).filter((p) => !a[p] || a[p] !== b[p]);
  const texts = parts.map((p) => `${PARTS[p]} (${a[p] || "not stated"}, ${b[p] || "not stated"})`);
  const more = parts.includes("suite") ? [a.suite, b.suite].map((s) => data.apart[s]).filter(Boolean) : [];
  return [`These two were not measured alike: they differ in ${texts.join(", ")}.`, ...more, "The difference does not say which policy is better."].join(" ");
}
function compare() {
  const sides = [pair.elements.one.value, pair.elements.two.value].map((id) => data.models.find((m) => m.id === id));
  const asked = pair.elements.metric.value;
  const unknown = asked in BESIDE && sides.some((m) => !Object.keys(m.values[asked] ?? {}).length);
  const metric = unknown ? BESIDE[asked] : asked;
  const level = Number(pair.elements.level.value);
  const like = alike(...sides);
  const unlike = document.getElementById("unlike");
  unlike.hidden = like;
  unlike.textContent = like ? "" : differing(...sides);
  document.querySelector(".charts").replaceChildren(radar(sides, metric, level), curve(sides, metric));
  const rows = ROWS.filter((r) => hasRow(metric, r) && (data.rows[r].kind !== "task" || pair.elements.tasks.checked));
  const pairing = pairOf(...sides);
  document.getElementById("how").textContent = (unknown ? "By the official rule, since first choices are not known for both. " : "") + HOW[like ? pairing.how : "unlike"];
  const names = sides.map((m, n) => make("span", {}, make("span", { className: "key" + (n ? " two" : "") }), m.name));
  const title = (content) => make("th", { scope: "col", className: "num" }, content);
  document.querySelector("#sides thead tr").replaceChildren(make("th", { scope: "col", className: "name" }, ""), ...names.map(title), title("differ\u00adence"),
    ...(pairing.how === "paired" ? [title("won alone")] : []));
  document.querySelector("#sides tbody").replaceChildren(...rows.map((r) => {
    const values = sides.map((m) => value(m, { metric, row: r, level }));
    const both = values.every(Boolean);
    const d = both ? pairing.at(metric, r, level) || difference(...values) : null;
    const line = make("tr", { className: ["task", pair.elements.tasks.checked ? "" : "category"].includes(data.rows[r].kind) ? "" : "part" },
      data.rows[r].kind === "category" ? make("th", { scope: "row", className: "name", title: rowName(r) }, r, make("small", {}, rowName(r).slice(r.length)))
        : make("th", { scope: "row", className: "name" }, rowName(r)));
    values.forEach((v, n) => {
      const won = like && (d && d.length > 3 ? d[5] < 0.05 && (n ? d[0] < 0 : d[0] > 0) : both && isBetter(v, values[1 - n], rows.length));
      line.append(make("td", { className: "num" + (won ? " best" : "") }, v ? percent(v[0]) : "–", v ? make("small", {}, interval(v)) : ""));
    });
    line.append(make("td", { className: "num" }, d ? (d[0] > 0 ? "+" : "") + percent(d[0]) : "–", d ? make("small", {}, interval(d)) : ""));
    if (pairing.how === "paired") line.append(make("td", { className: "num" }, d?.length > 3 ? `${d[3]} : ${d[4]}` : "–", d?.length > 3 ? make("small", {}, d[5] < 1e-4 ? "q < 0.0001" : `q = ${d[5]}`) : ""));
    return line;
  }));
}

function choices(name, texts) {
  const values = [...new Set(data.models.map((m) => m[name]))].filter(Boolean).sort();
  fill(filters.elements[name], [["", "all"], ...values.map((v) => [v, texts?.[v] ?? v])]);
  filters.elements[name].parentElement.hidden = values.length < 2;
}
for (const name of ["embodiment", "mode", "suite", "scenes", "track"]) choices(name);
choices("training", data.training);
const carried = Object.keys(data.badges).filter((b) => data.models.some((m) => m.badges.includes(b)));
fill(filters.elements.badge, [["", "all"], ...carried.map((b) => [b, data.badges[b]])]);
filters.elements.badge.parentElement.hidden = carried.length < 2;
const first = (m) => shownValue(m, { metric: "sr1", row: "overall", level: 0 })?.[0] ?? -1;
const place = (m) => GROUPS.findIndex((g) => g.key === m.group);
const by = [...data.models].sort((a, b) => place(a) - place(b) || first(b) - first(a));
const named = by.map((m) => [m.id, m.name]);
const shownFirst = by.find((m) => by.some((o) => o !== m && alike(m, o))) || by[0];
const shownSecond = by.find((m) => m !== shownFirst && alike(m, shownFirst)) || by.find((m) => m !== shownFirst) || shownFirst;
fill(pair.elements.one, named, shownFirst.id);
fill(pair.elements.two, named, shownSecond.id);
view.addEventListener("input", change);
filters.addEventListener("input", () => draw());
filters.addEventListener("reset", () => setTimeout(draw));
pair.addEventListener("input", compare);
for (const form of [view, filters, pair]) form.addEventListener("submit", (event) => event.preventDefault());
order.name = "overall";
change();
compare();
