// Published trials, computed again.
"use strict";

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
