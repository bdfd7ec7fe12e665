// What stands around the structure on the canvas: the ground's grid, the axes' directions, a push.

const GRID_LINES = 5; // to each side of the centre

function drawGround(c, camera, theme, ground) {
  if (ground === null || camera.pitch < 0.02) return;
  const half = gridStep(camera.radius) * GRID_LINES;
  c.strokeStyle = theme.rule;
  c.lineWidth = 0.8;
  c.beginPath();
  for (let k = -GRID_LINES; k <= GRID_LINES; k++) {
    const at = (k * half) / GRID_LINES;
    line(c, camera, [at, -half, ground], [at, half, ground]);
    line(c, camera, [-half, at, ground], [half, at, ground]);
  }
  c.stroke();
}

// Distance of two lines of the grid, m: a round number near a third of the structure's radius.
function gridStep(radius) {
  const decade = 10 ** Math.floor(Math.log10(radius / 3));
  return decade * [1, 2, 5, 10].reduce((a, b) => (Math.abs(b * decade - radius / 3) < Math.abs(a * decade - radius / 3) ? b : a));
}

function line(c, camera, from, to) {
  const [a, b] = [from, to].map((point) => onCanvas(camera, point));
  c.moveTo(a[0], a[1]);
  c.lineTo(b[0], b[1]);
}

function onCanvas(camera, point) {
  const [x, y, z] = camera.see(point, [0, 0, 0]);
  const scale = camera.magnify(z);
  return [camera.x0 + scale * x, camera.y0 - scale * y];
}

function drawTriad(c, camera, theme, height) {
  const [x0, y0, long] = [34, height - 34, 22];
  c.font = "11px system-ui, sans-serif";
  c.textAlign = "center";
  c.textBaseline = "middle";
  c.strokeStyle = c.fillStyle = theme.muted;
  c.lineWidth = 1.2;
  ["x", "y", "z"].forEach((name, k) => {
    const [dx, dy] = [camera.right[k] * long, -camera.up[k] * long];
    c.beginPath();
    c.moveTo(x0, y0);
    c.lineTo(x0 + dx, y0 + dy);
    c.stroke();
    if (Math.hypot(dx, dy) > 6) c.fillText(name, x0 + 1.38 * dx, y0 + 1.38 * dy);
  });
}

function drawPush(c, camera, theme, points, push) {
  const head = [0, 1, 2].map((k) => points[3 * push.node + k]);
  const tail = head.map((x, k) => x - 0.55 * camera.radius * push.direction[k]);
  const [x, y] = onCanvas(camera, head);
  const [X, Y] = onCanvas(camera, tail);
  const angle = Math.atan2(y - Y, x - X);
  c.save();
  c.globalAlpha = push.strength;
  c.strokeStyle = c.fillStyle = theme.push;
  c.lineWidth = 3;
  c.beginPath();
  c.moveTo(X, Y);
  c.lineTo(x - 12 * Math.cos(angle), y - 12 * Math.sin(angle));
  c.stroke();
  c.beginPath();
  c.moveTo(x - 4 * Math.cos(angle), y - 4 * Math.sin(angle));
  for (const side of [0.45, -0.45]) c.lineTo(x - 17 * Math.cos(angle + side), y - 17 * Math.sin(angle + side));
  c.fill();
  c.font = "600 12px system-ui, sans-serif";
  c.textAlign = "center";
  c.fillText(push.text, X - 16 * Math.cos(angle), Y - 16 * Math.sin(angle) - 4);
  c.restore();
}
