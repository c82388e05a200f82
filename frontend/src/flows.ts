// Generated traffic by lane: a table, and flow, speed and queue of one lane over time.

import type { Flows, LaneTraffic } from "./contract";
import { button, dropEmptyColumns, element, NUMBER, text } from "./elements";
import { largest, outline } from "./steps";

const SVG = "http://www.w3.org/2000/svg";
/** Of a chart, in its own units. */
const [WIDTH, HEIGHT] = [320, 80];

interface Chart {
  title: string;
  unit: string;
  digits: number;
  values: (lane: LaneTraffic) => (number | null)[];
}

const CHARTS: Chart[] = [
  { title: "flow", unit: "1/h", digits: 0, values: (lane) => lane.flows },
  { title: "speed", unit: "m/s", digits: 1, values: (lane) => lane.speeds },
  { title: "queue", unit: "", digits: 0, values: (lane) => lane.queues },
];

export class FlowPanel {
  readonly root = element("div", { class: "page flows" });
  private readonly figures = element("div", { class: "lane-charts" });
  private readonly rows: HTMLElement[];
  private chosen = 0;
  private cursors: SVGElement[] = [];
  private values: [HTMLElement, Chart][] = [];
  private time = NaN;

  constructor(private readonly flows: Flows) {
    const { lanes } = flows;
    const head = element("tr", {}, element("th", {}, "lane"));
    head.append(...["due", "vehicles", "flow [1/h]", "speed [m/s]", "wait [s]", "queue"].map((name) => element("th", NUMBER, name)));
    this.rows = lanes.map((lane, i) => {
      const cells = [text(lane.due, 0), text(lane.vehicles, 0), text(lane.flow, 0), text(lane.speed, 1), text(lane.wait, 1)];
      const name = named(lane);
      return element(
        "tr",
        { "data-lane": `${lane.side} ${lane.lane}` },
        element(
          "td",
          {},
          button(name, `Show lane ${name} over time`, () => this.choose(i)),
        ),
        ...[...cells, text(lane.queue, 0)].map((cell) => element("td", NUMBER, cell)),
      );
    });
    const table = element("table", {}, element("thead", {}, head), element("tbody", {}, ...this.rows));
    const hint = "Generated traffic. In: vehicles enter by the lane; out: they leave by it. Queue: vehicles that wait before the map.";
    this.root.append(this.figures, dropEmptyColumns(table), element("p", { class: "hint" }, hint));
    this.choose(0);
  }

  /** Moves the cursors to a time [s]. */
  draw(time: number): void {
    if (time === this.time) return;
    this.time = time;
    const { edges } = this.flows;
    const [begin, end] = [edges[0], edges[edges.length - 1]];
    const at = (WIDTH * (Math.min(Math.max(time, begin), end) - begin)) / (end - begin);
    for (const cursor of this.cursors) {
      cursor.setAttribute("x1", String(at));
      cursor.setAttribute("x2", String(at));
    }
    const after = edges.findIndex((edge) => edge > time);
    const window = (after < 0 ? edges.length : Math.max(after, 1)) - 1;
    for (const [said, chart] of this.values)
      said.textContent = text(chart.values(this.flows.lanes[this.chosen])[Math.min(window, edges.length - 2)], chart.digits, chart.unit);
  }

  private choose(index: number): void {
    this.chosen = index;
    const lane = this.flows.lanes[index];
    this.rows.forEach((row, i) => {
      row.classList.toggle("chosen", i === index);
    });
    [this.cursors, this.values] = [[], []];
    const charts = CHARTS.filter((chart) => chart.values(lane).some((value) => value !== null));
    this.figures.replaceChildren(element("h2", {}, named(lane)), ...charts.map((chart) => this.chart(lane, chart)));
    const time = this.time;
    this.time = NaN;
    this.draw(Number.isNaN(time) ? this.flows.edges[0] : time);
  }

  private chart(lane: LaneTraffic, chart: Chart): HTMLElement {
    const { edges } = this.flows;
    const values = chart.values(lane);
    // One scale for all lanes.
    const top = largest(this.flows.lanes.flatMap(chart.values));
    const drawn = document.createElementNS(SVG, "svg");
    const add = (name: string, attributes: Record<string, number | string>) => {
      const part = document.createElementNS(SVG, name);
      for (const [key, value] of Object.entries(attributes)) part.setAttribute(key, String(value));
      drawn.append(part);
      return part;
    };
    drawn.setAttribute("viewBox", `-2 -2 ${WIDTH + 4} ${HEIGHT + 4}`);
    drawn.setAttribute("role", "img");
    drawn.setAttribute("aria-label", `${chart.title} of ${named(lane)} over time, up to ${text(top, chart.digits, chart.unit)}`);
    add("path", { d: `M0 0H${WIDTH}M0 ${HEIGHT}H${WIDTH}`, class: "edge" });
    add("path", { d: outline(edges, values, top, [WIDTH, HEIGHT]) });
    this.cursors.push(add("line", { x1: 0, x2: 0, y1: 0, y2: HEIGHT, class: "cursor" }));
    const said = element("span", { class: "value" });
    this.values.push([said, chart]);
    const label = element("header", {}, element("span", {}, `${chart.title}${chart.unit ? ` [${chart.unit}]` : ""}`), said);
    const scale = element("div", { class: "range hint" });
    const [begin, end] = [edges[0], edges[edges.length - 1]].map((edge) => text(edge, 0, "s"));
    scale.append(element("span", {}, begin), element("span", {}, `0 to ${text(top, chart.digits)}`), element("span", {}, end));
    return element("figure", {}, label, drawn, scale);
  }
}

function named({ side, lane }: LaneTraffic): string {
  return `${side} ${lane}`;
}
