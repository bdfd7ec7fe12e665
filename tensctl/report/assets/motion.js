// The recorded motion: frames out of base64, a clock, and the controls around the stage.

function bytes(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
}

class Motion {
  constructor(data) {
    Object.assign(this, data);
    this.q = new Int16Array(bytes(data.q));
    this.t = new Uint16Array(bytes(data.t));
    this.tendonCount = data.model.tendons.length / 2;
    this.tension = new Float32Array(this.tendonCount);
    this.slack = new Uint8Array(this.tendonCount);
  }

  get begin() {
    return this.times[0];
  }

  get end() {
    return this.times[this.times.length - 1];
  }

  // Number of the last frame that is not after a time.
  frameAt(time) {
    let [low, high] = [0, this.times.length - 1];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.times[middle] <= time + 1e-9) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  // Positions (m) into `points` and tensions (N) into this.tension, straight between the two frames around a time.
  // A tendon counts as slack when the nearer frame says so.
  at(time, points) {
    const a = this.frameAt(time);
    const b = Math.min(a + 1, this.times.length - 1);
    const gap = this.times[b] - this.times[a];
    const share = gap > 0 ? Math.min(1, Math.max(0, (time - this.times[a]) / gap)) : 0;
    const [n, m] = [points.length, this.tendonCount];
    for (let k = 0; k < n; k++) {
      const value = this.q[a * n + k] * (1 - share) + this.q[b * n + k] * share;
      points[k] = this.centre[k % 3] + this.step * value;
    }
    const near = share < 0.5 ? a : b;
    for (let k = 0; k < m; k++) {
      const value = this.t[a * m + k] * (1 - share) + this.t[b * m + k] * share;
      this.tension[k] = (value * this.tensionMax) / 65535;
      this.slack[k] = this.t[near * m + k] === 0;
    }
  }
}

function inkByTension(motion, themes) {
  return (k) => {
    if (!motion.stressed) return { levels: themes.now.plain, width: 1.5, dashed: false };
    if (motion.slack[k]) return { levels: themes.now.slack, width: 1.1, dashed: true };
    const share = Math.min(1, motion.tension[k] / motion.tensionScale);
    return { levels: themes.now.ramp[Math.round(share * (RAMP_STEPS - 1))], width: 1.3 + 2.2 * share, dashed: false };
  };
}

// Pushes to draw at a time: full while they act, then fading for a second, since a tenth of one is easily missed.
function pushesAt(pushes, time) {
  return pushes
    .filter((push) => time >= push.begin && time < push.end + 1)
    .map((push) => {
      const size = Math.hypot(...push.force) || 1;
      return {
        node: push.node,
        direction: push.force.map((x) => x / size),
        text: `${Number(size.toPrecision(3))} N`,
        strength: time <= push.end ? 1 : 0.75 * (1 - (time - push.end)),
      };
    });
}
