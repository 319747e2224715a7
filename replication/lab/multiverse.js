// The multiverse: every choice at once, as published. What a reader selects is run here, too.
"use strict";

const verse = DATA.multiverse;
const allIterations = bytes(verse.iterations);
const leaving = verse.choices.map(() => new Set()); // of each choice the values that are left out, as digits
let effects = [], selected = null, universes = null;

/** The published iterations of a method's trials; one above the cap did not converge. */
function iterationsOf(number, method) {
  const place = DATA.methods.findIndex(({ name }) => name === method);
  const first = (number * DATA.methods.length + place) * verse.trials;
  return Array.from(allIterations.subarray(first, first + verse.trials));
}

const limited = (counts) => counts.map((count) => Math.min(count, verse.cap));
const savedBy = (x, y) => limited(x).map((count, trial) => limited(y)[trial] - count);

/** The effect of the claim under a specification: the mean of what is saved, its interval, and where that lies. */
function effectOf(number) {
  const [x, y] = [claim().x, claim().y].map((method) => iterationsOf(number, method));
  const [mean, half] = meanOf(savedBy(x, y));
  const outcome = mean - half > 0 ? "holds" : mean + half < 0 ? "reversed" : "open";
  return { mean, half, outcome, capped: [...x, ...y].some((count) => count > verse.cap) };
}

const claim = () => verse.claims[Number($("claim").value)];
const share = (part, outcome) => {
  const count = part.filter((row) => row.outcome === outcome).length;
  return `${count} (${Math.round((100 * count) / part.length)} %)`;
};

/** Evaluate the claim under every specification that is not left out. */
function evaluate() {
  effects = verse.specifications.map((digits, number) => ({ number, digits }))
    .filter(({ digits }) => leaving.every((out, choice) => !out.has(digits[choice])))
    .map((one) => ({ ...one, ...effectOf(one.number) }))
    .sort((a, b) => a.mean - b.mean);
  const n = effects.length;
  $("counts").textContent = n
    ? `Of ${n} specifications, the claim holds in ${share(effects, "holds")}, is open in ${share(effects, "open")} and reversed `
      + `in ${share(effects, "reversed")}. Median effect: ${signed((effects[(n - 1) >> 1].mean + effects[n >> 1].mean) / 2)} iterations saved.`
    : "No specification is left.";
  for (const { choice, digit, cells } of options) {
    const part = effects.filter(({ digits }) => digits[choice] === digit);
    const mean = () => part.reduce((sum, row) => sum + row.mean, 0) / part.length;
    const words = part.length ? [part.length, share(part, "holds"), share(part, "reversed"), signed(mean())] : [0, "", "", ""];
    cells.forEach((cell, k) => (cell.textContent = words[k]));
  }
  $("rank").max = String(Math.max(n, 1));
  showSpecification();
}

function showSpecification() {
  const rank = effects.findIndex(({ number }) => number === selected?.number);
  if (rank >= 0) $("rank").value = String(rank + 1);
  $("ranked").textContent = rank < 0 ? "none selected" : `${rank + 1} of ${effects.length}`;
  drawEffects($("effects"), effects, rank);
  $("specification").hidden = !selected;
  if (!selected) return;
  $("values").textContent = "";
  verse.choices.forEach(({ title, labels }, k) => add(add($("values"), "li", {}, `${title}: `), "b", {}, labels[selected.digits[k]]));
  const table = document.createElement("table");
  const addRow = (...cells) => {
    const row = add(table, "tr");
    cells.forEach((text, k) => add(row, k && table.rows.length > 1 ? "td" : "th", {}, text));
  };
  addRow("Iterations", "Published", "Here");
  for (const { name, label } of DATA.methods) {
    const all = iterationsOf(selected.number, name), found = selected.found[name];
    const ended = found.filter((count) => count !== null).length;
    const wrong = all.findIndex((count, trial) => ![null, count].includes(found[trial]));
    addRow(label, meanOf(limited(all))[0].toFixed(2), wrong < 0
      ? `${ended} of ${all.length} trials${ended ? ", each as published" : ""}`
      : `✗ trial ${wrong}: ${found[wrong]}, but ${all[wrong]} is published`);
  }
  const { mean, half } = effectOf(selected.number);
  const [x, y] = [claim().x, claim().y].map((method) => selected.found[method]);
  addRow("Saved [95 % interval]", interval([mean, half]), [...x, ...y].includes(null) ? "" : interval(meanOf(savedBy(x, y))));
  $("beside").replaceChildren(table);
}

/** The values of a specification, by the ids of its choices. */
const valuesOf = (digits) => Object.fromEntries(verse.choices.map(({ id, values }, k) => [id, values[digits[k]]]));
const drawingOf = (values) => verse.drawings[`${values.MAP} ${values["DEMO-SHAPE"]}`];
const paramsOf = (values) => ({
  max_iterations: verse.cap,
  ...Object.fromEntries(verse.choices.filter(({ field }) => field).map(({ id, field }) => [field, values[id]])),
});
const shows = (values, kind) => values["INCORRECT-KINDS"] === "all" || values["INCORRECT-KINDS"].split("+").includes(kind);

function select(rank) {
  const found = Object.fromEntries(DATA.methods.map(({ name }) => [name, new Array(verse.trials).fill(null)]));
  selected = { ...effects[rank], found };
  showSpecification();
}

/** Run the trials of the specification that is selected; those of another one are given up. */
function runSpecification() {
  universes ??= new Trials(cores);
  universes.stop();
  const values = valuesOf(selected.digits), { world, correct, incorrect } = check(unpackAll(drawingOf(values)));
  const task = { world, correct, incorrect: incorrect.filter(({ kind }) => shows(values, kind)) };
  const { found } = selected;
  for (let trial = 0; trial < verse.trials; trial++)
    for (const { name } of DATA.methods)
      universes.run({ task, method: name, params: { ...DATA.params, ...paramsOf(values) }, root: verse.seed, trial }).then((done) => {
        found[name][trial] = done.converged ? done.iterations : verse.cap + 1;
        showSpecification();
      });
}

verse.claims.forEach(({ title }, k) => add($("claim"), "option", { value: String(k) }, title));
$("claim").onchange = evaluate;

const options = verse.choices.flatMap(({ title, labels, usual }, choice) => {
  add(add($("option-rows"), "tr"), "th", { colspan: "5", scope: "rowgroup" }, title);
  return labels.map((label, place) => {
    const row = add($("option-rows"), "tr"), digit = String(place);
    const outer = add(add(row, "td"), "label"), box = add(outer, "input", { type: "checkbox" });
    outer.append(` ${label}${place === usual ? " (default)" : ""}`);
    box.checked = true;
    box.onchange = () => {
      if (box.checked) leaving[choice].delete(digit);
      else leaving[choice].add(digit);
      evaluate();
    };
    return { choice, digit, box, cells: [0, 1, 2, 3].map(() => add(row, "td")) };
  });
});
$("take-all").onclick = () => {
  leaving.forEach((out) => out.clear());
  for (const { box } of options) box.checked = true;
  evaluate();
};

$("rank").oninput = () => {
  if (effects.length) select(Number($("rank").value) - 1);
};
$("rank").onchange = () => {
  if (effects.length) runSpecification();
};
$("effects").onclick = ({ offsetX }) => {
  const rank = effectAt($("effects"), effects.length, offsetX);
  if (rank === null) return;
  select(rank);
  runSpecification();
};
$("watch").onclick = () => {
  const values = valuesOf(selected.digits), drawn = unpackAll(drawingOf(values));
  choose({ ...paramsOf(values), seed: verse.seed });
  redraw(drawn);
  left = new Set(drawn.incorrect.map(({ kind }) => kind).filter((kind) => !shows(values, kind)));
  listKinds();
  restart();
  $("story").scrollIntoView();
};

$("multiverse").hidden = !verse.specifications.length;
if (verse.specifications.length) evaluate();
