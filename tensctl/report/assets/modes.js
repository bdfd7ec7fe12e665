// Mode shapes: the structure swings in one mode, its tendons coloured by whether the mode stretches or slackens them.

const SWING = 0.13; // largest node displacement drawn, in radii of the structure
const SWING_PERIOD = 1.8; // s on the screen, whatever the frequency: the shape is shown, not the speed

function startModes(root, data, motion, themes, calm) {
  const stage = new Stage(root.querySelector("canvas"), motion.model, themes, data.centre, data.reach);
  const shapes = new Int8Array(bytes(data.shapes));
  const rest = Float32Array.from(data.rest);
  const size = rest.length;
  const title = root.querySelector('[data-control="mode"]');
  const buttons = [...document.querySelectorAll("button[data-mode]")];
  const strain = new Float32Array(motion.model.tendons.length / 2);
  const original = new Float32Array(strain.length);
  const owner = motion.model.tendonOf; // tendons are drawn by segments; a cable lengthens by the sum of its own
  const growth = new Float32Array(strain.length);
  let [mode, playing, began, waiting, greatest] = [data.first, false, 0, false, 1];

  stage.points.set(rest);
  for (let k = 0; k < original.length; k++) original[k] = stage.length(TENDON, k);
  stage.ghost = rest;
  stage.ghostInk = "faint";
  stage.inkOf = (k) => {
    const share = Math.max(-1, Math.min(1, strain[k] / greatest));
    const step = Math.round(((share + 1) / 2) * (RAMP_STEPS - 1));
    return { levels: themes.now.diverging[step], width: 1.2 + 2.4 * Math.abs(share), dashed: false };
  };

  function deflect(amount) {
    const scale = (amount * SWING * stage.camera.radius) / 127;
    for (let k = 0; k < size; k++) stage.points[k] = rest[k] + scale * shapes[mode * size + k];
    growth.fill(0);
    for (let k = 0; k < strain.length; k++) growth[owner[k]] += stage.length(TENDON, k) - original[k];
    for (let k = 0; k < strain.length; k++) strain[k] = growth[owner[k]];
  }

  function redraw() {
    if (!waiting) requestAnimationFrame(paint);
    waiting = true;
  }

  function paint(now) {
    waiting = false;
    deflect(playing ? Math.cos(((now - began) / 1000) * ((2 * Math.PI) / SWING_PERIOD)) : 1);
    stage.draw();
    if (playing) redraw();
  }

  function choose(wanted, swing) {
    mode = wanted;
    title.textContent = data.titles[mode];
    buttons.forEach((button) => button.setAttribute("aria-pressed", String(Number(button.dataset.mode) === mode)));
    deflect(1);
    // A rigid-body mode stretches nothing; without the floor its rounding would be painted in full colour.
    greatest = Math.max(...strain.map(Math.abs), 0.02 * stage.camera.radius);
    playing = swing;
    began = performance.now();
    redraw();
  }

  buttons.forEach((button) => {
    const wanted = Number(button.dataset.mode);
    button.addEventListener("click", () => choose(wanted, !calm && !(playing && wanted === mode)));
  });
  function describe({ kind, index }) {
    if (kind === ROD) return `${motion.rodLabels[index]} · rod`;
    const change = strain[index] / greatest;
    const word = Math.abs(change) < 0.02 ? "keeps its length" : change > 0 ? "lengthens" : "shortens";
    return `${motion.tendonLabels[index]} · ${word}`;
  }
  steer(stage, redraw, describe, root.querySelector(".tip"));
  new ResizeObserver(redraw).observe(stage.canvas);
  choose(mode, false);
  deflect(1);
  stage.draw();
  return () => stage.draw();
}
