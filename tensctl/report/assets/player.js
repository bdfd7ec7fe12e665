// The player of a recorded motion: clock, slider, keys, speeds; it tells the time to whoever follows.

class Player {
  constructor(root, motion, themes) {
    this.root = root;
    this.motion = motion;
    this.stage = new Stage(root.querySelector("canvas"), motion.model, themes, motion.centre, motion.reach);
    this.stage.inkOf = inkByTension(motion, themes);
    this.still = motion.times.length < 2;
    this.followers = []; // called with the time (s) whenever it changes
    this.time = motion.begin;
    this.speed = Number(this.control("speed")?.value ?? 1);
    this.playing = false;
    this.last = 0; // when the frame before was drawn, ms
    this.waiting = false; // for the next frame
    steer(this.stage, () => this.redraw(), (found) => this.describe(found), root.querySelector(".tip"));
    new ResizeObserver(() => this.redraw()).observe(this.stage.canvas);
    this.listenToControls();
    this.listenToKeys();
    this.drawNow();
  }

  control(name) {
    return this.root.querySelector(`[data-control="${name}"]`);
  }

  redraw() {
    if (!this.waiting) requestAnimationFrame((now) => this.paint(now));
    this.waiting = true;
  }

  paint(now) {
    this.waiting = false;
    if (this.playing) {
      // A tab that was hidden goes on from where it was instead of leaping ahead.
      this.time = Math.min(this.motion.end, this.time + (Math.min(now - this.last, 100) / 1000) * this.speed);
      this.last = now;
      if (this.time >= this.motion.end) this.play(false);
      else this.redraw();
      this.show();
    }
    this.drawNow();
  }

  drawNow() {
    this.motion.at(this.time, this.stage.points);
    this.stage.pushes = pushesAt(this.motion.pushes, this.time);
    this.stage.draw();
  }

  show() {
    if (this.still) return;
    this.control("time").textContent = `${this.time.toFixed(2)} s`;
    this.control("slider").value = String(this.time);
    const slack = this.motion.slack.reduce((sum, is) => sum + is, 0);
    this.control("slack").textContent = slack ? `${slack} slack` : "all taut";
    for (const follow of this.followers) follow(this.time);
  }

  play(wish) {
    if (this.still) return;
    if (wish && this.time >= this.motion.end) this.time = this.motion.begin;
    this.playing = wish;
    this.last = performance.now();
    const button = this.control("play");
    button.setAttribute("aria-label", wish ? "Pause" : "Play");
    button.dataset.playing = String(wish);
    this.redraw();
  }

  // Stop at a time.
  seek(wanted) {
    if (this.still) return;
    this.play(false);
    this.time = Math.min(this.motion.end, Math.max(this.motion.begin, wanted));
    this.motion.at(this.time, this.stage.points);
    this.show();
  }

  // From recorded time to recorded time.
  step(frames) {
    const { times } = this.motion;
    const next = this.motion.frameAt(this.time) + frames;
    this.seek(times[Math.min(times.length - 1, Math.max(0, next))]);
  }

  look(name) {
    this.stage.camera.look(name);
    this.redraw();
  }

  listenToControls() {
    for (const button of this.root.querySelectorAll("[data-view]")) {
      button.addEventListener("click", () => this.look(button.dataset.view));
    }
    const on = (name, event, act) => this.control(name)?.addEventListener(event, (e) => act(e.target));
    on("play", "click", () => this.play(!this.playing));
    on("slider", "input", (slider) => this.seek(Number(slider.value)));
    on("speed", "change", (choice) => (this.speed = Number(choice.value)));
    on("wanted", "change", (box) => {
      this.stage.ghost = box.checked ? Float32Array.from(this.motion.wanted) : null;
      this.redraw();
    });
  }

  listenToKeys() {
    const keys = {
      " ": () => this.play(!this.playing),
      ArrowLeft: () => this.step(-1),
      ArrowRight: () => this.step(1),
      Home: () => this.seek(this.motion.begin),
      End: () => this.seek(this.motion.end),
      "+": () => this.stage.camera.zoomBy(1.2),
      "-": () => this.stage.camera.zoomBy(1 / 1.2),
      1: () => this.look("side"),
      2: () => this.look("top"),
      3: () => this.look("oblique"),
    };
    this.stage.canvas.addEventListener("keydown", (event) => {
      const act = event.ctrlKey || event.metaKey || event.altKey ? null : keys[event.key];
      if (!act) return;
      event.preventDefault();
      act();
      this.redraw();
    });
  }

  // What the pointer's tip says of a member.
  describe({ kind, index }) {
    const length = `${this.stage.length(kind, index).toFixed(3)} m`;
    if (kind === ROD) return `${this.motion.rodLabels[index]} · rod · ${length}`;
    const label = this.motion.tendonLabels[index];
    if (!this.motion.stressed) return `${label} · ${length}`;
    const tension = this.motion.slack[index] ? "slack" : `${this.motion.tension[index].toFixed(2)} N`;
    return `${label} · ${tension} · ${length}`;
  }

  // Play once, the first time that most of the canvas is on the screen.
  playWhenSeen() {
    const watcher = new IntersectionObserver(
      (entries) => {
        if (!entries.some((entry) => entry.isIntersecting)) return;
        watcher.disconnect();
        this.play(true);
      },
      { threshold: 0.6 },
    );
    watcher.observe(this.stage.canvas);
  }
}
