// Mazes and demonstrations: what Maze, Demos and the demonstration file are in Python.
//
// A drawing is what a file holds: { task, description, rows, correct, incorrect }, where a
// demonstration is { name, kind, actions }, its actions numbers. `check` makes a task of it.
"use strict";

const ACTIONS = ["up", "down", "right", "left"];
const MOVES = [[-1, 0], [1, 0], [0, 1], [0, -1]];
const MOST = { side: 40, bytes: 1_000_000, demos: 200, moves: 2000 };

/** What is wrong with a drawing or a file, in one line. */
class Refusal extends Error {}

const place = (row, column) => `map line ${row + 1}, column ${column + 1}`;
const clip = (text, length = 60) => (text.length <= length ? text : `${text.slice(0, length - 3)}...`);
const quoted = (text) => clip(`'${String(text).replace(/[\u0000-\u001f\u007f]/g, "\ufffd")}'`);

/** The world of a map; refuses what is not a maze. */
function makeWorld(rows) {
  if (!rows.length || !rows[0].length) throw new Refusal("the map is empty; draw at least a start 'S' and a goal 'G'");
  const [height, width] = [rows.length, rows[0].length];
  if (Math.max(height, ...rows.map((row) => row.length)) > MOST.side)
    throw new Refusal(`the map has ${height} lines of up to ${Math.max(...rows.map((row) => row.length))} characters; `
      + `here a side has at most ${MOST.side}`);
  const found = { S: [], G: [] };
  rows.forEach((row, r) => {
    if (row.length !== width)
      throw new Refusal(`map line ${r + 1} has ${row.length} characters, but line 1 has ${width}; make all lines equally long`);
    [...row].forEach((character, c) => {
      if (!".#SG".includes(character))
        throw new Refusal(`unknown character ${quoted(character)} at ${place(r, c)}; use '.' free, '#' obstacle, 'S' start, 'G' goal`);
      found[character]?.push([r, c]);
    });
  });
  for (const [character, name] of [["S", "start"], ["G", "goal"]]) {
    const places = found[character];
    if (!places.length) throw new Refusal(`the map has no ${name}; mark one cell with '${character}'`);
    if (places.length > 1)
      throw new Refusal(`the map has ${places.length} ${name}s '${character}', at ${place(...places[0])} and at `
        + `${place(...places[1])}; keep one`);
  }
  const cells = rows.join("");
  const states = cells.length;
  const moves = new Int32Array(4 * states);
  for (let state = 0; state < states; state++) {
    const [row, column] = [Math.floor(state / width), state % width];
    MOVES.forEach(([down, right], action) => {
      const r = Math.min(Math.max(row + down, 0), height - 1), c = Math.min(Math.max(column + right, 0), width - 1);
      const free = cells[state] !== "#" && cells[r * width + c] !== "#";
      moves[4 * state + action] = free ? r * width + c : state;
    });
  }
  const world = { rows, height, width, states, moves, start: cells.indexOf("S"), goal: cells.indexOf("G") };
  const reached = new Set([world.goal]);
  for (const state of reached) for (let a = 0; a < 4; a++) reached.add(moves[4 * state + a]);
  if (!reached.has(world.start))
    throw new Refusal(`the goal at ${place(...cell(world, world.goal))} cannot be reached from the start at `
      + `${place(...cell(world, world.start))}; open a way through the obstacles`);
  return world;
}

const cell = (world, state) => [Math.floor(state / world.width), state % world.width];
const compactCell = (world, state) => JSON.stringify(cell(world, state));

/** The states that actions visit from the start on. */
function replay(world, actions) {
  const states = [world.start];
  for (const action of actions) states.push(world.moves[4 * states.at(-1) + action]);
  return states;
}

/** Check a drawing: returns its world, its trajectories, and why some may have no effect. */
function check(drawing) {
  const world = makeWorld(drawing.rows);
  const names = new Set();
  const drive = (demo) => {
    if (names.has(demo.name)) throw new Refusal(`two demos are named ${quoted(demo.name)}; give each its own name`);
    names.add(demo.name);
    if (!demo.actions.length) throw new Refusal(`demo ${quoted(demo.name)} is empty; give it at least one action`);
    const states = replay(world, demo.actions);
    const end = states.indexOf(world.goal);
    if (end >= 0 && end < demo.actions.length)
      throw new Refusal(`demo ${quoted(demo.name)} goes on after reaching the goal at step ${end}; drop the steps that follow`);
    return { ...demo, states };
  };
  if (!drawing.correct.length) throw new Refusal("there is no correct demo; give at least one from the start to the goal");
  const correct = drawing.correct.map(drive), incorrect = drawing.incorrect.map(drive);
  for (const { name, states } of correct)
    if (states.at(-1) !== world.goal)
      throw new Refusal(`demo ${quoted(name)} is correct, but ends at ${compactCell(world, states.at(-1))} and misses the goal `
        + `${compactCell(world, world.goal)}; add the missing steps or move it to 'incorrect'`);
  const pairs = (demo) => demo.actions.map((action, t) => 4 * demo.states[t] + action);
  const right = new Set(correct.flatMap(pairs));
  const idle = incorrect.filter((demo) => pairs(demo).every((pair) => right.has(pair)));
  const warnings = [];
  if (idle.length) {
    const [which, verb, whose] = idle.length > 1
      ? [`${idle.length} incorrect demos (${quoted(idle[0].name)}, ...)`, "have", "their"]
      : [`incorrect demo ${quoted(idle[0].name)}`, "has", "its"];
    warnings.push(`${which} ${verb} no effect: all ${whose} pairs of state and action occur in a correct demo, too`);
  }
  const shown = new Map();
  for (const { actions, states } of correct)
    actions.forEach((action, t) => shown.set(states[t], (shown.get(states[t]) ?? new Set()).add(action)));
  const conflicts = [...shown.keys()].filter((state) => shown.get(state).size > 1).sort((a, b) => a - b);
  if (conflicts.length) {
    const taken = [...shown.get(conflicts[0])].sort().map((action) => `'${ACTIONS[action]}'`).join(" and ");
    warnings.unshift(`the correct demos take ${taken} in ${compactCell(world, conflicts[0])} (one of ${conflicts.length} `
      + "such states): d = 0 cannot be reached");
  }
  return { task: drawing.task, world, correct: correct[0], incorrect, warnings };
}

/** The text of a demonstration file, as save_demos writes it. */
function write(drawing) {
  const world = makeWorld(drawing.rows);
  const list = (values) => `[${values.map((value) => JSON.stringify(value)).join(", ")}]`;
  const demos = (some, fields) => some.length
    ? `[\n${some.map((demo) => {
      const states = replay(world, demo.actions).map((state) => cell(world, state));
      const lines = fields.map((name) => `"${name}": ${JSON.stringify(demo[name])}`);
      lines.push(`"actions": ${list(demo.actions.map((action) => ACTIONS[action]))}`, `"states": ${list(states)}`);
      return `    {\n${lines.map((line) => `      ${line}`).join(",\n")}\n    }`;
    }).join(",\n")}\n  ]`
    : "[]";
  return `{
  "format": "replication-demos",
  "version": 1,
  "task": ${JSON.stringify(drawing.task)},
  "description": ${JSON.stringify(drawing.description)},
  "environment": {
    "kind": "maze",
    "map": [
${drawing.rows.map((row) => `      ${JSON.stringify(row)}`).join(",\n")}
    ],
    "actions": ${list(ACTIONS)},
    "start": ${list(cell(world, world.start))},
    "goal": ${list(cell(world, world.goal))}
  },
  "correct": ${demos(drawing.correct, ["name"])},
  "incorrect": ${demos(drawing.incorrect, ["name", "kind"])}
}
`;
}

/** Read a demonstration file; refuses all that is not the drawing of a maze. */
function read(text) {
  if (text.length > MOST.bytes) throw new Refusal(`is larger than ${MOST.bytes / 1e6} MB; drop some demos`);
  let data;
  try {
    data = JSON.parse(text);
  } catch {
    throw new Refusal("is not JSON; a demonstration file is one JSON object");
  }
  const isObject = (value) => typeof value === "object" && value !== null && !Array.isArray(value);
  const fields = (value, where, needed, known) => {
    if (!isObject(value)) throw new Refusal(`${where || "the file"}: an object is needed here`);
    const named = where ? `${where}: ` : "";
    for (const field of needed) if (!(field in value)) throw new Refusal(`${named}the field '${field}' is missing; add it`);
    for (const field of Object.keys(value))
      if (!known.includes(field)) throw new Refusal(`${named}unknown field ${quoted(field)}; known: ${known.join(", ")}`);
  };
  const texts = (value, where, most) => {
    if (!Array.isArray(value) || value.length > most || !value.every((item) => typeof item === "string"))
      throw new Refusal(`${where}: a list of at most ${most} texts is needed here`);
    return value;
  };
  const word = (value, where, pattern, fix, most = 100) => {
    if (typeof value !== "string" || value.length > most || !pattern.test(value)) throw new Refusal(`${where}: ${quoted(value)} does not fit: ${fix}`);
    return value;
  };
  const known = ["format", "version", "task", "description", "environment", "correct", "incorrect"];
  if (!isObject(data)) throw new Refusal("a demonstration file is one JSON object");
  for (const [field, expected] of [["format", "replication-demos"], ["version", 1]])
    if (data[field] !== expected) throw new Refusal(`'${field}' must be ${JSON.stringify(expected)}`);
  fields(data, "", known.filter((name) => !["description", "incorrect"].includes(name)), known);
  const drawing = {
    task: word(data.task, "task", /^[A-Za-z0-9][A-Za-z0-9_-]*$/, "use letters, digits, '-' and '_', a letter or digit first"),
    description: word("description" in data ? data.description : "", "description", /^[^]*$/, "use a text", 10_000),
  };
  const environment = data.environment;
  if (isObject(environment) && environment.kind !== "maze")
    throw new Refusal(`environment.kind: the lab takes mazes only, not ${quoted(environment.kind)}`);
  fields(environment, "environment", ["kind", "map"], ["kind", "map", "actions", "start", "goal"]);
  drawing.rows = texts(environment.map, "environment.map", 1000);
  const world = makeWorld(drawing.rows);
  const derived = { actions: ACTIONS, start: cell(world, world.start), goal: cell(world, world.goal) };
  for (const [field, value] of Object.entries(derived))
    if (field in environment && JSON.stringify(environment[field]) !== JSON.stringify(value))
      throw new Refusal(`environment.${field}: the map has ${JSON.stringify(value)}; write this or leave it out`);
  for (const part of ["correct", "incorrect"]) {
    const demos = part in data ? data[part] : [];
    if (!Array.isArray(demos) || demos.length > MOST.demos)
      throw new Refusal(`${part}: a list of at most ${MOST.demos} demos is needed here`);
    const own = part === "correct" ? ["name", "actions"] : ["name", "kind", "actions"];
    drawing[part] = demos.map((demo, at) => {
      const where = `${part}[${at}]`;
      fields(demo, where, own, [...own, "states"]);
      const name = word(demo.name, `${where}.name`, /^[^\u0000-\u001f\u007f]+$/, "write it on one line, without control characters");
      const kind = part === "correct" ? part : kindOf(demo.kind, `${where}.kind`);
      const actions = texts(demo.actions, `${where}.actions`, MOST.moves).map((action, t) => {
        if (!ACTIONS.includes(action))
          throw new Refusal(`step ${t + 1} of demo ${quoted(name)}: unknown action ${quoted(action)}; known: ${ACTIONS.join(", ")}`);
        return ACTIONS.indexOf(action);
      });
      if ("states" in demo) agree(world, name, actions, demo.states);
      return { name, kind, actions };
    });
  }
  if (drawing.correct.length > 1)
    throw new Refusal(`the lab takes one correct demo, and the file has ${drawing.correct.length}; keep one`);
  check(drawing);
  return drawing;
}

/** A kind of mistake; refuses what a file may not hold. */
function kindOf(kind, where = "kind") {
  if (typeof kind !== "string" || kind.length > 100 || !/^[a-z][a-z0-9-]*$/.test(kind) || ["correct", "all", "none"].includes(kind))
    throw new Refusal(`${where}: ${quoted(kind)} does not fit: use small letters, digits and '-', a letter first, but none of correct, all, none`);
  return kind;
}

function agree(world, name, actions, claims) {
  const cells = replay(world, actions).map((state) => compactCell(world, state));
  const given = Array.isArray(claims) ? claims.map((claim) => clip(JSON.stringify(claim) ?? "")) : [];
  const step = cells.findIndex((right, t) => t < given.length && given[t] !== right);
  if (step === 0) throw new Refusal(`demo ${quoted(name)} starts at ${given[0]}, but the start is ${cells[0]}; write ${cells[0]}`);
  if (step > 0)
    throw new Refusal(`step ${step} of demo ${quoted(name)}: '${ACTIONS[actions[step - 1]]}' from ${cells[step - 1]} `
      + `${cells[step] === cells[step - 1] ? "hits a wall and stays" : `leads to ${cells[step]}`}, but the file claims `
      + `${given[step]}; write ${cells[step]} or change the action`);
  if (given.length !== cells.length)
    throw new Refusal(`demo ${quoted(name)} has ${actions.length} actions and ${given.length} states; give ${cells.length} `
      + "states, the last one reached included, or leave out 'states'");
}
