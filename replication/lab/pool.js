// Trials, run away from the page in workers.
"use strict";

/** Trials that run in workers, a few at once. */
class Trials {
  constructor(workers) {
    this.waiting = [];
    this.running = new Map();
    const code = new Blob([$("lab-worker").textContent], { type: "text/javascript" });
    this.address = URL.createObjectURL(code);
    this.idle = Array.from({ length: workers }, () => this.start());
  }

  start() {
    const worker = new Worker(this.address);
    worker.postMessage({ wasm: bytes(DATA.wasm) });
    worker.onmessage = ({ data }) => {
      const job = this.running.get(worker);
      if (!job) return;
      if (data.now) return job.each(data.now);
      this.running.delete(worker);
      this.idle.push(worker);
      job.settle(data);
      this.next();
    };
    return worker;
  }

  /** Run a trial; `each` is told of every iteration if the job is watched. */
  run(job, each = () => {}) {
    return new Promise((resolve, reject) => {
      const settle = (data) => (data.done ? resolve(data.done) : reject(new Error(data.failed)));
      this.waiting.push({ job, each, settle });
      this.next();
    });
  }

  next() {
    while (this.idle.length && this.waiting.length) {
      const [worker, job] = [this.idle.pop(), this.waiting.shift()];
      this.running.set(worker, job);
      worker.postMessage(job.job);
    }
  }

  /** Stop all; what was asked for is never answered. */
  stop() {
    this.waiting = [];
    for (const worker of this.running.keys()) {
      worker.terminate();
      this.idle.push(this.start());
    }
    this.running.clear();
  }
}

const cores = Math.min(4, navigator.hardwareConcurrency || 2);
const watching = new Trials(DATA.methods.length);
const counting = new Trials(cores);
