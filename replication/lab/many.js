// Many trials of each method: a histogram, means with their intervals, the paired difference.
"use strict";

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
  const addRow = (...cells) => {
    const row = add(body, "tr");
    cells.forEach((text, k) => add(row, k ? "td" : "th", k ? {} : { scope: "row" }, text));
  };
  for (const { label, values, trials } of groups)
    addRow(label, String(values.length), values.length > 1 ? interval(meanOf(values)) : "", String(trials.filter((done) => !done.converged).length));
  const [, without, given] = groups;
  const saved = Array.from({ length: n }, (_, k) => k).filter((k) => without.trials[k] && given.trials[k])
    .map((k) => without.trials[k].iterations - given.trials[k].iterations);
  if (saved.length > 1) addRow("Saved by incorrect ones, paired", String(saved.length), interval(meanOf(saved)), "");
  $("summary").replaceChildren(table);
}
