// Markers of outcomes and events: shape and colour both tell them apart.

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
  [0.35, 0], [0.9, 0.55], [0.55, 0.9], [0, 0.35], [-0.55, 0.9], [-0.9, 0.55],
  [-0.35, 0], [-0.9, -0.55], [-0.55, -0.9], [0, -0.35], [0.55, -0.9], [0.9, -0.55],
];

const SQUARE: [number, number][] = [[0.78, 0.78], [-0.78, 0.78], [-0.78, -0.78], [0.78, -0.78]];

export const MARKS: Record<string, Mark> = {
  goal_reached: { text: "goal reached", color: "#009E73", corners: regular(20) },
  goal_reached_late: { text: "goal reached late", color: "#56B4E9", corners: regular(3) },
  time_limit: { text: "time limit", color: "#E69F00", corners: SQUARE },
  goal_missed: { text: "goal missed", color: "#CC79A7", corners: regular(4) },
  infeasible: { text: "no feasible plan", color: "#F0E442", corners: regular(3, -Math.PI / 2) },
  collision: { text: "collision", color: "#D55E00", corners: CROSS },
  planner_error: { text: "planner error", color: "#9a9a9a", corners: regular(5, Math.PI / 2, 0.42) },
  running: { text: "still running", color: "#ffffff", corners: regular(20) },
  emergency_braking: { text: "emergency plan", color: "#E69F00", corners: regular(8, Math.PI / 8) },
  infeasible_plan: { text: "no feasible plan found", color: "#F0E442", corners: regular(3, -Math.PI / 2) },
  critical: { text: "critical moment", color: "#CC79A7", corners: regular(4, Math.PI / 2, 0.35) },
};

export function mark(kind: string): Mark {
  return MARKS[kind] ?? MARKS.running;
}

/** A marker on a canvas, in pixels. */
export function drawMark(ctx: CanvasRenderingContext2D, kind: string, x: number, y: number, size: number, ink: string): void {
  const { color, corners } = mark(kind);
  ctx.beginPath();
  corners.forEach(([u, v], i) => (i ? ctx.lineTo(x + size * u, y - size * v) : ctx.moveTo(x + size * u, y - size * v)));
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
