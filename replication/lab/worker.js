// Runs trials away from the page. A job is { id, task, method, params, root, trial, watched, digested }.
"use strict";

let learn = learnPlainly;

onmessage = async ({ data: job }) => {
  if (job.wasm !== undefined) {
    try {
      learn = compileLearner(job.wasm);
    } catch {} // the plain learner serves where WebAssembly is not to be had
    return;
  }
  const began = performance.now();
  const each = ({ i, error, converged, ended, w, memory, q, episode, steps }) => {
    const tables = { w: Float32Array.from(w), memory: Float32Array.from(memory), q: Float32Array.from(q) };
    postMessage({ id: job.id, now: { i, error, converged, ended, episode, steps, ...tables } });
  };
  try {
    const trial = runTrial(job.task, job.method, job.params, job.root, job.trial, learn, job.watched ? each : undefined);
    const { iterations, converged, steps } = trial;
    const seconds = (performance.now() - began) / 1000;
    const found = job.digested ? await digest(trial) : "";
    postMessage({ id: job.id, done: { iterations, converged, steps, seconds, digest: found } });
  } catch (error) {
    postMessage({ id: job.id, failed: String(error) });
  }
};
