// What the page draws on its canvases.
"use strict";

const SEEK = [0, 158, 115], AVOID = [204, 121, 167], TRACE = [0, 114, 178];
const MARKED = "#d55e00";
const OUTCOMES = { holds: "#0072b2", open: "#808080", reversed: "#d55e00" };

/** A canvas's context, scaled to its size in CSS pixels, cleared; and its colour of text. */
function paper(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  const style = getComputedStyle(canvas);
  context.font = `13px ${style.fontFamily}`;
  return { context, width, height, ink: style.color };
}

/** A map on a canvas as high as it needs; returns the sizes by which others draw on it. */
function drawMap(canvas, rows) {
  canvas.style.aspectRatio = `${rows[0].length} / ${rows.length}`;
  const { context, width, height, ink } = paper(canvas);
  const size = width / rows[0].length;
  context.strokeStyle = ink;
  context.globalAlpha = 0.12;
  context.lineWidth = 1;
  for (let c = 0; c <= rows[0].length; c++) line(context, [[c * size, 0], [c * size, height]]);
  for (let r = 0; r <= rows.length; r++) line(context, [[0, r * size], [width, r * size]]);
  context.fillStyle = ink;
  context.globalAlpha = 0.45;
  rows.forEach((row, r) => [...row].forEach((character, c) => {
    if (character === "#") context.fillRect(c * size, r * size, size, size);
  }));
  context.globalAlpha = 0.5;
  context.strokeRect(0.5, 0.5, width - 1, height - 1);
  context.globalAlpha = 1;
  return { context, size, ink, center: ([row, column]) => [(column + 0.5) * size, (row + 0.5) * size] };
}

function drawEnds({ context, size, ink, center }, rows) {
  context.fillStyle = ink;
  context.font = `bold ${Math.max(9, size * 0.75)}px system-ui, sans-serif`;
  context.textAlign = "center";
  context.textBaseline = "middle";
  rows.forEach((row, r) => [...row].forEach((character, c) => {
    if ("SG".includes(character)) context.fillText(character, ...center([r, c]));
  }));
}

function line(context, points) {
  context.beginPath();
  points.forEach(([x, y]) => context.lineTo(x, y));
  context.stroke();
}

function drawWay(sheet, world, states, { color, width, alpha = 1, dash = [] }) {
  const { context, size, center } = sheet;
  Object.assign(context, { strokeStyle: color, lineWidth: width * size, globalAlpha: alpha, lineJoin: "round", lineCap: "round" });
  context.setLineDash(dash.map((part) => part * size));
  line(context, states.map((state) => center(cell(world, state))));
  context.setLineDash([]);
  context.globalAlpha = 1;
}

/** What a method has learned: a triangle for each pair, the expert's path, the agent's. */
function drawLearned(canvas, task, now, shown, method) {
  const { world, correct, incorrect } = task;
  const sheet = drawMap(canvas, world.rows);
  const { context, size, ink, center } = sheet;
  const table = now[shown];
  let most = shown === "memory" && method !== "adaboost" ? 1 : 0;
  for (const value of table) most = Math.max(most, Math.abs(value));
  for (let i = 0; most && i < table.length; i++) {
    const share = Math.abs(table[i]) / most;
    if (share < 0.01 || world.rows.join("")[i >> 2] === "#") continue;
    const [x, y] = center(cell(world, i >> 2)), [down, right] = MOVES[i % 4];
    const color = shown === "memory" ? TRACE : table[i] > 0 ? SEEK : AVOID;
    context.fillStyle = `rgb(${color.join(" ")} / ${0.15 + 0.85 * share})`;
    context.beginPath();
    context.moveTo(x, y);
    const half = size / 2;
    context.lineTo(x + half * (right - down), y + half * (down - right));
    context.lineTo(x + half * (right + down), y + half * (down + right));
    context.fill();
  }
  drawWay(sheet, world, correct.states, { color: ink, width: 0.45, alpha: 0.2 });
  if (METHOD_MARKS[method])
    for (const { states } of incorrect) drawWay(sheet, world, states, { color: MARKED, width: 0.12, alpha: 0.6, dash: [0.2, 0.3] });
  drawWay(sheet, world, now.episode.states.slice(0, 400), { color: ink, width: 0.14 });
  context.fillStyle = ink;
  context.beginPath();
  context.arc(...center(cell(world, now.episode.states.at(-1))), size * 0.3, 0, 7);
  context.fill();
  drawEnds(sheet, world.rows);
}

/** The error d of each method by iteration; what is still to come is pale. */
function drawCurves(canvas, runs, at) {
  const { context, width, height, ink } = paper(canvas);
  const last = Math.max(10, ...runs.map((run) => run.frames.length - 1));
  const most = Math.max(1e-9, ...runs.flatMap((run) => run.frames.map((now) => now.error)));
  const [left, right, top, bottom] = [34, width - 8, 18, height - 30];
  const x = (i) => left + ((right - left) * i) / last, y = (d) => bottom - ((bottom - top) * d) / most;
  axes(context, ink, { left, right, top, bottom, last, x });
  context.textAlign = "right";
  context.fillText("0", left - 5, y(0) + 4);
  context.fillText(most.toFixed(most < 10 ? 1 : 0), left - 5, y(most) + 4);
  context.textAlign = "left";
  context.fillText("error d", left, 11);
  context.textAlign = "right";
  context.fillText("iteration", right, 11);
  context.strokeStyle = ink;
  context.globalAlpha = 0.4;
  context.lineWidth = 1;
  line(context, [[x(at), top], [x(at), bottom]]);
  for (const run of runs) {
    Object.assign(context, { strokeStyle: run.colour, fillStyle: run.colour, lineWidth: 2 });
    for (const [alpha, frames] of [[0.3, run.frames], [1, run.frames.slice(0, at + 1)]]) {
      context.globalAlpha = alpha;
      line(context, frames.map((now, i) => [x(i), y(now.error)]));
    }
    const now = run.frames[Math.min(at, run.frames.length - 1)];
    if (!now) continue;
    context.beginPath();
    context.arc(x(now.i), y(now.error), 4, 0, 7);
    context.fill();
  }
  context.globalAlpha = 1;
}

function axes(context, ink, { left, right, bottom, last, x }) {
  Object.assign(context, { strokeStyle: ink, fillStyle: ink, lineWidth: 1, globalAlpha: 0.5 });
  line(context, [[left, bottom], [right, bottom]]);
  context.globalAlpha = 1;
  context.textAlign = "center";
  const step = stepFor(last, 8);
  for (let i = 0; i <= last; i += step) context.fillText(String(i), x(i), bottom + 16);
}

/** A round step that parts a range into at most so many. */
const stepFor = (range, most) => [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000].find((size) => range / size <= most) ?? 5000;

/** A row of dots for each method: the iterations of its trials, equal ones above each other. */
function drawHistogram(canvas, groups) {
  const { context, width, height, ink } = paper(canvas);
  const last = Math.max(10, ...groups.flatMap((group) => group.values)) + 1;
  const [left, right, bottom] = [8, width - 8, height - 26];
  const x = (i) => left + ((right - left) * i) / last;
  axes(context, ink, { left, right, bottom, last, x });
  const room = (bottom - 4) / groups.length;
  groups.forEach(({ values, label, colour }, row) => {
    const base = room * (row + 1), counts = new Map();
    for (const value of values) counts.set(value, (counts.get(value) ?? 0) + 1);
    const radius = Math.min(4, (right - left) / last / 2, (room - 18) / 2 / Math.max(1, ...counts.values()));
    context.fillStyle = ink;
    context.textAlign = "left";
    context.fillText(label, left, base - room + 14);
    context.fillStyle = colour;
    for (const [value, count] of counts)
      for (let k = 0; k < count; k++) {
        context.beginPath();
        context.arc(x(value), base - radius * (2 * k + 1), radius, 0, 7);
        context.fill();
      }
  });
}

const EFFECTS = { left: 44, right: 8, top: 18, bottom: 8 };

/** The rank of the effect that is drawn at a place of the canvas, if one is. */
function effectAt(canvas, n, place) {
  const rank = Math.round(((place - EFFECTS.left) / (canvas.clientWidth - EFFECTS.left - EFFECTS.right)) * n - 0.5);
  return rank >= 0 && rank < n ? rank : null;
}

/** Effects in their order, with their intervals; a line marks the one that is selected. */
function drawEffects(canvas, effects, selected) {
  const { context, width, height, ink } = paper(canvas);
  const [left, right, top, bottom] = [EFFECTS.left, width - EFFECTS.right, EFFECTS.top, height - EFFECTS.bottom];
  const least = Math.min(0, ...effects.map(({ mean, half }) => mean - half));
  const most = Math.max(1, ...effects.map(({ mean, half }) => mean + half));
  const x = (rank) => left + ((right - left) * (rank + 0.5)) / effects.length;
  const y = (value) => bottom - ((bottom - top) * (value - least)) / (most - least);
  Object.assign(context, { fillStyle: ink, strokeStyle: ink, lineWidth: 1, textAlign: "left" });
  context.fillText("iterations saved", left, 11);
  context.textAlign = "right";
  const step = stepFor(most - least, 6);
  for (let value = Math.ceil(least / step) * step; value <= most; value += step) {
    context.globalAlpha = 1;
    context.fillText(signed(value).replace(".00", ""), left - 6, y(value) + 4);
    context.globalAlpha = value ? 0.12 : 0.6;
    line(context, [[left, y(value)], [right, y(value)]]);
  }
  if (selected >= 0) {
    context.globalAlpha = 0.25;
    context.fillRect(x(selected) - 2.5, top, 5, bottom - top);
  }
  effects.forEach(({ mean, half, outcome, capped }, rank) => {
    Object.assign(context, { strokeStyle: OUTCOMES[outcome], fillStyle: OUTCOMES[outcome], globalAlpha: 0.4 });
    line(context, [[x(rank), y(mean - half)], [x(rank), y(mean + half)]]);
    context.globalAlpha = 1;
    context.beginPath();
    context.arc(x(rank), y(mean), 2.5, 0, 7);
    if (capped) context.stroke();
    else context.fill();
  });
}
