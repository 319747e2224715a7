// Watching: the three methods side by side, and the switches between their runs.
"use strict";

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
  const begin = "An expert drives from S to G (the broad line). Each method looks for rewards under which Q-learning "
    + "drives this way, too. The third is also shown mistakes (dashed): where the agent takes a step of a mistake that "
    + "the expert never takes, the reward of that step falls by more.";
  if (!complete()) return void ($("story").textContent = begin);
  $("story").textContent = `${begin} ${outcome()}`;
  const [steps, seconds] = ["steps", "seconds"].map((name) => runs.reduce((sum, { done }) => sum + done[name], 0));
  $("story").dataset.rate = String(steps / seconds);
}

/** What came out, in a sentence. */
function outcome() {
  const [, without, given] = runs.map((run) => run.done);
  const saved = without.iterations - given.iterations, where = parting();
  const hint = left.has("opposite") && drawing.incorrect.some(({ kind }) => kind === "opposite")
    ? " Moves in the opposite direction are left out here: tick them under Switches." : "";
  if (where < 0) return `Here the mistakes changed nothing: no marked pair made a difference.${hint}`;
  const words = saved > 0 ? `saved ${saved}` : saved < 0 ? `cost ${-saved}` : "saved none";
  return `Here the mistakes ${words} of ${without.iterations} iterations; the two part at iteration ${where}. `
    + `One trial says little: see Run many.${hint}`;
}

/** The number of the maze that the drawing is, -1 if it is another one. */
function known() {
  const content = ({ task: name, rows, correct, incorrect }) => JSON.stringify([name, rows, correct, incorrect]);
  return MAZES.findIndex((maze) => content(maze) === content(drawing));
}

MAZES.forEach(({ title }, k) => add($("maze"), "option", { value: String(k) }, title));
add($("maze"), "option", { value: "own" }, "another one");
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
