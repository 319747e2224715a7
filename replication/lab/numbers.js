// Arithmetic with the bits of Python and NumPy: seeds, random streams, sums, and the digest.
"use strict";

const WORD = 2 ** 32;

/** The entropy of a trial's seed: child k of the root, or child [k, j] of that (NumPy's spawn). */
function seedSequence(root, ...key) {
  const words = [root >>> 0];
  for (let rest = Math.floor(root / WORD); rest > 0; rest = Math.floor(rest / WORD)) words.push(rest >>> 0);
  while (key.length && words.length < 4) words.push(0);
  return [...words, ...key];
}

/** NumPy's SeedSequence.generate_state: that many 32-bit words. */
function generateState(entropy, count) {
  let constant = 0x43b0d7e5;
  const hash = (value) => {
    value ^= constant;
    constant = Math.imul(constant, 0x931e8875);
    value = Math.imul(value, constant);
    return value ^ (value >>> 16);
  };
  const mix = (x, y) => {
    const mixed = (Math.imul(0xca01f9dd, x) - Math.imul(0x4973f715, y)) | 0;
    return mixed ^ (mixed >>> 16);
  };
  const pool = [0, 1, 2, 3].map((i) => hash(entropy[i] ?? 0));
  for (let from = 0; from < 4; from++)
    for (let to = 0; to < 4; to++) if (from !== to) pool[to] = mix(pool[to], hash(pool[from]));
  for (const word of entropy.slice(4))
    for (let to = 0; to < 4; to++) pool[to] = mix(pool[to], hash(word));
  constant = 0x8b51f9dd;
  return Uint32Array.from({ length: count }, (_, i) => {
    let value = pool[i % 4] ^ constant;
    constant = Math.imul(constant, 0x58f38ded);
    value = Math.imul(value, constant);
    return value ^ (value >>> 16);
  });
}

/** A xoshiro256++ stream: four 64-bit words, each as its low and its high half. */
function stream(entropy) {
  const words = generateState(entropy, 8);
  return words.some((word) => word) ? words : Uint32Array.of(1, 0, 1, 0, 1, 0, 1, 0);
}

/** Draw a word: advance the stream, return the two halves in `drawn`. */
const drawn = { high: 0, low: 0 };
function draw(s) {
  const [a0, a1, b0, b1, c0, c1, d0, d1] = s;
  let low = a0 + d0;
  let high = (a1 + d1 + (low >= WORD ? 1 : 0)) >>> 0;
  low >>>= 0;
  const left = ((low << 23) | (high >>> 9)) >>> 0; // rotated by 23
  high = ((high << 23) | (low >>> 9)) >>> 0;
  low = left + a0;
  drawn.high = (high + a1 + (low >= WORD ? 1 : 0)) >>> 0;
  drawn.low = low >>> 0;
  const e0 = c0 ^ a0, e1 = c1 ^ a1, f0 = d0 ^ b0, f1 = d1 ^ b1;
  s[0] = a0 ^ f0;
  s[1] = a1 ^ f1;
  s[2] = b0 ^ e0;
  s[3] = b1 ^ e1;
  s[4] = e0 ^ (b0 << 17);
  s[5] = e1 ^ ((b1 << 17) | (b0 >>> 15));
  s[6] = (f1 << 13) | (f0 >>> 19); // rotated by 45
  s[7] = (f0 << 13) | (f1 >>> 19);
  return drawn;
}

/** The sum of numbers, rounded once (Python's math.fsum, after Shewchuk 1997). */
function exactSum(values) {
  const parts = [];
  for (let x of values) {
    let kept = 0;
    for (let y of parts) {
      if (Math.abs(x) < Math.abs(y)) [x, y] = [y, x];
      const high = x + y;
      const low = y - (high - x);
      if (low) parts[kept++] = low;
      x = high;
    }
    parts.length = kept;
    parts.push(x);
  }
  let total = parts.pop() ?? 0;
  let low = 0;
  while (parts.length && !low) {
    const before = total, y = parts.pop();
    total = before + y;
    low = y - (total - before);
  }
  // half-way cases, which what is left decides
  if (parts.length && low && Math.sign(low) === Math.sign(parts.at(-1))) {
    const more = total + 2 * low;
    if (2 * low === more - total) total = more;
  }
  return total;
}

/** NumPy's pairwise sum, whose order decides the last bits. */
function pairwiseSum(values, from = 0, count = values.length) {
  if (count < 8) {
    let sum = 0;
    for (let i = from; i < from + count; i++) sum += values[i];
    return sum;
  }
  if (count > 128) {
    const half = (count >> 1) - ((count >> 1) % 8);
    return pairwiseSum(values, from, half) + pairwiseSum(values, from + half, count - half);
  }
  const sums = values.slice(from, from + 8);
  let i = 8;
  for (; i < count - (count % 8); i += 8) for (let k = 0; k < 8; k++) sums[k] += values[from + i + k];
  let sum = sums[0] + sums[1] + (sums[2] + sums[3]) + (sums[4] + sums[5] + (sums[6] + sums[7]));
  for (; i < count; i++) sum += values[from + i];
  return sum;
}

/** The Euclidean norm (Eqs. 4 and 6), the squares summed exactly. */
function norm(values) {
  return Math.sqrt(exactSum(Array.from(values, (x) => x * x).filter((square) => square)));
}

/** The digest of a trial, as in `trials.csv`: a hash of every bit of it. */
async function digest(trial) {
  const integers = (list) => BigInt64Array.from(list, BigInt);
  const n = trial.errors.length;
  const parts = [
    [Float64Array.from(trial.errors), [n]],
    [trial.weights, [trial.weights.length / 4, 4]],
    [trial.q, [trial.q.length / 4, 4]],
    [integers(trial.collisions), [n - 1]],
    [Float32Array.from(trial.values.flat()), [n, trial.values[0].length]],
    [Float32Array.from(trial.rewards.flat()), [n, trial.rewards[0].length]],
  ];
  for (const { states, actions } of trial.episodes) {
    const hits = Uint8Array.from(actions, (_, t) => states[t + 1] === states[t]);
    parts.push([integers(states), [states.length]], [integers(actions), [actions.length]], [hits, [actions.length]]);
  }
  const shape = (sizes) => `(${sizes.join(", ")}${sizes.length === 1 ? "," : ""})`;
  const head = [trial.converged ? "True" : "False", trial.steps, ...parts.map(([, sizes]) => shape(sizes))];
  const bytes = await new Blob([`[${head.join(", ")}]`, ...parts.map(([part]) => part)]).arrayBuffer();
  const hash = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
  return `sha256:${Array.from(hash.subarray(0, 8), (byte) => byte.toString(16).padStart(2, "0")).join("")}`;
}

/** NumPy's default_rng(seed).random(count): PCG64, by which W-START draws. */
function uniform(entropy, count) {
  const mask = (1n << 128n) - 1n;
  const [a, b, c, d] = new BigUint64Array(generateState(entropy, 8).buffer);
  const increment = ((((c << 64n) | d) << 1n) | 1n) & mask;
  const step = (state) => (state * 0x2360ed051fc65da44385df649fccf645n + increment) & mask;
  let state = step((increment + ((a << 64n) | b)) & mask);
  return Float64Array.from({ length: count }, () => {
    state = step(state);
    const folded = (state >> 64n) ^ (state & 0xffffffffffffffffn), turn = state >> 122n;
    return Number(BigInt.asUintN(64, (folded >> turn) | (folded << (64n - turn))) >> 11n) * 2 ** -53;
  });
}
