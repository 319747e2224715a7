// Algorithms 1 and 2 and AdaBoost-IRL: replication/irl in JavaScript, the same bits.
"use strict";

/** Discounted visits of a trajectory (Eq. 7): [state, action]. */
function expectations(world, { states, actions }, gamma) {
  const mu = new Float64Array(4 * world.states);
  let factor = 1;
  actions.forEach((action, t) => {
    mu[4 * states[t] + action] += factor;
    factor *= gamma;
  });
  return mu;
}

/** Where mu_B (Eq. 11) is not zero. */
function visited(world, demos) {
  const seen = new Uint8Array(4 * world.states);
  for (const { states, actions } of demos) actions.forEach((action, t) => (seen[4 * states[t] + action] = 1));
  return seen;
}

/** The unified method: Eqs. 8-10 and, where mu_B is not zero, lines 11 and 12 of Algorithm 2. */
const unified = {
  start: (size, params) => new Float64Array(size).fill(params.f_start),
  update(w, f, muE, muI, seen, params) {
    const next = [new Float64Array(w.length), new Float64Array(w.length)];
    for (let i = 0; i < w.length; i++) {
      const residual = muE[i] - muI[i];
      const wrong = muE[i] === 0 && muI[i] > 0 && seen[i];
      next[1][i] = wrong ? 1 : f[i] + params.alpha * ((residual !== 0 ? 1 : 0) - f[i]);
      const used = { printed: f[i], updated: next[1][i], "at-once": wrong ? 1 : f[i] }[params.f_index];
      next[0][i] = w[i] + used * residual;
    }
    return next;
  },
};

/** AdaBoost-IRL, our reconstruction; its readings are told in replication/irl/adaboost.py. */
const adaboost = {
  start: (size) => new Float64Array(size).fill(1 / size),
  update(w, d, muE, muI, _, { adaboost_rule: rule, adaboost_margin: margin }) {
    const residual = w.map((_, i) => muE[i] - muI[i]);
    const size = residual.map(Math.abs);
    const most = Math.max(size.reduce((a, b) => Math.max(a, b)), 2.2250738585072014e-308);
    const relative = size.map((x) => x / most);
    if (rule === "log-odds") {
      const odds = relative.map((x) => Math.atanh(Math.min(x, 1 - margin)));
      return [w.map((x, i) => x + Math.sign(residual[i]) * odds[i]), d];
    }
    const loss = rule === "graded" ? relative : residual.map((x) => (x !== 0 ? 1 : 0));
    const error = Math.min(Math.max(pairwiseSum(d.map((x, i) => x * loss[i])), 1e-6), 0.5 - margin);
    const odds = (1 - error) / error;
    const confidence = 0.5 * Math.log(odds);
    const factor = rule === "graded"
      ? (l) => Math.exp(confidence * (2 * l - 1))
      : (l) => (l === 1 ? Math.sqrt(odds) : Math.sqrt(1 / odds));
    let next = d.map((x, i) => x * factor(loss[i]));
    const sum = pairwiseSum(next);
    next = next.map((x) => x / sum);
    const largest = next.reduce((a, b) => Math.max(a, b));
    const moved = w.map((x, i) => {
      if (rule === "vote") return x + confidence * next[i] * Math.sign(residual[i]);
      if (rule === "confidence") return x + confidence * residual[i];
      return x + (next[i] / largest) * residual[i];
    });
    return [moved, next];
  },
};

const METHODS = {
  adaboost: { ...adaboost, marks: false },
  unified: { ...unified, marks: false },
  "unified-incorrect": { ...unified, marks: true },
};

/**
 * Run a trial (replication/irl/loop.py), an iteration each time that it is asked.
 *
 * A task has a `world`, `correct`, one trajectory, and `incorrect`, some. What is yielded after
 * each weight update, and once before the first, is the state of the method.
 */
function* iterations(task, method, params, root, trial, learn) {
  const { world, correct, incorrect } = task;
  const { start, update, marks } = METHODS[method];
  const size = 4 * world.states;
  const learning = stream(seedSequence(root, trial, 0));
  const rolling = stream(seedSequence(root, trial, 1));
  const muE = expectations(world, correct, params.gamma);
  const seen = visited(world, marks ? incorrect : []);
  let w = new Float64Array(size), memory = start(size, params), q = new Float64Array(size);
  if (params.w_start !== "zero") w = uniform(seedSequence(root, trial, 2), size).map((x) => 0.001 * x);
  let steps = 0, collisions = 0;
  for (let i = 0; ; i++) {
    const episode = rollOut(world, q, rolling, params);
    const muI = expectations(world, episode, params.gamma); // Eq. 7
    const error = norm(muE.map((x, k) => x - muI[k])); // Eq. 6
    const converged = error <= params.threshold;
    const ended = converged || i === params.max_iterations;
    yield { i, error, converged, ended, w, memory, q, episode, steps, collisions };
    if (ended) return;
    [w, memory] = update(w, memory, muE, muI, seen, params);
    q = params.q_start === "reset" ? new Float64Array(size) : q.slice();
    const [taken, hit] = learn(world, w, q, learning, params); // Eq. 1
    steps += taken;
    collisions = hit;
  }
}

/** Run a whole trial; `each` is told of every iteration. */
function runTrial(task, method, params, root, trial, learn, each = () => {}) {
  const onPath = [...new Set(task.correct.states.slice(0, -1))].sort((a, b) => a - b);
  const best = (table) => onPath.map((state) => largest(table, 4 * state));
  const result = { errors: [], episodes: [], collisions: [], values: [], rewards: [] };
  for (const now of iterations(task, method, params, root, trial, learn)) {
    result.errors.push(now.error);
    result.episodes.push(now.episode);
    if (now.i) result.collisions.push(now.collisions);
    result.values.push(best(now.q));
    result.rewards.push(best(now.w));
    Object.assign(result, { converged: now.converged, steps: now.steps, weights: now.w, q: now.q });
    each(now);
  }
  return { ...result, iterations: result.errors.length - 1 };
}
