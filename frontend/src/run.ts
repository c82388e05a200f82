// A run as the page knows it: header, arrays, and the rows of its tables by agent and time step.

import { inflate, unpack, type Values } from "./arrays";
import type { Entry, RunHeader } from "./contract";

export interface Pose {
  x: number;
  y: number;
  orientation: number;
  velocity: number;
}

/** First and last row (excluded) of a table. */
export type Rows = [number, number];

/** A plan that an agent has received: its sender's row, its age in time steps, and whether the last message was lost. */
export interface Link {
  sender: number;
  age: number;
  lost: boolean;
}

/** A place at which an agent holds for another one (row -1: its own way is blocked). */
export interface Bar {
  holding: number;
  going: number;
  x: number;
  y: number;
  heading: number;
}

const NONE: Rows = [0, 0];

export class Run {
  readonly n: number;
  readonly steps: number;
  /** Of times [s]: enough to tell time steps apart. */
  readonly decimals: number;
  private readonly tables: Record<string, Values> = {};
  private readonly planAt = new Map<number, number>();
  private readonly candidatesAt = new Map<number, Rows>();
  private readonly predictionsAt = new Map<number, Rows>();

  private constructor(
    readonly header: RunHeader,
    private readonly bytes: Uint8Array,
  ) {
    this.n = header.participants.length;
    this.steps = header.n_steps;
    this.decimals = [1, 2].find((n) => Number.isInteger(+(header.dt * 10 ** n).toFixed(6))) ?? 3;
    this.index();
  }

  static async read(header: RunHeader, text: string): Promise<Run> {
    return new Run(header, await inflate(text));
  }

  /** An array, unpacked when it is first asked for; empty if the page has none of that name. */
  table(name: string): Values {
    let found = this.tables[name];
    if (found === undefined) {
      const entry = this.header.arrays[name];
      found = entry === undefined ? new Float32Array(0) : unpack(entry, this.bytes);
      this.tables[name] = found;
    }
    return found;
  }

  has(name: string): boolean {
    return name in this.header.arrays;
  }

  entry(name: string): Entry {
    return this.header.arrays[name];
  }

  /** Number of points per row of a table. */
  width(name: string): number {
    return this.entry(name)?.shape[1] ?? 0;
  }

  /** Time since the start of the scenario [s]. */
  seconds(step: number): number {
    return (this.header.first_time_step + step) * this.header.dt;
  }

  /** The same for people, with as many decimals as the length of a time step has. */
  time(step: number): string {
    return `${this.seconds(step).toFixed(this.decimals)} s`;
  }

  present(row: number, step: number): boolean {
    return this.table("valid")[row * this.steps + step] === 1;
  }

  /** Where a participant is at a time between steps; none while it is absent. */
  pose(row: number, time: number): Pose | undefined {
    const step = Math.min(this.steps - 1, Math.floor(time + 1e-6));
    if (step < 0 || !this.present(row, step)) return undefined;
    const i = row * this.steps + step;
    const part = step + 1 < this.steps && this.present(row, step + 1) ? Math.max(0, time - step) : 0;
    const at = (name: string) => {
      const table = this.table(name);
      return part > 0 ? table[i] + part * (table[i + 1] - table[i]) : table[i];
    };
    return { x: at("x"), y: at("y"), orientation: at("orientation"), velocity: at("velocity") };
  }

  /** Last state of a participant up to a time. */
  lastPose(row: number, time: number): Pose | undefined {
    for (let step = Math.min(this.steps - 1, Math.floor(time + 1e-6)); step >= 0; step--)
      if (this.present(row, step)) return this.pose(row, step);
    return undefined;
  }

  /** Values of a column of the states for one participant; null where absent. */
  series(name: string, row: number): (number | null)[] {
    const table = this.table(name);
    return Array.from({ length: this.steps }, (_, step) => {
      const value = table[row * this.steps + step];
      return this.present(row, step) && Number.isFinite(value) ? value : null;
    });
  }

  /** A measure of an agent at a time step; inf: no conflict, nan: cannot be computed. */
  measure(index: number, agent: number, step: number): number {
    const agents = this.entry("measure")?.shape[1] ?? 0;
    return this.table("measure")[(index * agents + agent) * this.steps + step] ?? NaN;
  }

  measurePartner(index: number, agent: number, step: number): number {
    const agents = this.entry("measure")?.shape[1] ?? 0;
    return this.table("measure_partner")[(index * agents + agent) * this.steps + step] ?? -1;
  }

  /** Row of the plan that an agent follows at a time step; -1 for none. */
  plan(row: number, step: number): number {
    if (!this.present(row, step) || step > (this.header.participants[row].end ?? -1)) return -1;
    for (let at = step; at >= 0 && at > step - 50; at--) {
      const found = this.planAt.get(row * this.steps + at);
      if (found !== undefined) return found;
    }
    return -1;
  }

  /** What an agent chose from at a time step, or before it if candidates are not kept at every one. */
  candidates(row: number, step: number): Rows {
    if (step > (this.header.participants[row].end ?? -1)) return NONE;
    const spacing = this.entry("candidate_step")?.spacing ?? 1;
    for (let at = step; at >= 0 && at > step - spacing; at--) {
      const found = this.candidatesAt.get(row * this.steps + at);
      if (found !== undefined) return found;
    }
    return NONE;
  }

  /** What an agent shows by its blinkers: 1 left, -1 right, 0 straight on at a fork; NaN for nothing. */
  turn(row: number, step: number): number {
    const plan = this.has("plan_turn") ? this.plan(row, step) : -1;
    return plan < 0 ? Number.NaN : this.table("plan_turn")[plan];
  }

  /** When an agent made the plan that it follows: the same step, or before it if it does not plan at every one. */
  madeAt(row: number, step: number): number {
    const plan = this.has("plan_made") ? this.plan(row, step) : -1;
    return plan < 0 ? step : this.table("plan_made")[plan];
  }

  /** The predictions of a time step for all participants. */
  predictions(step: number): Rows {
    return this.predictionsAt.get(step) ?? NONE;
  }

  /** Rows of the participants with which an agent is in conflict by any measure; undefined without measures. */
  partners(row: number, step: number): Set<number> | undefined {
    const { agent } = this.header.participants[row];
    if (agent < 0 || !this.header.measures.length) return undefined;
    const found = new Set(this.header.measures.map((_, index) => this.measurePartner(index, agent, step)));
    found.delete(-1);
    return found;
  }

  /** Rows of the participants that an agent sees; undefined if that was not recorded, as at its end, where it plans no more. */
  seen(row: number, step: number): Set<number> | undefined {
    if (!this.has("view_observer") || step >= (this.header.participants[row].end ?? Infinity)) return undefined;
    const found = new Set<number>();
    const [observer, seen, first, last] = ["observer", "seen", "first", "last"].map((n) => this.table(`view_${n}`));
    for (let i = 0; i < observer.length; i++) if (observer[i] === row && first[i] <= step && step <= last[i]) found.add(seen[i]);
    return found;
  }

  /** Plans that an agent has received, at a time step at which it drives. */
  links(row: number, step: number): Link[] {
    if (!this.has("link_rows") || step > (this.header.participants[row].end ?? -1)) return [];
    const [rows, age, lost] = ["rows", "age", "lost"].map((name) => this.table(`link_${name}`));
    const found: Link[] = [];
    for (let i = 0; 2 * i < rows.length; i++) {
      const at = i * this.steps + step;
      if (rows[2 * i] === row && age[at] > 0) found.push({ sender: rows[2 * i + 1], age: age[at], lost: lost[at] === 1 });
    }
    return found;
  }

  /** Where agents hold at a time step. */
  bars(step: number): Bar[] {
    if (!this.has("bar_rows")) return [];
    const [rows, steps, xy, heading] = ["rows", "steps", "xy", "heading"].map((name) => this.table(`bar_${name}`));
    const found: Bar[] = [];
    for (let i = 0; i < heading.length; i++)
      if (steps[2 * i] <= step && step <= steps[2 * i + 1])
        found.push({ holding: rows[2 * i], going: rows[2 * i + 1], x: xy[2 * i], y: xy[2 * i + 1], heading: heading[i] });
    return found;
  }

  private index(): void {
    const planRow = this.table("plan_participant");
    const planStep = this.table("plan_step");
    for (let i = 0; i < planRow.length; i++) this.planAt.set(planRow[i] * this.steps + planStep[i], i);
    const rows = this.table("candidate_participant");
    const steps = this.table("candidate_step");
    ranges(this.candidatesAt, rows.length, (i) => rows[i] * this.steps + steps[i]);
    const when = this.table("prediction_step");
    ranges(this.predictionsAt, when.length, (i) => when[i]);
  }
}

function ranges(into: Map<number, Rows>, count: number, key: (i: number) => number): void {
  let first = 0;
  for (let i = 1; i <= count; i++)
    if (i === count || key(i) !== key(first)) {
      into.set(key(first), [first, i]);
      first = i;
    }
}
