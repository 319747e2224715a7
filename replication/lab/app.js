// The page: what is drawn, what is chosen, and the trials that follow from both.
"use strict";

const DATA = JSON.parse(document.getElementById("lab-data").textContent);
const METHOD_MARKS = Object.fromEntries(DATA.methods.map(({ name, marks }) => [name, marks]));
const $ = (id) => document.getElementById(id);
const bytes = (text) => Uint8Array.from(atob(text), (character) => character.charCodeAt(0));

function add(parent, tag, attributes = {}, text = "") {
  const node = parent.appendChild(document.createElement(tag));
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.textContent = text;
  return node;
}

// ---------------------------------------------------------------- trials, away from the page

/** Trials that run in workers, a few at once. */
class Trials {
  constructor(workers) {
    this.waiting = [];
    this.running = new Map();
    const code = new Blob([$("lab-worker").textContent], { type: "text/javascript" });
    this.address = URL.createObjectURL(code);
    this.idle = Array.from({ length: workers }, () => this.start());
  }

  start() {
    const worker = new Worker(this.address);
    worker.postMessage({ wasm: bytes(DATA.wasm) });
    worker.onmessage = ({ data }) => {
      const job = this.running.get(worker);
      if (!job) return;
      if (data.now) return job.each(data.now);
      this.running.delete(worker);
      this.idle.push(worker);
      job.settle(data);
      this.next();
    };
    return worker;
  }

  /** Run a trial; `each` is told of every iteration if the job is watched. */
  run(job, each = () => {}) {
    return new Promise((resolve, reject) => {
      const settle = (data) => (data.done ? resolve(data.done) : reject(new Error(data.failed)));
      this.waiting.push({ job, each, settle });
      this.next();
    });
  }

  next() {
    while (this.idle.length && this.waiting.length) {
      const [worker, job] = [this.idle.pop(), this.waiting.shift()];
      this.running.set(worker, job);
      worker.postMessage(job.job);
    }
  }

  /** Stop all; what was asked for is never answered. */
  stop() {
    this.waiting = [];
    for (const worker of this.running.keys()) {
      worker.terminate();
      this.idle.push(this.start());
    }
    this.running.clear();
  }
}

const cores = Math.min(4, navigator.hardwareConcurrency || 2);
const watching = new Trials(DATA.methods.length);
const counting = new Trials(cores);

// ---------------------------------------------------------------- what is chosen

const unpack = (demo) => ({ ...demo, actions: Array.from(demo.actions, Number) });
const MAZES = DATA.mazes.map(({ correct, incorrect, ...rest }) =>
  ({ ...rest, correct: correct.map(unpack), incorrect: incorrect.map(unpack) }));
const copy = (value) => structuredClone(value);

let drawing = copy(MAZES[0]);
let task = check(drawing);
let chosen = {};
let left = new Set(DATA.leftOut); // the kinds of incorrect demonstrations that are not used

const params = () => ({ ...DATA.params, ...chosen });
const used = (of = task, without = left) =>
  ({ ...of, incorrect: of.incorrect.filter(({ kind }) => !without.has(kind)) });
const job = (method, root, trial, more = {}) => {
  const { world, correct, incorrect } = used();
  return { task: { world, correct, incorrect }, method, params: params(), root, trial, ...more };
};

// ---------------------------------------------------------------- watching

let runs = [], at = 0, playing = true, timer = null;
const panels = DATA.methods.map(({ name, label, colour }) => {
  const figure = add($("panels"), "figure", { style: `--own: ${colour}` });
  const caption = add(figure, "figcaption");
  const canvas = add(figure, "canvas", { role: "img", "aria-label": `What ${label} has learned` });
  return { name, label, colour, figure, caption, canvas };
});
panels.forEach(({ figure, canvas, caption }) => figure.append(canvas, caption));

/** Begin again with what is drawn and chosen. */
function restart() {
  watching.stop();
  at = 0;
  playing = true;
  $("story").dataset.rate = "";
  runs = panels.map(({ name, label, colour }) => ({ name, label, colour, frames: [], done: null }));
  for (const run of runs) {
    watching.run(job(run.name, chosen.seed ?? 0, 0, { watched: true }), (now) => {
      run.frames.push(now);
      if (playing) tick();
      show();
    }).then((done) => {
      run.done = done;
      show();
    }, (error) => {
      run.failed = error.message;
      show();
    });
  }
  show();
}

const last = () => Math.max(0, ...runs.map((run) => run.frames.length - 1));
const complete = () => runs.every((run) => run.done);

/** Advance while it plays; the pace lets all trials be followed to their end in some seconds. */
function tick() {
  if (timer) return;
  timer = setTimeout(() => {
    timer = null;
    if (!playing) return;
    if (at < last() && runs.every((run) => run.done || run.frames.length > at + 1)) at++;
    if (at === last() && complete()) playing = false;
    else tick();
    show();
  }, 160);
}

function go(to) {
  playing = false;
  at = Math.min(Math.max(to, 0), last());
  show();
}

/** The first iteration at which incorrect demonstrations made a difference. */
function parting() {
  const [, without, given] = runs;
  const both = Math.min(without.frames.length, given.frames.length);
  for (let i = 0; i < both; i++)
    if (without.frames[i].w.some((value, k) => value !== given.frames[i].w[k])) return i;
  return without.frames.length === given.frames.length ? -1 : both;
}

let asked = false;
function show() {
  if (asked) return;
  asked = true;
  requestAnimationFrame(() => {
    asked = false;
    const shown = $("shown").value;
    panels.forEach(({ canvas, caption, label, name }, k) => {
      const { frames, done, failed } = runs[k];
      const now = frames[Math.min(at, frames.length - 1)];
      caption.textContent = "";
      add(caption, "b", {}, label);
      if (failed) add(caption, "span", {}, `cannot be computed here: ${failed}`);
      if (!now) return;
      const ended = done && at >= done.iterations;
      const words = !ended ? `d = ${now.error.toFixed(2)} after ${now.i} iterations`
        : done.converged ? `d = 0 after ${now.i} iterations` : `stopped after ${now.i} iterations, d = ${now.error.toFixed(2)}`;
      add(caption, "span", {}, `${words}, ${(now.steps / 1e6).toFixed(1)} million steps`);
      drawLearned(canvas, used(), now, shown, name);
    });
    drawCurves($("curves"), runs, at);
    Object.assign($("at"), { max: String(Math.max(1, last())), value: String(at) });
    $("count").textContent = `iteration ${at} of ${last()}`;
    $("play").textContent = playing ? "Pause" : "Play";
    $("part").disabled = !complete() || parting() < 0;
    tell();
  });
}

function tell() {
  const begin = "An expert drives from S to G (the broad line). Each method sees only this path, and looks for rewards "
    + "under which Q-learning drives it, too. The third is also shown mistakes (dashed): a pair of state and action that "
    + "a mistake contains, and the expert does not, loses more at once.";
  if (!complete()) return void ($("story").textContent = begin);
  $("story").textContent = `${begin} ${outcome()}`;
  const [steps, seconds] = ["steps", "seconds"].map((name) => runs.reduce((sum, { done }) => sum + done[name], 0));
  $("story").dataset.rate = String(steps / seconds);
}

/** What came out, in a sentence. */
function outcome() {
  const [, without, given] = runs.map((run) => run.done);
  const saved = without.iterations - given.iterations, where = parting();
  if (where < 0) return "Here the mistakes changed nothing: the agent never met a marked pair that the expert avoids.";
  const words = saved > 0 ? `saved ${saved}` : saved < 0 ? `cost ${-saved}` : "saved none";
  return `Here the mistakes ${words} of ${without.iterations} iterations; the two part at iteration ${where}. `
    + "One trial says little: see Run many.";
}

// ---------------------------------------------------------------- choosing

const own = () => MAZES.findIndex(({ task: name, rows }) => name === drawing.task && rows.join() === drawing.rows.join()
  && JSON.stringify(MAZES.find((maze) => maze.task === name).incorrect) === JSON.stringify(drawing.incorrect));

MAZES.forEach(({ title }, k) => add($("maze"), "option", { value: String(k) }, title));
add($("maze"), "option", { value: "own" }, "your own");
$("maze").onchange = () => {
  if ($("maze").value !== "own") redraw(copy(MAZES[Number($("maze").value)]));
};

const fields = DATA.choices.map(({ field, label, values, place }) => {
  const outer = add($("choices"), "label", { title: place }, label);
  const select = add(outer, "select", { id: `choice-${field}` });
  for (const value of values) add(select, "option", { value: JSON.stringify(value) }, String(value));
  select.onchange = () => {
    chosen[field] = JSON.parse(select.value);
    restart();
  };
  return { field, select };
});
const seedLabel = add($("choices"), "label", {}, "seed");
const seed = add(seedLabel, "input", { type: "number", id: "seed", min: "0", max: "4294967295", value: "0" });
seed.onchange = () => {
  chosen.seed = Math.min(Math.max(Math.round(Number(seed.value)) || 0, 0), 4294967295);
  seed.value = String(chosen.seed);
  restart();
};

function choose(values) {
  chosen = values;
  for (const { field, select } of fields) select.value = JSON.stringify(values[field] ?? DATA.params[field]);
  seed.value = String(values.seed ?? 0);
}

$("defaults").onclick = () => {
  choose({});
  left = new Set(DATA.leftOut);
  listKinds();
  restart();
};

function listKinds() {
  $("kinds").textContent = "";
  for (const kind of new Set(drawing.incorrect.map((demo) => demo.kind))) {
    const label = add($("kinds"), "label");
    const box = add(label, "input", { type: "checkbox" });
    label.append(` ${kind} `);
    box.checked = !left.has(kind);
    box.onchange = () => {
      if (box.checked) left.delete(kind);
      else left.add(kind);
      restart();
    };
  }
}

$("play").onclick = () => {
  playing = !playing;
  if (playing && at === last() && complete()) at = 0;
  if (playing) tick();
  show();
};
$("step").onclick = () => go(at + 1);
$("at").oninput = () => go(Number($("at").value));
$("part").onclick = () => go(parting());
$("shown").onchange = show;

// ---------------------------------------------------------------- drawing and driving

const TOOLS = { wall: "Walls", start: "Start", goal: "Goal", correct: "Drive the correct demo", mistake: "Drive a mistake" };
let tool = "mistake", driven = [], cursor = null, history = [];
for (const [name, label] of Object.entries(TOOLS)) {
  const outer = add($("tools"), "label");
  const radio = add(outer, "input", { type: "radio", name: "lab-tool", value: name });
  outer.append(` ${label}`);
  radio.checked = name === tool;
  radio.onchange = () => {
    tool = name;
    driven = [];
    edit();
  };
}
const drives = () => tool === "correct" || tool === "mistake";

/** Put another drawing in the place of this one; `undo` brings it back. */
function redraw(next, { remember = true } = {}) {
  if (remember) history = [...history.slice(-49), copy(drawing)];
  drawing = next;
  driven = [];
  cursor = null;
  const known = own();
  $("maze").value = known < 0 ? "own" : String(known);
  left = known < 0 ? new Set() : new Set(DATA.leftOut);
  $("task").value = drawing.task;
  $("rows").value = String(drawing.rows.length);
  $("columns").value = String(drawing.rows[0].length);
  listKinds();
  edit();
  judge();
}

/** Say what `demos check` would say, and learn from what can be used. */
function judge() {
  const verdict = $("verdict");
  try {
    task = check(drawing);
    verdict.className = "verdict right";
    verdict.textContent = task.warnings.length ? task.warnings.join("; ") : "These demonstrations can be used.";
    restart();
  } catch (error) {
    if (!(error instanceof Refusal)) throw error;
    verdict.className = "verdict wrong";
    verdict.textContent = error.message;
  }
}

function worldOf(rows) {
  try {
    return makeWorld(rows);
  } catch {
    return null;
  }
}

/** Show the map, its demonstrations, the drive, and where the cursor is. */
function edit() {
  const { rows } = drawing;
  const sheet = drawMap($("map"), rows);
  const { context, size, center, ink } = sheet;
  const world = worldOf(rows);
  if (world) {
    for (const { actions } of drawing.correct) drawWay(sheet, world, replay(world, actions), { color: ink, width: 0.45, alpha: 0.25 });
    for (const { actions } of drawing.incorrect)
      drawWay(sheet, world, replay(world, actions), { color: MARKED, width: 0.12, alpha: 0.7, dash: [0.2, 0.3] });
    if (driven.length) drawWay(sheet, world, replay(world, driven), { color: tool === "correct" ? ink : MARKED, width: 0.25 });
  }
  drawEnds(sheet, rows);
  const [row, column] = here();
  context.strokeStyle = "#0072b2";
  context.lineWidth = 2.5;
  context.strokeRect(column * size + 1, row * size + 1, size - 2, size - 2);
  if (drives() && world) {
    context.fillStyle = tool === "correct" ? ink : MARKED;
    context.beginPath();
    context.arc(...center([row, column]), size * 0.3, 0, 7);
    context.fill();
  }
  $("where").textContent = drives()
    ? `${TOOLS[tool]}: at row ${row}, column ${column} after ${driven.length} moves${tool === "mistake" ? "; finish it anywhere" : ", up to the goal"}.`
    : `${TOOLS[tool]}: row ${row}, column ${column}; Space or a click changes it.`;
  $("finish").disabled = tool !== "mistake" || !driven.length;
  $("undo").disabled = !driven.length && !history.length;
  $("demos").textContent = "";
  $("total").textContent = `${drawing.correct.length} correct demo, ${drawing.incorrect.length} incorrect`;
  for (const part of ["correct", "incorrect"])
    for (const demo of drawing[part]) {
      const item = add($("demos"), "li", {}, `${demo.name}, ${demo.actions.length} moves`);
      const button = add(item, "button", { type: "button", "aria-label": `Remove ${demo.name}` }, "✕");
      button.onclick = () => redraw({ ...drawing, [part]: drawing[part].filter((other) => other !== demo) });
    }
}

/** The cell of the cursor: where the drive is, or what is to be drawn on. */
function here() {
  const world = drives() && worldOf(drawing.rows);
  if (world) return cell(world, replay(world, driven).at(-1));
  const [row, column] = cursor ?? [0, 0];
  return [Math.min(row, drawing.rows.length - 1), Math.min(column, drawing.rows[0].length - 1)];
}

const free = (names, stem) => {
  let k = 1;
  while (names.has(`${stem}-${k}`)) k++;
  return `${stem}-${k}`;
};

function drive(action) {
  const world = worldOf(drawing.rows);
  if (!world || driven.length >= MOST.moves) return;
  driven.push(action);
  if (replay(world, driven).at(-1) === world.goal) finish();
  else edit();
}

function finish() {
  if (!driven.length) return;
  try {
    if (tool === "correct") return redraw({ ...drawing, correct: [{ name: "correct", kind: "correct", actions: driven }] });
    const kind = kindOf($("kind").value.trim());
    const name = free(new Set([...drawing.correct, ...drawing.incorrect].map((demo) => demo.name)), kind);
    redraw({ ...drawing, incorrect: [...drawing.incorrect, { name, kind, actions: driven }] });
  } catch (error) {
    if (!(error instanceof Refusal)) throw error;
    Object.assign($("verdict"), { className: "verdict wrong", textContent: error.message });
  }
}

/** Use a tool for walls, start or goal on a cell. */
function paint([row, column], wall) {
  const rows = drawing.rows.map((line_) => [...line_]);
  const old = rows[row][column];
  if (tool === "wall") {
    if ("SG".includes(old)) return;
    rows[row][column] = wall ? "#" : ".";
  } else {
    const mark = tool === "start" ? "S" : "G";
    if ("SG".includes(old)) return;
    rows.forEach((line_) => line_.forEach((character, c) => { if (character === mark) line_[c] = "."; }));
    rows[row][column] = mark;
  }
  if (rows[row][column] === old) return;
  const place_ = [row, column];
  redraw({ ...drawing, rows: rows.map((line_) => line_.join("")) });
  cursor = place_;
  edit();
}

function undo() {
  if (driven.length) {
    driven.pop();
    edit();
  } else if (history.length) {
    redraw(history.pop(), { remember: false });
  }
}

let laying = null; // whether a stroke of the pointer lays walls or takes them away
const cellAt = (event) => {
  const box = $("map").getBoundingClientRect();
  const [height, width] = [drawing.rows.length, drawing.rows[0].length];
  const within = (x, most) => Math.min(Math.max(Math.floor(x), 0), most - 1);
  return [within(((event.clientY - box.top) / box.height) * height, height), within(((event.clientX - box.left) / box.width) * width, width)];
};
$("map").onpointerdown = (event) => {
  event.preventDefault();
  $("map").focus({ preventScroll: true });
  $("map").setPointerCapture(event.pointerId);
  const [row, column] = cellAt(event);
  laying = drawing.rows[row][column] !== "#";
  point(event);
};
$("map").onpointermove = (event) => {
  if (laying !== null) point(event);
};
$("map").onpointerup = $("map").onpointercancel = () => (laying = null);

function point(event) {
  const target = cellAt(event);
  if (!drives()) return paint(target, laying);
  // towards the pointer, the longer way first; into a wall once
  for (let guard = 0; guard < 2 * MOST.side && laying !== null; guard++) {
    const [row, column] = here();
    const [down, right] = [target[0] - row, target[1] - column];
    if (!down && !right) return;
    const action = Math.abs(down) > Math.abs(right) ? (down < 0 ? 0 : 1) : right > 0 ? 2 : 3;
    const before = driven.length;
    drive(action);
    if (driven.length <= before) laying = null; // it has ended
    else if (here()[0] === row && here()[1] === column) laying = null;
  }
}

$("map").onkeydown = (event) => {
  const action = ["ArrowUp", "ArrowDown", "ArrowRight", "ArrowLeft"].indexOf(event.key);
  if (action >= 0) {
    if (drives()) drive(action);
    else {
      const [row, column] = here(), [down, right] = MOVES[action];
      cursor = [Math.min(Math.max(row + down, 0), drawing.rows.length - 1), Math.min(Math.max(column + right, 0), drawing.rows[0].length - 1)];
      edit();
    }
  } else if (event.key === " " && !drives()) {
    const [row, column] = here();
    paint([row, column], drawing.rows[row][column] !== "#");
  } else if (event.key === "Enter" && tool === "mistake") finish();
  else if (event.key === "Backspace") undo();
  else return;
  event.preventDefault();
};
for (const button of document.querySelectorAll(".lab .pad button"))
  button.onclick = () => $("map").onkeydown({ key: ["ArrowUp", "ArrowDown", "ArrowRight", "ArrowLeft"][button.dataset.action], preventDefault() {} });
$("undo").onclick = undo;
$("finish").onclick = finish;
for (const kind of DATA.kinds) add($("known"), "option", { value: kind });

$("rows").onchange = $("columns").onchange = () => {
  const within = (text, old) => Math.min(Math.max(Math.round(Number(text)) || old, 1), MOST.side);
  const { rows } = drawing;
  const [height, width] = [within($("rows").value, rows.length), within($("columns").value, rows[0].length)];
  const next = Array.from({ length: height }, (_, r) => (rows[r] ?? "").slice(0, width).padEnd(width, "."));
  redraw({ ...drawing, rows: next, correct: [], incorrect: [] });
};
$("clear").onclick = () =>
  redraw({ ...drawing, rows: drawing.rows.map((row) => row.replaceAll("#", ".")), correct: [], incorrect: [] });
$("task").onchange = () => {
  drawing.task = $("task").value.trim().replace(/[^A-Za-z0-9_-]+/g, "-").replace(/^[^A-Za-z0-9]+/, "").slice(0, 100) || "mine";
  $("task").value = drawing.task;
};

$("export").onclick = () => {
  if ($("verdict").classList.contains("wrong")) return;
  const address = URL.createObjectURL(new Blob([write(drawing)], { type: "application/json" }));
  const link = document.createElement("a");
  Object.assign(link, { href: address, download: `${drawing.task}.json` });
  link.click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
};

async function open(file) {
  const verdict = $("verdict");
  try {
    if (file.size > MOST.bytes) throw new Refusal(`is larger than ${MOST.bytes / 1e6} MB; drop some demos`);
    redraw(read(await file.text()));
  } catch (error) {
    if (!(error instanceof Refusal)) throw error;
    Object.assign(verdict, { className: "verdict wrong", textContent: `${clip(file.name)}: ${error.message}` });
  }
  verdict.dataset.file = file.name;
}
$("import").onchange = () => {
  const [file] = $("import").files;
  if (file) open(file);
  $("import").value = "";
};
$("lab").ondragover = (event) => event.preventDefault();
$("lab").ondrop = (event) => {
  event.preventDefault();
  const [file] = event.dataTransfer.files;
  if (file) open(file);
};

// ---------------------------------------------------------------- many trials

/** Mean, and the half-width of its 95 % interval. */
function meanOf(values) {
  const sum = (numbers) => numbers.reduce((total, x) => total + x, 0);
  const n = values.length, mean = sum(values) / n;
  const spread = Math.sqrt(sum(values.map((value) => (value - mean) ** 2)) / (n - 1));
  return [mean, n > 1 ? (DATA.quantiles[n - 2] * spread) / Math.sqrt(n) : NaN];
}
const signed = (x) => x.toFixed(2).replace("-", "−");
const interval = ([mean, half]) => `${signed(mean)} [${signed(mean - half)}, ${signed(mean + half)}]`;

$("run").onclick = async () => {
  counting.stop();
  if ($("run").textContent === "Stop") {
    $("run").textContent = "Run";
    return;
  }
  const n = Math.min(Math.max(Math.round(Number($("trials").value)) || 20, 10), 100);
  $("trials").value = String(n);
  $("run").textContent = "Stop";
  $("histogram").hidden = false;
  const groups = DATA.methods.map(({ name, label, colour }) => ({ name, label, colour, values: [], trials: [] }));
  let steps = 0, seconds = 0;
  const jobs = [];
  for (let trial = 0; trial < n; trial++)
    for (const group of groups)
      jobs.push(counting.run(job(group.name, chosen.seed ?? 0, trial)).then((done) => {
        group.values.push(done.iterations);
        group.trials[trial] = done;
        steps += done.steps;
        seconds += done.seconds;
        $("meter").textContent = `${groups.reduce((sum, { values }) => sum + values.length, 0)} of ${3 * n} trials, `
          + `${Math.round(steps / seconds / 1e6)} million steps a second`;
        drawHistogram($("histogram"), groups);
        summarize(groups, n);
      }));
  await Promise.all(jobs);
  $("run").textContent = "Run";
};

let counted = [];
function summarize(groups, n) {
  counted = groups;
  const table = document.createElement("table");
  const head = add(add(table, "thead"), "tr");
  for (const name of ["Method", "Trials", "Iterations, mean [95 % interval]", "Not converged"]) add(head, "th", { scope: "col" }, name);
  const body = add(table, "tbody");
  const line_ = (...cells) => {
    const row = add(body, "tr");
    cells.forEach((text, k) => add(row, k ? "td" : "th", k ? {} : { scope: "row" }, text));
  };
  for (const { label, values, trials } of groups)
    line_(label, String(values.length), values.length > 1 ? interval(meanOf(values)) : "", String(trials.filter((done) => !done.converged).length));
  const [, without, given] = groups;
  const saved = Array.from({ length: n }, (_, k) => k).filter((k) => without.trials[k] && given.trials[k])
    .map((k) => without.trials[k].iterations - given.trials[k].iterations);
  if (saved.length > 1) line_("Saved by incorrect ones, paired", String(saved.length), interval(meanOf(saved)), "");
  $("summary").replaceChildren(table);
}

// ---------------------------------------------------------------- published trials

const checking = new Trials(1);
const published = DATA.published.groups;
const digests = bytes(DATA.published.digests);
published.forEach(({ title }, k) => add($("condition"), "option", { value: String(k) }, title));
$("published").hidden = !published.length;
$("condition").onchange = () => ($("number").max = String(published[Number($("condition").value)].trials - 1));

/** The first digits of the digest of a published trial. */
function digitsOf(group, trial) {
  const size = DATA.published.digits / 2, from = (group.first + trial) * size;
  return Array.from(digests.subarray(from, from + size), (byte) => byte.toString(16).padStart(2, "0")).join("");
}

async function checkPublished(group, trial) {
  const item = add($("checks"), "li", {}, `${group.title}, trial ${trial}: computing`);
  const drawn = MAZES.find((maze) => maze.task === group.task);
  const all = check(drawn);
  const wanted = group.set === "none" ? [] : group.set.split("+");
  const incorrect = all.incorrect.filter(({ kind }) => wanted.includes(kind));
  const { world, correct } = all;
  try {
    const done = await checking.run({
      task: { world, correct, incorrect }, method: group.method, params: { ...DATA.params, ...group.params },
      root: group.seed, trial, digested: true,
    });
    const found = done.digest.slice(7, 7 + DATA.published.digits), right = digitsOf(group, trial);
    item.textContent = `${found === right ? "✓" : "✗"} ${group.title}, trial ${trial}: ${done.iterations} iterations, digest `
      + (found === right ? `${found}, as published` : `${found}, but ${right} is published`);
    item.dataset.digest = done.digest;
  } catch (error) {
    item.textContent = `✗ ${group.title}, trial ${trial}: ${error.message}`;
  }
}

$("check").onclick = () => {
  const group = published[Number($("condition").value)];
  const trial = Math.min(Math.max(Math.round(Number($("number").value)) || 0, 0), group.trials - 1);
  $("number").value = String(trial);
  checkPublished(group, trial);
};
$("check-many").onclick = async () => {
  $("check-many").disabled = true;
  const total = published.reduce((sum, { trials }) => sum + trials, 0);
  for (let k = 0; k < 20; k++) {
    const row = Math.floor(Math.random() * total);
    const group = published.findLast(({ first }) => first <= row);
    await checkPublished(group, row - group.first);
  }
  $("check-many").disabled = false;
};

// ---------------------------------------------------------------- the beginning

const entries = [["rgb(0 158 115)", "reward above 0"], ["rgb(204 121 167)", "below 0"], ["currentColor", "the agent's path"], [MARKED, "mistakes shown"]];
for (const [color, words] of entries) {
  const entry = add($("key"), "span");
  add(entry, "i", { style: `background: ${color}` });
  entry.append(words);
}
choose({});
redraw(drawing, { remember: false });
new ResizeObserver(() => {
  show();
  edit();
  if (counted.length) drawHistogram($("histogram"), counted);
}).observe($("lab"));
new MutationObserver(() => {
  show();
  edit();
}).observe(document.documentElement, { attributes: true, attributeFilter: ["data-theme"] });
