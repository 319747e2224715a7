// Drawing and driving: tools on the map, files, and what can be said against them.
"use strict";

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
  const number = known();
  $("maze").value = number < 0 ? "own" : String(number);
  left = number < 0 ? new Set() : new Set(DATA.leftOut);
  $("task").value = drawing.task;
  $("rows").value = String(drawing.rows.length);
  $("columns").value = String(drawing.rows[0].length);
  listKinds();
  edit();
  judge();
}

/** Change a part of the drawing, which then is no longer the maze that it was. */
function change(part) {
  const name = MAZES.some((maze) => maze.task === drawing.task) ? "mine" : drawing.task;
  redraw({ ...drawing, ...part, task: name, description: "" });
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
  $("run").disabled = $("export").disabled = verdict.className !== "verdict right";
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
      button.onclick = () => change({ [part]: drawing[part].filter((other) => other !== demo) });
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
    if (tool === "correct") return change({ correct: [{ name: "correct", kind: "correct", actions: driven }] });
    const kind = kindOf($("kind").value.trim());
    const name = free(new Set([...drawing.correct, ...drawing.incorrect].map((demo) => demo.name)), kind);
    change({ incorrect: [...drawing.incorrect, { name, kind, actions: driven }] });
  } catch (error) {
    if (!(error instanceof Refusal)) throw error;
    Object.assign($("verdict"), { className: "verdict wrong", textContent: error.message });
  }
}

/** Use a tool for walls, start or goal on a cell. */
function paint([row, column], wall) {
  const rows = drawing.rows.map((text) => [...text]);
  const old = rows[row][column];
  if (tool === "wall") {
    if ("SG".includes(old)) return;
    rows[row][column] = wall ? "#" : ".";
  } else {
    const mark = tool === "start" ? "S" : "G";
    if ("SG".includes(old)) return;
    for (const cells of rows) if (cells.includes(mark)) cells[cells.indexOf(mark)] = ".";
    rows[row][column] = mark;
  }
  if (rows[row][column] === old) return;
  change({ rows: rows.map((cells) => cells.join("")) });
  cursor = [row, column];
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

/** Drive, or move the cursor. */
function move(action) {
  if (drives()) return drive(action);
  const within = (x, size) => Math.min(Math.max(x, 0), size - 1);
  const [row, column] = here(), [down, right] = MOVES[action];
  cursor = [within(row + down, drawing.rows.length), within(column + right, drawing.rows[0].length)];
  edit();
}

$("map").onkeydown = (event) => {
  const action = ["ArrowUp", "ArrowDown", "ArrowRight", "ArrowLeft"].indexOf(event.key);
  if (action >= 0) move(action);
  else if (event.key === " " && !drives()) {
    const [row, column] = here();
    paint([row, column], drawing.rows[row][column] !== "#");
  } else if (event.key === "Enter" && tool === "mistake") finish();
  else if (event.key === "Backspace") undo();
  else return;
  event.preventDefault();
};
for (const button of document.querySelectorAll(".lab .pad button")) button.onclick = () => move(Number(button.dataset.action));
$("undo").onclick = undo;
$("finish").onclick = finish;
for (const kind of DATA.kinds) add($("known"), "option", { value: kind });

$("rows").onchange = $("columns").onchange = () => {
  const within = (text, old) => Math.min(Math.max(Math.round(Number(text)) || old, 1), MOST.side);
  const { rows } = drawing;
  const [height, width] = [within($("rows").value, rows.length), within($("columns").value, rows[0].length)];
  const next = Array.from({ length: height }, (_, r) => (rows[r] ?? "").slice(0, width).padEnd(width, "."));
  change({ rows: next, correct: [], incorrect: [] });
};
$("clear").onclick = () =>
  change({ rows: drawing.rows.map((row) => row.replaceAll("#", ".")), correct: [], incorrect: [] });
$("task").onchange = () => {
  drawing.task = $("task").value.trim().replace(/[^A-Za-z0-9_-]+/g, "-").replace(/^[^A-Za-z0-9]+/, "").slice(0, 100) || "mine";
  $("task").value = drawing.task;
};

$("export").onclick = () => {
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
