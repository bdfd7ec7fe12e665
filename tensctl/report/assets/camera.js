// A camera on a sphere around the structure: yaw about the vertical, pitch above the horizon, mild perspective.

const VIEWS = {
  oblique: { yaw: (-62 * Math.PI) / 180, pitch: (16 * Math.PI) / 180 }, // as in the report's static drawings
  side: { yaw: -Math.PI / 2, pitch: 0 },
  top: { yaw: -Math.PI / 2, pitch: Math.PI / 2 },
};
const EYE = 5.0; // distance of the eye from the centre, in radii: near enough to see depth, far enough not to distort

class Camera {
  // reach: largest distance (m) of a node from the vertical axis through the centre, largest height above or below it.
  constructor(centre, reach) {
    this.centre = centre;
    this.reach = reach;
    this.radius = Math.hypot(...reach);
    this.zoom = 1;
    this.look("oblique");
  }

  look(name) {
    Object.assign(this, VIEWS[name]);
  }

  turn(dx, dy) {
    this.yaw -= dx * 0.008;
    this.pitch = Math.min(Math.PI / 2, Math.max(-0.35, this.pitch + dy * 0.008));
  }

  zoomBy(factor) {
    this.zoom = Math.min(12, Math.max(0.4, this.zoom * factor));
  }

  // Fix the view for one frame on a canvas of this size (CSS pixels).
  aim(width, height) {
    const [sy, cy, sp, cp] = [Math.sin(this.yaw), Math.cos(this.yaw), Math.sin(this.pitch), Math.cos(this.pitch)];
    this.right = [-sy, cy, 0];
    this.up = [-sp * cy, -sp * sy, cp];
    this.near = [cp * cy, cp * sy, sp];
    this.x0 = width / 2;
    this.y0 = height / 2;
    const [across, upward] = this.reach;
    const tall = Math.max(upward * Math.cos(VIEWS.oblique.pitch) + across * Math.sin(VIEWS.oblique.pitch), across);
    this.scale = this.zoom * 0.42 * Math.min(height / tall, width / across);
    this.eye = EYE * this.radius;
  }

  // Positions (3 numbers a point) seen from the camera: to the right, up, towards the eye, in metres.
  see(points, seen) {
    const [r, u, n, c] = [this.right, this.up, this.near, this.centre];
    for (let k = 0; k < points.length; k += 3) {
      const [x, y, z] = [points[k] - c[0], points[k + 1] - c[1], points[k + 2] - c[2]];
      seen[k] = x * r[0] + y * r[1];
      seen[k + 1] = x * u[0] + y * u[1] + z * u[2];
      seen[k + 2] = x * n[0] + y * n[1] + z * n[2];
    }
    return seen;
  }

  // Magnification (pixels a metre) at a depth towards the eye.
  magnify(depth) {
    return (this.scale * this.eye) / Math.max(this.eye - depth, 0.05 * this.eye);
  }
}
