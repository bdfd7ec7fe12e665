// Turning, zooming and asking on a stage: drag or one finger turns, the wheel or two fingers zoom, hovering names.

function steer(stage, redraw, describe, tip) {
  const { canvas, camera } = stage;
  const fingers = new Map();
  let scrolled = -1e9;

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    canvas.classList.add("held");
    hush();
  });
  const release = (event) => {
    fingers.delete(event.pointerId);
    if (!fingers.size) canvas.classList.remove("held");
  };
  canvas.addEventListener("pointerup", release);
  canvas.addEventListener("pointercancel", release);

  canvas.addEventListener("pointermove", (event) => {
    const old = fingers.get(event.pointerId);
    if (!old) return ask(event);
    const before = spread();
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (fingers.size === 1) camera.turn(event.clientX - old[0], event.clientY - old[1]);
    else if (before) camera.zoomBy(spread() / before);
    redraw();
  });

  function spread() {
    const [a, b] = [...fingers.values()];
    return b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 0;
  }

  // A wheel that is scrolling the page goes on doing so when the canvas slides under the pointer.
  window.addEventListener("scroll", () => (scrolled = performance.now()), { passive: true });
  canvas.addEventListener(
    "wheel",
    (event) => {
      if (performance.now() - scrolled < 250) return;
      event.preventDefault();
      camera.zoomBy(Math.exp(-0.0015 * event.deltaY * (event.deltaMode ? 16 : 1)));
      redraw();
    },
    { passive: false },
  );
  canvas.addEventListener("dblclick", () => {
    camera.look("oblique");
    camera.zoom = 1;
    redraw();
  });

  function ask(event) {
    const box = canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    const found = stage.pick(x, y);
    const same = found && stage.marked && found.kind === stage.marked.kind && found.index === stage.marked.index;
    stage.marked = found;
    tip.hidden = !found;
    if (found) {
      tip.textContent = describe(found);
      tip.style.transform = `translate(${Math.min(x + 14, box.width - 190)}px, ${Math.max(y - 34, 4)}px)`;
    }
    if (!same) redraw();
  }

  function hush() {
    stage.marked = null;
    tip.hidden = true;
  }
  canvas.addEventListener("pointerleave", () => {
    hush();
    redraw();
  });
}
