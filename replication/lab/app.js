// What all of the page shares: its data, what is drawn, and what is chosen.
"use strict";

const $ = (id) => document.getElementById(id);
const bytes = (text) => Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
const unpacked = new Blob([bytes($("lab-data").textContent)]).stream().pipeThrough(new DecompressionStream("deflate"));
const DATA = await new Response(unpacked).json();
const METHOD_MARKS = Object.fromEntries(DATA.methods.map(({ name, marks }) => [name, marks]));

function add(parent, tag, attributes = {}, text = "") {
  const node = parent.appendChild(document.createElement(tag));
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.textContent = text;
  return node;
}

const unpack = (demo) => ({ ...demo, actions: Array.from(demo.actions, Number) });
const unpackAll = ({ correct, incorrect, ...rest }) => ({ ...rest, correct: correct.map(unpack), incorrect: incorrect.map(unpack) });
const MAZES = DATA.mazes.map(unpackAll);
const copy = (value) => structuredClone(value);

let drawing = copy(MAZES[0]);
let task = check(drawing);
let chosen = {};
let left = new Set(DATA.leftOut); // the kinds of incorrect demonstrations that are not used

const params = () => ({ ...DATA.params, ...chosen });
const used = () => ({ ...task, incorrect: task.incorrect.filter(({ kind }) => !left.has(kind)) });
const job = (method, root, trial, more = {}) => {
  const { world, correct, incorrect } = used();
  return { task: { world, correct, incorrect }, method, params: params(), root, trial, ...more };
};
