// All participants at one time, with the plan, candidates and predictions of the selected agent.

import type { Camera } from "./camera";
import { agentColor, costColor, PALETTES } from "./colors";
import { BLINKER, SIGNAL_COLORS } from "./contract";
import { drawMark } from "./marks";
import type { Pose, Run } from "./run";
import type { State } from "./state";

/** An ellipse that holds 95 % of a normal distribution. */
const ELLIPSE = Math.sqrt(-2 * Math.log(0.05));

/** Larger ellipses say nothing: half of their longer axis [m]. */
const ELLIPSE_MAX = 8;

/** A plan of this age is as pale as it gets [s]. */
const AGE_PALE = 1.5;

/** Length of a bar before which an agent holds [m]. */
const BAR = 3.5;

/** Outcomes that stay in sight. */
const LOUD = new Set(["collision", "planner_error", "infeasible"]);

/** Bodies are drawn at least so long [px]. */
const LENGTH_MIN = 9;

export class Traffic {
  private readonly bodies: Path2D[];
  private readonly noses: Path2D[];

  constructor(private readonly run: Run) {
    this.bodies = run.header.participants.map((p) => {
      const path = new Path2D();
      if (p.outlines === undefined) path.rect(-p.length / 2, -p.width / 2, p.length, p.width);
      else
        for (const line of p.outlines) {
          path.moveTo(line[0][0], line[0][1]);
          for (const [x, y] of line.slice(1)) path.lineTo(x, y);
          path.closePath();
        }
      return path;
    });
    this.noses = run.header.participants.map((p) => {
      const path = new Path2D();
      path.moveTo(0.44 * p.length, 0);
      path.lineTo(0.12 * p.length, 0.36 * p.width);
      path.lineTo(0.12 * p.length, -0.36 * p.width);
      path.closePath();
      return path;
    });
  }

  draw(ctx: CanvasRenderingContext2D, camera: Camera, ratio: number, state: State): void {
    ctx.setTransform(1, 0, 0, 1, 0, 0);
    ctx.clearRect(0, 0, ctx.canvas.width, ctx.canvas.height);
    const { selected, layers } = state;
    const agent = selected >= 0 && this.run.header.participants[selected].agent >= 0;
    const here = agent && this.run.present(selected, state.step);
    const seen = here ? this.run.seen(selected, state.step) : undefined;
    this.drawStopLines(ctx, camera, ratio, state);
    if (agent) {
      this.drawGoal(ctx, camera, ratio, state);
      if (layers.sight) this.drawSight(ctx, camera, ratio, state);
      if (layers.predictions) this.drawPredictions(ctx, camera, ratio, state);
      if (layers.candidates) this.drawCandidates(ctx, camera, ratio, state);
    }
    if (layers.links) this.drawLinks(ctx, camera, ratio, state, here);
    this.drawBodies(ctx, camera, ratio, state, layers.sight ? seen : undefined);
    if (layers.plan) this.drawPlans(ctx, camera, ratio, state);
    this.drawOutcomes(ctx, camera, ratio, state);
    if (layers.labels) this.drawLabels(ctx, camera, ratio, state);
  }

  /** The participant that is nearest to a place on the screen; -1 for none near by. */
  at(camera: Camera, state: State, px: number, py: number): number {
    let best = -1;
    let nearest = Infinity;
    this.run.header.participants.forEach((p, row) => {
      const pose = this.shown(row, state);
      if (pose === undefined) return;
      const [x, y] = camera.toScreen(pose.x, pose.y);
      const distance = Math.hypot(px - x, py - y) - (p.agent >= 0 ? 3 : 0);
      if (distance < Math.max(14, 0.5 * p.length * camera.scale) && distance < nearest) {
        nearest = distance;
        best = row;
      }
    });
    return best;
  }

  /** Where a participant is drawn: agents that are done stay where they ended. */
  private shown(row: number, state: State): Pose | undefined {
    const { agent, end } = this.run.header.participants[row];
    const pose = this.run.pose(row, state.time);
    if (pose !== undefined || agent < 0 || state.step < (end ?? Infinity)) return pose;
    return this.run.lastPose(row, state.time);
  }

  /** Stop lines in the colours that their lights show now. */
  private drawStopLines(ctx: CanvasRenderingContext2D, camera: Camera, ratio: number, state: State): void {
    if (!this.run.has("stop_line_xy")) return;
    const xy = this.run.table("stop_line_xy");
    const signal = this.run.table("stop_line_signal");
    camera.worldTransform(ctx, ratio);
    ctx.lineCap = "butt";
    ctx.lineWidth = Math.max(0.5, 3 / camera.scale);
    for (let i = 0; i < xy.length / 4; i++) {
      ctx.strokeStyle = SIGNAL_COLORS[signal[i * this.run.steps + state.step]];
      ctx.beginPath();
      ctx.moveTo(xy[4 * i], xy[4 * i + 1]);
      ctx.lineTo(xy[4 * i + 2], xy[4 * i + 3]);
      ctx.stroke();
    }
    ctx.setTransform(1, 0, 0, 1, 0, 0);
  }

  private drawBodies(ctx: CanvasRenderingContext2D, camera: Camera, ratio: number, state: State, seen?: Set<number>): void {
    const colors = PALETTES[state.theme];
    const order = this.run.header.participants.map((_, row) => row);
    order.sort((a, b) => this.rank(a, state) - this.rank(b, state));
    for (const row of order) {
      const p = this.run.header.participants[row];
      const pose = this.run.pose(row, state.time);
      if (pose === undefined) continue;
      const factor = Math.max(1, LENGTH_MIN / (Math.max(p.length, 0.5) * camera.scale));
      camera.bodyTransform(ctx, ratio, pose.x, pose.y, pose.orientation, factor);
      const pixel = 1 / (camera.scale * factor);
      const hidden = seen !== undefined && row !== state.selected && !seen.has(row) && !p.static;
      ctx.globalAlpha = hidden ? 0.4 : 1;
      ctx.fillStyle = p.agent >= 0 ? agentColor(p.color, state.theme) : p.static ? colors.static : colors.traffic;
      ctx.fill(this.bodies[row]);
      ctx.strokeStyle = row === state.selected ? colors.ink : colors.outline;
      ctx.lineWidth = (row === state.selected ? 2.6 : 0.8) * state.zoom * pixel;
      ctx.stroke(this.bodies[row]);
      if (!p.static && p.outlines === undefined) {
        ctx.fillStyle = colors.nose;
        ctx.fill(this.noses[row]);
      }
      this.drawBlinkers(ctx, row, state);
      ctx.globalAlpha = 1;
      if (row === state.selected) {
        ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
        const [x, y] = camera.toScreen(pose.x, pose.y);
        ctx.beginPath();
        ctx.arc(x, y, Math.max(0.72 * p.length * camera.scale * factor, 14), 0, 2 * Math.PI);
        ctx.lineWidth = 2 * state.zoom;
        ctx.stroke();
      }
    }
  }

  /** The blinkers at both corners of the side that an agent shows. */
  private drawBlinkers(ctx: CanvasRenderingContext2D, row: number, state: State): void {
    const side = this.run.turn(row, state.step);
    if (Math.abs(side) !== 1) return;
    const { length, width } = this.run.header.participants[row];
    ctx.fillStyle = BLINKER;
    // They stand out beyond the body, so that they are seen from afar.
    for (const end of [-0.5, 0.35]) ctx.fillRect(end * length, (side > 0 ? 0.25 : -0.7) * width, 0.15 * length, 0.45 * width);
  }

  private rank(row: number, state: State): number {
    const p = this.run.header.participants[row];
    return row === state.selected ? 3 : p.agent >= 0 ? 2 : p.static ? 0 : 1;
  }

  private drawPlans(ctx: CanvasRenderingContext2D, camera: Camera, ratio: number, state: State): void {
    if (!this.run.has("plan_x")) return;
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.lineJoin = "round";
    ctx.lineCap = "round";
    this.run.header.participants.forEach((p, row) => {
      if (p.agent < 0) return;
      const plan = this.run.plan(row, state.step);
      if (plan < 0) return;
      const selected = row === state.selected;
      const colors = PALETTES[state.theme];
      this.trace(ctx, camera, "plan", plan);
      if (selected) {
        ctx.strokeStyle = colors.halo;
        ctx.lineWidth = 6 * state.zoom;
        ctx.stroke();
      }
      const color = agentColor(p.color, state.theme);
      ctx.strokeStyle = color;
      ctx.globalAlpha = selected || state.selected < 0 ? 0.95 : 0.45;
      ctx.lineWidth = (selected ? 3.2 : 1.6) * state.zoom;
      ctx.stroke();
      ctx.globalAlpha = 1;
      if (selected) this.dots(ctx, camera, "plan", plan, color, 2.6 * state.zoom);
    });
  }

  private drawCandidates(ctx: CanvasRenderingContext2D, camera: Camera, ratio: number, state: State): void {
    const [first, last] = this.run.candidates(state.selected, state.step);
    if (first === last) return;
    const cost = this.run.table("candidate_cost");
    const reason = this.run.table("candidate_reason");
    const range = costRange(this.run, first, last);
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.lineCap = "round";
    // The cheapest on top, rejected ones below all others.
    const order = Array.from({ length: last - first }, (_, i) => first + i);
    const key = (i: number) => (reason[i] !== 0 ? Infinity : Number.isNaN(cost[i]) ? 1e30 : cost[i]);
    order.sort((a, b) => key(b) - key(a));
    for (const i of order) {
      this.trace(ctx, camera, "candidate", i);
      if (reason[i] !== 0 || range === undefined || Number.isNaN(cost[i])) {
        ctx.setLineDash([3, 4]);
        ctx.strokeStyle = PALETTES[state.theme].rejected;
        ctx.lineWidth = state.zoom;
      } else {
        ctx.setLineDash([]);
        ctx.strokeStyle = costColor((cost[i] - range[0]) / Math.max(range[1] - range[0], 1e-9), state.theme);
        ctx.lineWidth = 1.5 * state.zoom;
      }
      ctx.stroke();
    }
    ctx.setLineDash([]);
  }

  private drawPredictions(ctx: CanvasRenderingContext2D, camera: Camera, ratio: number, state: State): void {
    // The predictions with which it planned, when it planned.
    const made = this.run.madeAt(state.selected, state.step);
    const [first, last] = this.run.predictions(made);
    if (first === last || this.run.pose(state.selected, state.step) === undefined) return;
    const seen = this.run.seen(state.selected, made);
    const partners = state.layers.all ? undefined : this.run.partners(state.selected, made);
    const color = PALETTES[state.theme].prediction;
    const participant = this.run.table("prediction_participant");
    const probability = this.run.table("prediction_probability");
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.lineCap = "round";
    ctx.strokeStyle = color;
    ctx.fillStyle = color;
    for (let i = first; i < last; i++) {
      if (participant[i] === state.selected || partners?.has(participant[i]) === false) continue;
      if (!(seen === undefined ? this.inRange(participant[i], state.selected, made) : seen.has(participant[i]))) continue;
      ctx.lineWidth = 0.8 * state.zoom;
      this.ellipses(ctx, camera, i, probability[i]);
      ctx.globalAlpha = 0.2 + 0.75 * probability[i];
      ctx.lineWidth = (0.6 + 1.6 * probability[i]) * state.zoom;
      this.trace(ctx, camera, "prediction", i, participant[i], made);
      ctx.stroke();
    }
    ctx.globalAlpha = 1;
  }

  private inRange(row: number, agent: number, step: number): boolean {
    const radius = this.run.header.participants[agent].sensor_radius ?? Infinity;
    const [a, b] = [this.run.pose(agent, step), this.run.pose(row, step)];
    return a !== undefined && b !== undefined && Math.hypot(a.x - b.x, a.y - b.y) <= radius;
  }

  private ellipses(ctx: CanvasRenderingContext2D, camera: Camera, row: number, probability: number): void {
    const width = this.run.width("prediction_x");
    const at = (name: string) => this.run.table(`prediction_${name}`);
    const [x, y, sx, sy, r] = ["x", "y", "sx", "sy", "correlation"].map(at);
    for (let i = row * width; i < (row + 1) * width; i++) {
      if (!Number.isFinite(x[i]) || !Number.isFinite(sx[i])) continue;
      const [a, b, c] = [sx[i] ** 2, r[i] * sx[i] * sy[i], sy[i] ** 2];
      const half = Math.hypot((a - c) / 2, b);
      const angle = 0.5 * Math.atan2(2 * b, a - c);
      const long = Math.sqrt(Math.max(0, (a + c) / 2 + half));
      if (ELLIPSE * long > ELLIPSE_MAX) break;
      const short = Math.sqrt(Math.max(0, (a + c) / 2 - half));
      const [px, py] = camera.toScreen(x[i], y[i]);
      const s = ELLIPSE * camera.scale;
      ctx.beginPath();
      ctx.ellipse(px, py, Math.max(s * long, 0.5), Math.max(s * short, 0.5), camera.angle - angle, 0, 2 * Math.PI);
      // Fills of many vehicles add up: outlines tell them apart.
      ctx.globalAlpha = 0.07 * probability;
      ctx.fill();
      ctx.globalAlpha = 0.08 + 0.6 * probability;
      ctx.stroke();
    }
  }

  private drawSight(ctx: CanvasRenderingContext2D, camera: Camera, ratio: number, state: State): void {
    const radius = this.run.header.participants[state.selected].sensor_radius;
    const pose = this.run.pose(state.selected, state.time);
    if (pose === undefined || radius === null || radius === undefined) return;
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    const [x, y] = camera.toScreen(pose.x, pose.y);
    ctx.beginPath();
    ctx.arc(x, y, radius * camera.scale, 0, 2 * Math.PI);
    ctx.strokeStyle = PALETTES[state.theme].radius;
    ctx.lineWidth = 1.2 * state.zoom;
    ctx.setLineDash([7, 6]);
    ctx.stroke();
    ctx.setLineDash([]);
  }

  /** Bars before which agents hold; lines to the agents whose plans the selected one has received, paler with their age. */
  private drawLinks(ctx: CanvasRenderingContext2D, camera: Camera, ratio: number, state: State, here: boolean): void {
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.strokeStyle = PALETTES[state.theme].goal;
    const own = here ? this.run.pose(state.selected, state.time) : undefined;
    for (const { sender, age, lost } of own === undefined ? [] : this.run.links(state.selected, state.step)) {
      const other = this.run.pose(sender, state.time);
      if (other === undefined) continue;
      ctx.globalAlpha = Math.max(0.2, 0.9 - (0.7 * age * this.run.header.dt) / AGE_PALE);
      ctx.lineWidth = 1.2 * state.zoom;
      ctx.setLineDash(lost ? [4, 4] : []);
      ctx.beginPath();
      ctx.moveTo(...camera.toScreen(own!.x, own!.y));
      ctx.lineTo(...camera.toScreen(other.x, other.y));
      ctx.stroke();
    }
    ctx.setLineDash([]);
    ctx.globalAlpha = 1;
    for (const { holding, x, y, heading } of this.run.bars(state.step)) {
      const [u, v] = [-Math.sin(heading) * 0.5 * BAR, Math.cos(heading) * 0.5 * BAR];
      ctx.strokeStyle = agentColor(this.run.header.participants[holding].color, state.theme);
      ctx.lineWidth = (holding === state.selected ? 6 : 4) * state.zoom;
      ctx.beginPath();
      ctx.moveTo(...camera.toScreen(x - u, y - v));
      ctx.lineTo(...camera.toScreen(x + u, y + v));
      ctx.stroke();
    }
  }

  private drawGoal(ctx: CanvasRenderingContext2D, camera: Camera, ratio: number, state: State): void {
    const color = PALETTES[state.theme].goal;
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    for (const line of this.run.header.participants[state.selected].goal ?? []) {
      ctx.beginPath();
      line.forEach(([x, y], i) => {
        const [px, py] = camera.toScreen(x, y);
        if (i) ctx.lineTo(px, py);
        else ctx.moveTo(px, py);
      });
      ctx.closePath();
      ctx.fillStyle = color;
      ctx.globalAlpha = 0.14;
      ctx.fill();
      ctx.globalAlpha = 1;
      ctx.strokeStyle = color;
      ctx.lineWidth = 1.4 * state.zoom;
      ctx.setLineDash([5, 3]);
      ctx.stroke();
      ctx.setLineDash([]);
    }
  }

  /** Agents that are done leave the marker of their outcome. */
  private drawOutcomes(ctx: CanvasRenderingContext2D, camera: Camera, ratio: number, state: State): void {
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.run.header.participants.forEach((p, row) => {
      if (p.agent < 0 || p.outcome === undefined || state.step < (p.end ?? Infinity)) return;
      const pose = this.run.lastPose(row, state.time);
      if (pose === undefined) return;
      const [x, y] = camera.toScreen(pose.x, pose.y);
      const loud = LOUD.has(p.outcome);
      const faded = this.faded(row, state) && row !== state.selected;
      ctx.globalAlpha = faded ? 0.55 : 1;
      drawMark(ctx, p.outcome, x, y, (loud ? 9 : faded ? 4.5 : 6.5) * state.zoom, PALETTES[state.theme].ink);
      ctx.globalAlpha = 1;
    });
  }

  /** Agents that arrived are forgotten after a while; what went wrong stays. */
  private faded(row: number, state: State): boolean {
    const { agent, end, outcome } = this.run.header.participants[row];
    return agent >= 0 && !LOUD.has(outcome ?? "") && state.time - (end ?? Infinity) > 2 / this.run.header.dt;
  }

  private drawLabels(ctx: CanvasRenderingContext2D, camera: Camera, ratio: number, state: State): void {
    const colors = PALETTES[state.theme];
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.textAlign = "center";
    ctx.textBaseline = "bottom";
    ctx.lineJoin = "round";
    this.run.header.participants.forEach((p, row) => {
      if (p.agent < 0 && row !== state.selected) return;
      const pose = this.shown(row, state);
      const chosen = row === state.selected;
      if (pose === undefined || (!chosen && this.faded(row, state))) return;
      const [x, y] = camera.toScreen(pose.x, pose.y);
      const rise = Math.max(0.5 * p.width * camera.scale, 5) + 4;
      ctx.font = `${chosen ? 700 : 500} ${Math.round((chosen ? 13 : 11) * state.zoom)}px system-ui, sans-serif`;
      ctx.globalAlpha = this.run.present(row, state.step) ? 1 : 0.6;
      ctx.strokeStyle = colors.halo;
      ctx.lineWidth = 3;
      ctx.strokeText(String(p.id), x, y - rise);
      ctx.fillStyle = colors.ink;
      ctx.fillText(String(p.id), x, y - rise);
      ctx.globalAlpha = 1;
    });
  }

  /** Begins a path along a row of a table; predictions start where the participant is. */
  private trace(ctx: CanvasRenderingContext2D, camera: Camera, name: string, row: number, from = -1, step = 0): void {
    const width = this.run.width(`${name}_x`);
    const [x, y] = [this.run.table(`${name}_x`), this.run.table(`${name}_y`)];
    ctx.beginPath();
    let begun = false;
    const to = (u: number, v: number) => {
      const [px, py] = camera.toScreen(u, v);
      if (begun) ctx.lineTo(px, py);
      else ctx.moveTo(px, py);
      begun = true;
    };
    if (from >= 0) {
      const pose = this.run.pose(from, step);
      if (pose !== undefined) to(pose.x, pose.y);
    }
    for (let i = row * width; i < (row + 1) * width; i++) if (Number.isFinite(x[i])) to(x[i], y[i]);
  }

  private dots(ctx: CanvasRenderingContext2D, camera: Camera, name: string, row: number, color: string, size: number): void {
    const width = this.run.width(`${name}_x`);
    const [x, y] = [this.run.table(`${name}_x`), this.run.table(`${name}_y`)];
    ctx.fillStyle = color;
    for (let i = row * width + 1; i < (row + 1) * width; i++) {
      if (!Number.isFinite(x[i])) continue;
      const [px, py] = camera.toScreen(x[i], y[i]);
      ctx.beginPath();
      ctx.arc(px, py, size, 0, 2 * Math.PI);
      ctx.fill();
    }
  }
}

/** Lowest cost and nearly the highest one among candidates that were not rejected. */
export function costRange(run: Run, first: number, last: number): [number, number] | undefined {
  const [cost, reason] = [run.table("candidate_cost"), run.table("candidate_reason")];
  const found: number[] = [];
  for (let i = first; i < last; i++) if (reason[i] === 0 && Number.isFinite(cost[i])) found.push(cost[i]);
  if (!found.length) return undefined;
  found.sort((a, b) => a - b);
  return [found[0], found[Math.floor(0.9 * (found.length - 1))]];
}
