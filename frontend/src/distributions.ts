// Which share of agents has a value of at most so much, per planner.

import uPlot from "uplot";
import type { Values } from "./arrays";
import { agentColor, PALETTES, type Theme } from "./colors";
import { AGENTS, type BatchHeader, type Part } from "./contract";
import { element } from "./elements";

const DASHES: number[][] = [[], [7, 3], [2, 2], [9, 3, 2, 3]];

/** Values above this share of agents are cut off: single ones would press the rest together. */
const CUT = 0.99;

export class Distributions {
  readonly root = element("div", { class: "distributions" });
  private plots: { u: uPlot; place: HTMLElement }[] = [];

  constructor(
    private readonly header: BatchHeader,
    private readonly tables: Record<string, Values>,
  ) {}

  draw(inside: (part: Part) => boolean, theme: Theme, zoom: number): void {
    for (const { u } of this.plots) u.destroy();
    this.plots = [];
    const legend = element("div", { class: "chips legend" });
    const wanted = this.header.parts.map(inside);
    const { variant: variants, part: parts } = this.tables;
    const there = new Set(Array.from(variants).filter((_, i) => wanted[parts[i]]));
    this.header.variants.forEach((name, i) => {
      if (!there.has(i)) return;
      const swatch = element("span", { class: "line" });
      swatch.style.borderTop = `3px ${DASHES[i % 4].length ? "dashed" : "solid"} ${agentColor(AGENTS[i % AGENTS.length], theme)}`;
      legend.append(element("span", {}, swatch, name));
    });
    const grid = element("div", { class: "grid" });
    this.root.replaceChildren(legend, grid);
    this.root.hidden = there.size === 0;
    for (const { name, title, unit, cap } of this.header.drawn) {
      const curves = this.header.variants.map((_, variant) => this.curve(name, variant, wanted));
      if (curves.every((curve) => curve.values.length === 0)) continue;
      const place = element("div", { class: "plot" });
      grid.append(
        element("section", { class: "profile" }, element("header", {}, element("span", {}, `${title}${unit ? ` [${unit}]` : ""}`)), place),
      );
      this.plots.push({ u: plot(place, curves, cap ?? Infinity, theme, zoom), place });
    }
    this.resize();
  }

  resize(): void {
    for (const { u, place } of this.plots) if (place.clientWidth > 0) u.setSize({ width: place.clientWidth, height: place.clientHeight });
  }

  /** Finite values of a planner's agents, ascending, and how many agents there are with infinite ones. */
  private curve(name: string, variant: number, wanted: boolean[]): { values: number[]; total: number } {
    const [all, variants, parts] = [this.tables[name], this.tables.variant, this.tables.part];
    const values: number[] = [];
    let total = 0;
    for (let i = 0; i < variants.length; i++) {
      if (variants[i] !== variant || !wanted[parts[i]] || Number.isNaN(all[i])) continue;
      total += 1;
      if (Number.isFinite(all[i])) values.push(all[i]);
    }
    return { values: values.sort((a, b) => a - b), total };
  }
}

function plot(place: HTMLElement, curves: { values: number[]; total: number }[], limit: number, theme: Theme, zoom: number): uPlot {
  const colors = PALETTES[theme];
  const cut = Math.min(limit, Math.max(...curves.map(({ values }) => values[Math.floor(CUT * (values.length - 1))] ?? -Infinity)));
  const low = Math.min(0, ...curves.map(({ values }) => values[0] ?? 0));
  const x = [...new Set([low, ...curves.flatMap(({ values }) => values.filter((v) => v <= cut)), cut])].sort((a, b) => a - b);
  const shares = curves.map(({ values, total }) => {
    let at = 0;
    return x.map((value) => {
      while (at < values.length && values[at] <= value) at += 1;
      return total ? (100 * at) / total : null;
    });
  });
  const font = `${Math.round(11 * zoom)}px system-ui, sans-serif`;
  const axis = { stroke: colors.ink, font, grid: { stroke: colors.grid, width: 1 }, ticks: { stroke: colors.grid, width: 1, size: 4 } };
  const series = curves.map((_, i) => ({
    stroke: agentColor(AGENTS[i % AGENTS.length], theme),
    width: 2 * zoom,
    dash: DASHES[i % 4],
    points: { show: false },
    paths: uPlot.paths.stepped!({ align: 1 }),
  }));
  return new uPlot(
    {
      width: Math.max(place.clientWidth, 200),
      height: Math.max(place.clientHeight, 120),
      padding: [6, 8, 0, 0],
      legend: { show: false },
      cursor: { show: false },
      scales: { x: { time: false }, y: { range: [0, 102] } },
      axes: [
        { ...axis, size: 22 * zoom, gap: 2 },
        { ...axis, size: 42 * zoom, gap: 3, values: (_u, ticks) => ticks.map((t) => `${t} %`) },
      ],
      series: [{}, ...series],
    },
    [x, ...shares] as uPlot.AlignedData,
    place,
  );
}
