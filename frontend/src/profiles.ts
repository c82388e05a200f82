// Velocity, acceleration and criticality of one participant over time, with a cursor tied to the player.

import uPlot from "uplot";
import { agentColor, PALETTES } from "./colors";
import { element, text } from "./elements";
import type { Run } from "./run";
import type { State } from "./state";

type Column = (number | null)[];

interface Chart {
  root: HTMLElement;
  plot: HTMLElement;
  value: HTMLElement;
  unit: string;
  digits: number;
  series: () => Column;
  /** Lines to compare with. */
  levels: () => number[];
  /** As far up as matters. */
  cap?: () => number;
  /** Half of the least range of the axis. */
  least?: number;
  u?: uPlot;
  line?: HTMLElement;
  /** Time step below the pointer. */
  hovered?: number;
}

/** Recorded columns of the states besides the velocity. */
const COLUMNS = [
  { name: "acceleration", title: "acceleration", unit: "m/s²" },
  { name: "yaw_rate", title: "yaw rate", unit: "rad/s" },
  { name: "orientation", title: "orientation", unit: "rad" },
  { name: "x", title: "x", unit: "m" },
  { name: "y", title: "y", unit: "m" },
];

/** In narrower charts the value is below its name [rem of 14 px]. */
const NARROW = 19;

export class Profiles {
  readonly root = element("div", { class: "profiles" });
  private readonly measures = element("select", { title: "Criticality measure", "aria-label": "Criticality measure" });
  private readonly columns = element("select", { title: "Recorded column", "aria-label": "Recorded column" });
  private readonly charts: Chart[];
  private readonly times: number[];
  private shown = "";
  private planOf = -2;

  constructor(
    private readonly run: Run,
    private readonly state: State,
  ) {
    this.times = Array.from({ length: run.steps }, (_, step) => run.seconds(step));
    this.measures.append(...run.header.measures.map(({ title }, i) => element("option", { value: String(i) }, title)));
    this.measures.value = String(
      Math.max(
        0,
        run.header.measures.findIndex((m) => m.name === "ttc"),
      ),
    );
    this.measures.addEventListener("change", () => {
      this.shown = "";
      state.changed();
    });
    this.charts = [
      this.chart(element("span", {}, "velocity"), "m/s", 1, () => run.series("velocity", state.selected)),
      this.chart(this.columns, "", 2, () => this.recorded()),
    ];
    this.columns.append(...COLUMNS.map(({ title }, i) => element("option", { value: String(i) }, title)));
    this.columns.addEventListener("change", () => {
      this.shown = "";
      state.changed();
    });
    this.charts[0].least = 2;
    this.charts[1].least = 1;
    if (run.header.measures.length) {
      const chart = this.chart(this.measures, "", 2, () => this.criticality());
      chart.levels = () => (this.measure.level === null ? [] : [this.measure.level]);
      chart.cap = () => this.measure.cap ?? Infinity;
      this.charts.push(chart);
    }
    new ResizeObserver(() => this.resize()).observe(this.root);
  }

  draw(): void {
    const { state } = this;
    const key = [state.selected, this.columns.value, this.measures.value, state.theme, state.zoom].join();
    if (state.selected < 0) return;
    if (key !== this.shown) {
      this.shown = key;
      this.arrange();
      for (const chart of this.charts) this.build(chart);
    }
    this.drawPlan();
    for (const chart of this.charts) {
      this.placeLine(chart);
      this.say(chart);
    }
  }

  /** A chart knows its scales only when it has drawn itself: it calls this then, too. */
  private placeLine(chart: Chart): void {
    const time = this.run.seconds(0) + this.state.time * this.run.header.dt;
    const at = chart.u?.valToPos(time, "x") ?? NaN;
    if (chart.line !== undefined && Number.isFinite(at)) chart.line.style.transform = `translateX(${at}px)`;
  }

  private recorded(): Column {
    const { name } = this.column;
    const shift = name === "x" || name === "y" ? this.run.header.origin[name === "x" ? 0 : 1] : 0;
    return this.run.series(name, this.state.selected).map((value) => (value === null ? null : value + shift));
  }

  private get column() {
    return COLUMNS[Number(this.columns.value)];
  }

  private get measure() {
    return this.run.header.measures[Number(this.measures.value)];
  }

  private criticality(): Column {
    const agent = this.run.header.participants[this.state.selected].agent;
    return this.times.map((_, step) => {
      const value = agent < 0 ? NaN : this.run.measure(Number(this.measures.value), agent, step);
      return Number.isFinite(value) ? value : null;
    });
  }

  private valueOf(chart: Chart, step = this.state.step): string {
    const { selected } = this.state;
    const agent = this.run.header.participants[selected].agent;
    if (chart.levels().length || chart.cap) {
      if (agent < 0) return "of agents only";
      const index = Number(this.measures.value);
      const value = this.run.measure(index, agent, step);
      const partner = this.run.header.participants[this.run.measurePartner(index, agent, step)];
      if (Number.isNaN(value)) return "–";
      if (!Number.isFinite(value)) return "no conflict";
      const { unit, horizon } = this.measure;
      return `${text(value, 2, unit, horizon ?? Infinity)}${partner ? ` with ${partner.id}` : ""}`;
    }
    const unit = chart === this.charts[1] ? this.column.unit : chart.unit;
    return text(chart.series()[step], chart.digits, unit) || "–";
  }

  private chart(name: HTMLElement, unit: string, digits: number, series: () => Column): Chart {
    const value = element("span", { class: "value" });
    const plot = element("div", { class: "plot" });
    const root = element("section", { class: "profile" }, element("header", {}, name, value), plot);
    this.root.append(root);
    return { root, plot, value, unit, digits, series, levels: () => [] };
  }

  private build(chart: Chart): void {
    chart.u?.destroy();
    chart.plot.replaceChildren();
    this.planOf = -2;
    const { state, run } = this;
    const colors = PALETTES[state.theme];
    const color = agentColor(run.header.participants[state.selected].color, state.theme);
    const font = `${Math.round(11 * state.zoom)}px system-ui, sans-serif`;
    const axis = {
      stroke: colors.ink,
      font,
      grid: { stroke: colors.grid, width: 1 },
      ticks: { stroke: colors.grid, width: 1, size: 4 },
    };
    const options: uPlot.Options = {
      width: Math.max(chart.plot.clientWidth, 120),
      height: Math.max(chart.plot.clientHeight, 80),
      padding: [4, 18 * state.zoom, 0, 0],
      legend: { show: false },
      cursor: { show: false },
      scales: { x: { time: false }, y: { range: (_u, low, high) => this.range(chart, low, high) } },
      axes: [
        { ...axis, size: 22 * state.zoom, gap: 2, space: 50, values: (_u, ticks) => ticks.map((t) => `${+t.toFixed(2)} s`) },
        { ...axis, size: 40 * state.zoom, gap: 3, space: 20 },
      ],
      series: [
        {},
        {
          stroke: color === colors.traffic ? colors.ink : color,
          width: 2 * state.zoom,
          points: { show: false, size: 6 * state.zoom, filter: alone },
        },
        { stroke: colors.ink, width: 1.4 * state.zoom, dash: [4, 3], spanGaps: true, points: { show: false } },
      ],
      hooks: {
        drawClear: [(u) => drawLevels(u, chart.levels(), colors.ink)],
        draw: [() => this.placeLine(chart)],
      },
    };
    const empty: Column = this.times.map(() => null);
    chart.u = new uPlot(options, [this.times, chart.series(), empty] as uPlot.AlignedData, chart.plot);
    chart.line = element("div", { class: "cursor-line" });
    chart.u.over.append(chart.line);
    this.seekOn(chart, chart.u);
  }

  /** What the current plan intends, in the chart of velocities. */
  private drawPlan(): void {
    const { run, state } = this;
    const chart = this.charts[0];
    const plan = run.has("plan_velocity") && state.layers.plan ? run.plan(state.selected, state.step) : -1;
    if (plan === this.planOf || chart.u === undefined) return;
    this.planOf = plan;
    const intended: Column = this.times.map(() => null);
    if (plan >= 0) {
      const width = run.width("plan_velocity");
      const spacing = run.entry("plan_step").spacing ?? 1;
      const [start, values] = [run.table("plan_step")[plan], run.table("plan_velocity")];
      for (let i = 0; i < width; i++) {
        const at = start + i * spacing;
        const value = values[plan * width + i];
        if (at < intended.length && Number.isFinite(value)) intended[at] = value;
      }
    }
    chart.u.setData([this.times, chart.series(), intended] as uPlot.AlignedData, true);
  }

  private range(chart: Chart, low: number | null, high: number | null): [number, number] {
    const values = chart.series().filter((v): v is number => v !== null);
    const levels = chart.levels();
    if (!values.length && levels.length) return [0, 2 * Math.max(...levels)];
    let [bottom, top] = [Math.min(...values, ...levels), Math.max(...values, ...levels)];
    if (!Number.isFinite(bottom)) return [low ?? 0, high ?? 1];
    top = Math.min(top, Math.max(chart.cap?.() ?? Infinity, bottom));
    // What hardly changes is no drama.
    const half = Math.max(0.55 * (top - bottom), chart.least ?? 0.5);
    const middle = 0.5 * (top + bottom);
    return bottom >= 0 ? [Math.max(middle - half, -0.05 * (middle + half)), middle + half] : [middle - half, middle + half];
  }

  /** The value now, or at the time below the pointer. */
  private say(chart: Chart): void {
    const at = chart.hovered;
    chart.value.textContent = at === undefined ? this.valueOf(chart) : `${this.run.time(at)}: ${this.valueOf(chart, at)}`;
  }

  private seekOn(chart: Chart, u: uPlot): void {
    const seek = (event: PointerEvent) => {
      const time = u.posToVal(event.clientX - u.over.getBoundingClientRect().left, "x");
      this.state.playing = false;
      this.state.seek(Math.round(time / this.run.header.dt) - this.run.header.first_time_step);
    };
    u.over.addEventListener("pointerdown", (event) => {
      u.over.setPointerCapture(event.pointerId);
      seek(event);
    });
    u.over.addEventListener("pointermove", (event) => {
      if (event.buttons & 1) seek(event);
      const time = u.posToVal(event.clientX - u.over.getBoundingClientRect().left, "x");
      const step = Math.round(time / this.run.header.dt) - this.run.header.first_time_step;
      chart.hovered = Math.min(this.run.steps - 1, Math.max(0, step));
      this.say(chart);
    });
    u.over.addEventListener("pointerleave", () => {
      chart.hovered = undefined;
      this.say(chart);
    });
  }

  /** By width and not by what is written, so that nothing moves while the player plays. */
  private arrange(): void {
    this.root.classList.toggle("narrow", this.charts[0].root.clientWidth < NARROW * 14 * this.state.zoom);
  }

  private resize(): void {
    this.arrange();
    for (const chart of this.charts)
      if (chart.u !== undefined && chart.plot.clientWidth > 0)
        chart.u.setSize({ width: chart.plot.clientWidth, height: chart.plot.clientHeight });
    this.state.changed();
  }
}

/** Values without a neighbour, which no line would show. */
function alone(u: uPlot, series: number): number[] {
  const values = u.data[series];
  return Array.from(values.keys()).filter((i) => values[i] != null && values[i - 1] == null && values[i + 1] == null);
}

function drawLevels(u: uPlot, levels: number[], color: string): void {
  const { ctx, bbox } = u;
  ctx.save();
  ctx.strokeStyle = color;
  ctx.globalAlpha = 0.6;
  ctx.setLineDash([6, 4]);
  for (const level of levels) {
    const y = u.valToPos(level, "y", true);
    if (y < bbox.top || y > bbox.top + bbox.height) continue;
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
  }
  ctx.restore();
}
