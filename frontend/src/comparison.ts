// Planners compared: shares of outcomes, metrics, and differences with their intervals.

import { type Compared, type ComparedRow, type Difference, OUTCOMES } from "./contract";
import { dropEmptyColumns, element, NUMBER } from "./elements";
import { mark, markIcon } from "./marks";

/** Planners below each other. */
export function planners({ rows, headings }: Compared): HTMLElement {
  if (!rows.length) return element("section");
  const head = element("tr", {}, ...["planner", "outcomes"].map((name) => element("th", {}, name)));
  head.append(...["runs", "agents", ...headings].map((name) => element("th", NUMBER, name)));
  const body = rows.map((row) => {
    const line = element("tr", {}, element("th", {}, row.planner), element("td", {}, bar(row)));
    line.append(element("td", NUMBER, row.runs), element("td", NUMBER, String(row.n_agents)));
    for (const { text, strong } of row.cells)
      line.append(element("td", strong ? { class: "number best", title: "better than all others here, for certain" } : NUMBER, text));
    return line;
  });
  const legend = element("div", { class: "chips legend" });
  for (const outcome of OUTCOMES.filter((name) => rows.some((row) => row.shares[name] > 0)))
    legend.append(element("span", {}, markIcon(outcome), mark(outcome).text));
  const table = dropEmptyColumns(element("table", { class: "wide" }, element("thead", {}, head), element("tbody", {}, ...body)));
  return element("section", {}, element("div", { class: "scroll" }, table), legend);
}

/** Shares of outcomes as a bar. */
function bar({ shares }: ComparedRow): HTMLElement {
  const made = element("div", { class: "shares" });
  for (const outcome of OUTCOMES.filter((name) => shares[name] > 0)) {
    const part = element("span", { title: `${mark(outcome).text}: ${shares[outcome].toFixed(1)} %` });
    part.style.width = `${shares[outcome]}%`;
    part.style.background = mark(outcome).color;
    made.append(part);
  }
  return made;
}

export function differences({ pairs, note }: Compared): HTMLElement {
  if (!pairs.length) return element("section");
  const grid = element("div", { class: "pairs" });
  for (const pair of pairs) {
    const head = element(
      "tr",
      {},
      ...["metric", "difference", "interval", "", ""].map((h, i) => element("th", i === 1 || i === 2 ? NUMBER : {}, h)),
    );
    const table = element("table", {}, element("thead", {}, head), element("tbody", {}, ...pair.differences.map(line)));
    grid.append(element("details", { open: "" }, element("summary", {}, pair.name), table));
  }
  return element("section", {}, element("h2", {}, "Differences"), element("p", { class: "hint" }, note), grid);
}

function line(difference: Difference): HTMLElement {
  return element(
    "tr",
    { class: difference.sure ? "sure" : "" },
    element("td", {}, difference.metric),
    element("td", NUMBER, difference.text),
    element("td", NUMBER, difference.interval || "–"),
    element("td", {}, whisker(difference)),
    element("td", {}, difference.verdict),
  );
}

const SVG = "http://www.w3.org/2000/svg";

/** A difference as a dot, its interval as a line, zero in the middle; equal scales for equal metrics. */
function whisker({ value, low, high, extent, sure }: Difference): SVGElement {
  const made = document.createElementNS(SVG, "svg");
  const at = (size: number) => 60 + (54 * size) / extent;
  const add = (name: string, attributes: Record<string, number | string>) => {
    const part = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) part.setAttribute(key, String(value));
    made.append(part);
  };
  made.setAttribute("class", "whisker");
  made.setAttribute("viewBox", "0 0 120 16");
  made.setAttribute("aria-hidden", "true");
  add("line", { x1: 60, x2: 60, y1: 0, y2: 16, class: "zero" });
  if (low !== null && high !== null) add("line", { x1: at(low), x2: at(high), y1: 8, y2: 8 });
  add("circle", { cx: at(value), cy: 8, r: 3.5, class: sure ? "sure" : "" });
  return made;
}
