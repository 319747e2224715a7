// The learner: replication/learning/reference.py in JavaScript, and the same as WebAssembly.
//
// A world has `states`, `start`, `goal` and `moves`, where moves[4 * state + action] is the state
// that an action leads to. Tables of values and rewards are Float64Array, in the same order.
"use strict";

/** Learn Q by Q-learning (Eq. 1), in place. Returns the numbers of steps and of collisions. */
function learnPlainly(world, weights, q, words, params) {
  const { moves, start, goal } = world;
  const { beta, gamma, episodes, horizon } = params;
  const explored = threshold(params);
  let steps = 0, collisions = 0;
  for (let episode = 0; episode < episodes; episode++) {
    let state = start;
    for (let left = horizon; left; left--) {
      const { high, low } = draw(words);
      const action = high < explored
        ? low >>> 30
        : greedy(q, 4 * state, low, params.tie_tolerance, params.ties === "random");
      const at = 4 * state + action;
      const next = moves[at];
      const value = next === goal ? 0 : largest(q, 4 * next);
      q[at] += beta * (weights[at] + gamma * value - q[at]);
      steps++;
      if (next === state) collisions++;
      state = next;
      if (state === goal) break;
    }
  }
  return [steps, collisions];
}

/** Compile learner.wat; returns a function with the arguments and results of the one above. */
function compileLearner(bytes) {
  const { memory, learn } = new WebAssembly.Instance(new WebAssembly.Module(bytes)).exports;
  const place = (state) => 32 + 104 * state; // of its record, see learner.wat
  return (world, weights, q, words, params) => {
    const { states, start, goal, moves } = world;
    if (place(states) > memory.buffer.byteLength) return learnPlainly(world, weights, q, words, params);
    const own = new Uint32Array(memory.buffer, 0, 8), view = new DataView(memory.buffer);
    own.set(words);
    for (let state = 0; state < states; state++)
      for (let a = 0; a < 4; a++) {
        const i = 4 * state + a;
        view.setFloat64(place(state) + 8 * a, q[i], true);
        view.setFloat64(place(state) + 32 + 8 * a, weights[i], true);
        view.setInt32(place(state) + 64 + 4 * a, place(moves[i]), true);
      }
    const counts = learn(
      states, place(start), place(goal), params.episodes, params.horizon, params.beta, params.gamma,
      threshold(params), params.tie_tolerance, params.ties === "random",
    );
    words.set(own);
    for (let i = 0; i < q.length; i++) q[i] = view.getFloat64(place(i >> 2) + 8 * (i % 4), true);
    return counts;
  };
}

/** Follow the greedy policy of Q until the goal, for `horizon` steps at most. */
function rollOut(world, q, words, params) {
  const states = [world.start], actions = [];
  while (actions.length < params.horizon) {
    const { low } = draw(words);
    const state = states.at(-1);
    actions.push(greedy(q, 4 * state, low, params.tie_tolerance, params.rollout_ties === "random"));
    states.push(world.moves[4 * state + actions.at(-1)]);
    if (states.at(-1) === world.goal) break;
  }
  return { states, actions };
}

/** The draws below this explore: the high half of each is compared with it. */
function threshold(params) {
  const exact = params.epsilon * WORD, below = Math.floor(exact);
  const up = exact - below > 0.5 || (exact - below === 0.5 && below % 2 === 1); // as Python rounds
  return below + up;
}

function largest(q, row) {
  return Math.max(q[row], q[row + 1], q[row + 2], q[row + 3]);
}

/** The action among the best that the low half of a draw takes. */
function greedy(q, row, low, tolerance, randomTies) {
  const best = largest(q, row);
  const least = best - tolerance * Math.abs(best);
  const candidates = [];
  for (let a = 0; a < 4; a++) if (q[row + a] >= least) candidates.push(a);
  return candidates[randomTies ? Math.floor((low * candidates.length) / WORD) : 0];
}
