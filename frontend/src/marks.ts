// Markers of outcomes and events: shape and colour both tell them apart.

import { MARKS } from "./contract";

export interface Mark {
  text: string;
  color: string;
  /** Corners within a circle of radius 1, y upwards. */
  corners: [number, number][];
}

function regular(count: number, turn = Math.PI / 2, inner?: number): [number, number][] {
  const total = inner === undefined ? count : 2 * count;
  return Array.from({ length: total }, (_, i) => {
    const angle = turn + (2 * Math.PI * i) / total;
    const reach = inner !== undefined && i % 2 ? inner : 1;
    return [reach * Math.cos(angle), reach * Math.sin(angle)];
  });
}

const CROSS: [number, number][] = [
  [0.35, 0],
  [0.9, 0.55],
  [0.55, 0.9],
  [0, 0.35],
  [-0.55, 0.9],
  [-0.9, 0.55],
  [-0.35, 0],
  [-0.9, -0.55],
  [-0.55, -0.9],
  [0, -0.35],
  [0.55, -0.9],
  [0.9, -0.55],
];

/** Shapes by the names that matplotlib has for them. */
const SHAPES: Record<string, [number, number][]> = {
  o: regular(20),
  "^": regular(3),
  v: regular(3, -Math.PI / 2),
  s: regular(4, Math.PI / 4),
  D: regular(4),
  "8": regular(8, Math.PI / 8),
  "*": regular(5, Math.PI / 2, 0.42),
  X: CROSS,
  P: CROSS.map(([x, y]) => [Math.SQRT1_2 * (x - y), Math.SQRT1_2 * (x + y)]),
};

export function mark(kind: string): Mark {
  const { text, color, marker } = MARKS[kind] ?? MARKS.running;
  return { text, color, corners: SHAPES[marker] };
}

/** A marker on a canvas, in pixels. */
export function drawMark(ctx: CanvasRenderingContext2D, kind: string, x: number, y: number, size: number, ink: string): void {
  const { color, corners } = mark(kind);
  ctx.beginPath();
  for (const [u, v] of corners) ctx.lineTo(x + size * u, y - size * v);
  ctx.closePath();
  ctx.fillStyle = color;
  ctx.fill();
  ctx.strokeStyle = ink;
  ctx.lineWidth = Math.max(1, 0.14 * size);
  ctx.stroke();
}

/** A marker as an SVG element for tables. */
export function markIcon(kind: string): SVGElement {
  const space = "http://www.w3.org/2000/svg";
  const icon = document.createElementNS(space, "svg");
  icon.setAttribute("viewBox", "-1.2 -1.2 2.4 2.4");
  icon.setAttribute("class", "mark");
  icon.setAttribute("aria-hidden", "true");
  const shape = document.createElementNS(space, "polygon");
  const { color, corners } = mark(kind);
  shape.setAttribute("points", corners.map(([x, y]) => `${x.toFixed(2)},${(-y).toFixed(2)}`).join(" "));
  shape.setAttribute("fill", color);
  icon.append(shape);
  return icon;
}
