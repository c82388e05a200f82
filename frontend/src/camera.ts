// Which part of the world the map shows: centre, scale, and a turn that never changes.

export class Camera {
  x = 0;
  y = 0;
  /** Pixels per metre. */
  scale = 4;
  width = 1;
  height = 1;
  private readonly cos: number;
  private readonly sin: number;

  constructor(readonly angle: number) {
    this.cos = Math.cos(angle);
    this.sin = Math.sin(angle);
  }

  /** Shows a rectangle around a point, sides along the map's axes [m]. */
  fit(x: number, y: number, width: number, height: number): void {
    this.x = x;
    this.y = y;
    this.scale = Math.min(this.width / Math.max(width, 1), this.height / Math.max(height, 1));
  }

  toScreen(x: number, y: number): [number, number] {
    const u = x - this.x;
    const v = y - this.y;
    return [this.width / 2 + this.scale * (this.cos * u + this.sin * v), this.height / 2 - this.scale * (this.cos * v - this.sin * u)];
  }

  toWorld(px: number, py: number): [number, number] {
    const u = (px - this.width / 2) / this.scale;
    const v = (this.height / 2 - py) / this.scale;
    return [this.x + this.cos * u - this.sin * v, this.y + this.sin * u + this.cos * v];
  }

  pan(dx: number, dy: number): void {
    const [x, y] = this.toWorld(this.width / 2 - dx, this.height / 2 - dy);
    this.x = x;
    this.y = y;
  }

  zoom(factor: number, px = this.width / 2, py = this.height / 2): void {
    const [x, y] = this.toWorld(px, py);
    this.scale = Math.min(200, Math.max(0.05, this.scale * factor));
    const [qx, qy] = this.toScreen(x, y);
    this.pan(px - qx, py - qy);
  }

  shows(x: number, y: number, margin = 40): boolean {
    const [px, py] = this.toScreen(x, y);
    return px > margin && py > margin && px < this.width - margin && py < this.height - margin;
  }

  /** Canvas units are metres of the world from here on. */
  worldTransform(ctx: CanvasRenderingContext2D, ratio: number): void {
    const s = this.scale * ratio;
    const [e, f] = this.toScreen(0, 0);
    ctx.setTransform(s * this.cos, s * this.sin, s * this.sin, -s * this.cos, e * ratio, f * ratio);
  }

  /** Canvas units are metres of a body at that pose, enlarged by a factor. */
  bodyTransform(ctx: CanvasRenderingContext2D, ratio: number, x: number, y: number, orientation: number, factor = 1): void {
    const s = this.scale * ratio * factor;
    const heading = orientation - this.angle;
    const [e, f] = this.toScreen(x, y);
    const [c, d] = [Math.cos(heading), Math.sin(heading)];
    ctx.setTransform(s * c, -s * d, -s * d, -s * c, e * ratio, f * ratio);
  }
}
