// Priority at junctions: signs beside the lanes, and teeth where a way waits for others.

import type { Camera } from "./camera";
import type { Theme } from "./colors";
import { SIGN_KINDS } from "./contract";
import type { Run } from "./run";

/** Below this scale the symbols would cover the junction [px/m]. */
const SCALE_MIN = 3;

/** Size of a sign [m] and the least of it [px], half width and length of a tooth [m]. */
const SIGN = 1.1;
const SIGN_MIN = 5;
const TOOTH = 0.35;

type Corner = [number, number];

function polygon(count: number, turn: number): Corner[] {
  return Array.from({ length: count }, (_, i) => {
    const angle = turn + (2 * Math.PI * i) / count;
    return [Math.cos(angle), Math.sin(angle)];
  });
}

/** How the kinds of signs look; y points down. */
const SIGNS: Record<(typeof SIGN_KINDS)[number], { corners: Corner[]; fill: string; rim: string; face: number }> = {
  stop: { corners: polygon(8, Math.PI / 8), fill: "#c1121f", rim: "#ffffff", face: 0.86 },
  yield: { corners: polygon(3, Math.PI / 2), fill: "#ffffff", rim: "#c1121f", face: 0.62 },
  priority: { corners: polygon(4, 0), fill: "#ffc400", rim: "#ffffff", face: 0.72 },
};

export function drawPriorities(ctx: CanvasRenderingContext2D, camera: Camera, ratio: number, run: Run, theme: Theme): void {
  if (camera.scale < SCALE_MIN) return;
  if (run.has("wait_xy")) drawTeeth(ctx, camera, ratio, run, theme);
  if (run.has("sign_xy")) drawSigns(ctx, camera, ratio, run);
}

/** A row of triangles across the lane that point at the vehicle that waits. */
function drawTeeth(ctx: CanvasRenderingContext2D, camera: Camera, ratio: number, run: Run, theme: Theme): void {
  const [xy, heading] = [run.table("wait_xy"), run.table("wait_heading")];
  camera.worldTransform(ctx, ratio);
  ctx.fillStyle = theme === "dark" ? "#d9dde0" : "#6a6a6a";
  for (let i = 0; i < heading.length; i++) {
    const [cos, sin] = [Math.cos(heading[i]), Math.sin(heading[i])];
    const to = (along: number, aside: number): Corner => [xy[2 * i] + along * cos - aside * sin, xy[2 * i + 1] + along * sin + aside * cos];
    ctx.beginPath();
    for (const aside of [-2 * TOOTH, 0, 2 * TOOTH]) {
      ctx.moveTo(...to(0, aside - 0.8 * TOOTH));
      ctx.lineTo(...to(0, aside + 0.8 * TOOTH));
      ctx.lineTo(...to(-2 * TOOTH, aside));
      ctx.closePath();
    }
    ctx.fill();
  }
}

function drawSigns(ctx: CanvasRenderingContext2D, camera: Camera, ratio: number, run: Run): void {
  const [xy, kind] = [run.table("sign_xy"), run.table("sign_kind")];
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  const size = Math.max(SIGN_MIN, SIGN * camera.scale);
  for (let i = 0; i < kind.length; i++) {
    const { corners, fill, rim, face } = SIGNS[SIGN_KINDS[kind[i]]];
    const [x, y] = camera.toScreen(xy[2 * i], xy[2 * i + 1]);
    const trace = (reach: number) => {
      ctx.beginPath();
      for (const [u, v] of corners) ctx.lineTo(x + reach * u, y + reach * v);
      ctx.closePath();
    };
    // A dark edge, the rim and the face, each within the one before.
    for (const [reach, color] of [
      [1.12 * size, "#3c3c3c"],
      [size, rim],
      [face * size, fill],
    ] as [number, string][]) {
      trace(reach);
      ctx.fillStyle = color;
      ctx.fill();
    }
  }
}
