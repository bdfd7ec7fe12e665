// Draws the structure on a canvas, farthest piece first. It knows nothing of time: whoever owns it sets `points`,
// `inkOf` and the extras, then calls draw(). No GPU is needed: (8,4) with 368 members is some 2500 strokes a frame.

const ROD = 0;
const TENDON = 1;
const NODE = 2;

class Stage {
  // model: nodes (count), rods and tendons (tail, head, tail, head, ...), pinned (node numbers), ground (m or null).
  // The tendons are segments: tendonOf says for each which tendon or cable it is a piece of.
  constructor(canvas, model, themes, centre, reach) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.model = model;
    this.themes = themes;
    this.camera = new Camera(centre, reach);
    this.points = new Float32Array(3 * model.nodes);
    this.seen = new Float32Array(3 * model.nodes);
    this.inkOf = () => null; // tendon -> { levels: colours over depth, width: pixels, dashed }
    this.ghost = null; // other positions, drawn faintly
    this.ghostInk = "ghost";
    this.pushes = []; // { node, direction (unit), text, strength 0..1 }
    this.marked = null; // { kind, index } under the pointer
    this.pinned = new Set(model.pinned);
    this.pieces = this.cut();
    this.order = this.pieces.map((_, k) => k);
    this.depth = new Float32Array(this.pieces.length);
    this.thickness = Math.max(0.4, Math.min(1, Math.sqrt(24 / model.rods.length))); // as the static drawings
  }

  // Members in pieces, so that sorting by the middle's depth is right where a long rod passes many tendons.
  cut() {
    const { rods, tendons, nodes } = this.model;
    const few = rods.length + tendons.length < 1600;
    const pieces = [];
    const add = (kind, ends, parts) => {
      for (let m = 0; m < ends.length / 2; m++) {
        for (let p = 0; p < parts; p++) {
          const [a, b] = [ends[2 * m], ends[2 * m + 1]];
          pieces.push({ kind, index: m, a: 3 * a, b: 3 * b, from: p / parts, to: (p + 1) / parts });
        }
      }
    };
    add(ROD, rods, few ? 6 : 3);
    add(TENDON, tendons, few ? 3 : 1);
    for (let n = 0; n < nodes; n++) pieces.push({ kind: NODE, index: n, a: 3 * n, b: 3 * n, from: 0, to: 0 });
    return pieces;
  }

  draw() {
    const { canvas, context: c, camera } = this;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width || !height) return;
    const ratio = this.themes.printing ? 2 : Math.min(window.devicePixelRatio || 1, 2);
    const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.theme = this.themes.now;
    c.fillStyle = this.theme.paper;
    c.fillRect(0, 0, width, height);
    c.lineCap = "butt";
    camera.aim(width, height);
    drawGround(c, camera, this.theme, this.model.ground);
    if (this.ghost) this.drawGhost();
    camera.see(this.points, this.seen);
    this.sort();
    for (const k of this.order) this.drawPiece(this.pieces[k], this.depth[k]);
    c.setLineDash([]);
    if (this.marked) this.drawMarked();
    for (const push of this.pushes) drawPush(c, camera, this.theme, this.points, push);
    drawTriad(c, camera, this.theme, height);
  }

  sort() {
    const { pieces, depth, seen } = this;
    for (let k = 0; k < pieces.length; k++) {
      const p = pieces[k];
      const middle = (p.from + p.to) / 2;
      depth[k] = seen[p.a + 2] * (1 - middle) + seen[p.b + 2] * middle + (p.kind === NODE ? 0.01 * this.camera.radius : 0);
    }
    this.order.sort((i, j) => depth[i] - depth[j]);
  }

  // Canvas place of the point that lies this far along a piece's member.
  place(p, share) {
    const { seen, camera } = this;
    const at = (k) => seen[p.a + k] * (1 - share) + seen[p.b + k] * share;
    const scale = camera.magnify(at(2));
    return [camera.x0 + scale * at(0), camera.y0 - scale * at(1), scale];
  }

  drawPiece(p, depth) {
    const share = 0.5 + (0.5 * depth) / this.camera.radius;
    const level = Math.max(0, Math.min(DEPTH_LEVELS - 1, Math.round(share * (DEPTH_LEVELS - 1))));
    const [x, y, scale] = this.place(p, p.from);
    if (p.kind === NODE) return this.drawNode(p, x, y, level, scale);
    const [X, Y] = this.place(p, p.to);
    if (p.kind === ROD) return this.drawRod(p, x, y, X, Y, level, scale);
    const ink = this.inkOf(p.index);
    if (!ink) return;
    const c = this.context;
    if (!ink.dashed) this.halo(p, x, y, X, Y, ink.width + 2.6);
    c.setLineDash(ink.dashed ? [3, 4] : []);
    this.stroke(x, y, X, Y, ink.width, ink.levels[level], 0.4);
  }

  // A gap in what lies behind a piece; not at its member's ends, where it would bite into the node and its other
  // members.
  halo(p, x, y, X, Y, width) {
    const length = Math.hypot(X - x, Y - y) || 1;
    const [begin, end] = [p.from === 0 ? 9 / length : 0, p.to === 1 ? 9 / length : 0];
    if (begin + end > 0.8) return;
    const [dx, dy] = [X - x, Y - y];
    this.stroke(x + begin * dx, y + begin * dy, X - end * dx, Y - end * dy, width, this.theme.paper);
  }

  rodWidth(scale) {
    return Math.max(1.8, Math.min(14, 0.02 * this.thickness * this.camera.radius * scale));
  }

  drawRod(p, x, y, X, Y, level, scale) {
    const width = this.rodWidth(scale);
    const length = Math.hypot(X - x, Y - y) || 1;
    let [nx, ny] = [-(Y - y) / length, (X - x) / length];
    if (ny > 0) [nx, ny] = [-nx, -ny]; // the light comes from above
    this.context.setLineDash([]);
    this.halo(p, x, y, X, Y, width + 2);
    this.stroke(x, y, X, Y, width, this.theme.rod[level], 0.5);
    const s = 0.16 * width;
    this.stroke(x + s * nx, y + s * ny, X + s * nx, Y + s * ny, 0.32 * width, this.theme.rodLight[level], 0.5);
  }

  drawNode(p, x, y, level, scale) {
    const { context: c, theme } = this;
    const r = Math.max(1.8, 0.72 * this.rodWidth(scale));
    c.fillStyle = theme.rod[level];
    c.beginPath();
    if (this.pinned.has(p.index)) {
      c.moveTo(x, y);
      c.lineTo(x - 2.1 * r, y + 3.4 * r);
      c.lineTo(x + 2.1 * r, y + 3.4 * r);
      c.closePath();
    } else {
      c.arc(x, y, r, 0, 2 * Math.PI);
    }
    c.fill();
  }

  // A straight stroke, lengthened by `more` pixels at both ends so that no seam shows between pieces.
  stroke(x, y, X, Y, width, colour, more = 0) {
    const c = this.context;
    const length = Math.hypot(X - x, Y - y) || 1;
    const [dx, dy] = [((X - x) / length) * more, ((Y - y) / length) * more];
    c.strokeStyle = colour;
    c.lineWidth = width;
    c.beginPath();
    c.moveTo(x - dx, y - dy);
    c.lineTo(X + dx, Y + dy);
    c.stroke();
  }

  drawGhost() {
    const { context: c, camera, model } = this;
    const seen = camera.see(this.ghost, new Float32Array(this.ghost.length));
    c.strokeStyle = this.theme[this.ghostInk];
    for (const [ends, width] of [[model.rods, 2.2], [model.tendons, 0.7]]) {
      c.lineWidth = width;
      c.beginPath();
      ends.forEach((node, k) => {
        const scale = camera.magnify(seen[3 * node + 2]);
        const [x, y] = [camera.x0 + scale * seen[3 * node], camera.y0 - scale * seen[3 * node + 1]];
        if (k % 2) c.lineTo(x, y);
        else c.moveTo(x, y);
      });
      c.stroke();
    }
  }

  drawMarked() {
    const p = this.pieces.find((piece) => piece.kind === this.marked.kind && piece.index === this.marked.index);
    const [x, y] = this.place(p, 0);
    const [X, Y] = this.place(p, 1);
    this.stroke(x, y, X, Y, 1.4, this.theme.text);
    this.context.fillStyle = this.theme.text;
    for (const [a, b] of [[x, y], [X, Y]]) {
      this.context.beginPath();
      this.context.arc(a, b, 4, 0, 2 * Math.PI);
      this.context.fill();
    }
  }

  // The member within 7 pixels of a canvas place, or null; of several the nearest to the pointer.
  pick(px, py) {
    let [best, least] = [null, 7];
    for (const p of this.pieces) {
      if (p.kind === NODE) continue;
      const [x, y] = this.place(p, p.from);
      const [X, Y] = this.place(p, p.to);
      const along = ((px - x) * (X - x) + (py - y) * (Y - y)) / ((X - x) ** 2 + (Y - y) ** 2 || 1);
      const t = Math.max(0, Math.min(1, along));
      const distance = Math.hypot(px - x - t * (X - x), py - y - t * (Y - y));
      if (distance < least) [best, least] = [p, distance];
    }
    return best && { kind: best.kind, index: best.index };
  }

  length(kind, index) {
    const ends = kind === ROD ? this.model.rods : this.model.tendons;
    const [a, b, q] = [3 * ends[2 * index], 3 * ends[2 * index + 1], this.points];
    return Math.hypot(q[b] - q[a], q[b + 1] - q[a + 1], q[b + 2] - q[a + 2]);
  }
}
