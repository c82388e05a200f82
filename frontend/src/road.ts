// The road: drawn on a canvas of its own, again only when the camera moves.

import type { Camera } from "./camera";
import { PALETTES, type Theme } from "./colors";
import { drawPriorities } from "./priorities";
import type { Run } from "./run";

type Layer = "surfaces" | "arrows" | "dashed" | "solid" | "edges";

export class Road {
  private readonly paths = new Map<Layer, Path2D>();

  constructor(private readonly run: Run) {
    for (const layer of ["surfaces", "arrows", "dashed", "solid", "edges"] as const)
      this.paths.set(layer, linesOf(run, layer, layer === "surfaces"));
  }

  draw(ctx: CanvasRenderingContext2D, camera: Camera, ratio: number, theme: Theme): void {
    const colors = PALETTES[theme];
    ctx.setTransform(1, 0, 0, 1, 0, 0);
    ctx.fillStyle = colors.background;
    ctx.fillRect(0, 0, ctx.canvas.width, ctx.canvas.height);
    camera.worldTransform(ctx, ratio);
    const pixel = 1 / camera.scale;
    ctx.lineJoin = "round";
    ctx.lineCap = "butt";
    const surfaces = this.paths.get("surfaces")!;
    ctx.fillStyle = colors.surface;
    ctx.fill(surfaces, "nonzero");
    // The outline in the same colour closes hairline gaps between neighbours.
    this.stroke(ctx, "surfaces", colors.surface, pixel);
    if (camera.scale > 2.5) this.stroke(ctx, "arrows", colors.arrow, Math.max(0.12, pixel));
    if (camera.scale > 1) {
      ctx.setLineDash([3, 3]);
      this.stroke(ctx, "dashed", colors.marking, Math.max(0.15, 1.2 * pixel));
      ctx.setLineDash([]);
      this.stroke(ctx, "solid", colors.marking, Math.max(0.2, 1.6 * pixel));
    }
    this.stroke(ctx, "edges", colors.edge, Math.max(0.12, 1.2 * pixel));
    drawPriorities(ctx, camera, ratio, this.run, theme);
  }

  private stroke(ctx: CanvasRenderingContext2D, layer: Layer, color: string, width: number): void {
    ctx.strokeStyle = color;
    ctx.lineWidth = width;
    ctx.stroke(this.paths.get(layer)!);
  }
}

function linesOf(run: Run, layer: Layer, closed: boolean): Path2D {
  const counts = run.table(`${layer}_n`);
  const xy = run.table(`${layer}_xy`);
  const total = xy.length / 2;
  const path = new Path2D();
  let at = 0;
  for (const count of counts) {
    for (let i = at; i < at + count; i++)
      if (i === at) path.moveTo(xy[i], xy[total + i]);
      else path.lineTo(xy[i], xy[total + i]);
    if (closed) path.closePath();
    at += count;
  }
  return path;
}
