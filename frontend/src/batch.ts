// The page of a batch: comparison, differences, distributions, and a list of runs with links to their pages.

import { type Entry, inflate, unpack } from "./arrays";
import { type Theme } from "./colors";
import { Distributions } from "./distributions";
import { button, element, text } from "./elements";
import { mark, markIcon } from "./marks";

type Cell = string | number | null;
type Row = Record<string, Cell>;

export interface BatchRun {
  scenario: string;
  category: string;
  variant: string;
  traffic: string;
  agents: string;
  seed: number;
  status: string;
  error: string;
  path: string;
  planner: string;
  predictor: string;
  n_agents: number;
  outcomes: Record<string, number>;
  ttc_min: number | null;
  page: string | null;
}

export interface BatchHeader {
  format: number;
  kind: "batch";
  name: string;
  version: string[];
  variants: string[];
  parts: { traffic: string; agents: string; category: string }[];
  metrics: { name: string; heading: string; better: number; digits: number }[];
  table: Row[];
  differences: Row[];
  level: number | null;
  reservations: string[];
  drawn: { name: string; title: string; unit: string }[];
  runs: BatchRun[];
  missing: { what: string; text: string }[];
  arrays: Record<string, Entry>;
}

/** Outcomes from good to bad, as bars show them. */
const ORDER = ["goal_reached", "goal_reached_late", "time_limit", "goal_missed", "infeasible", "planner_error", "collision"];
const SHARES: Record<string, string> = { collision: "collisions" };

export async function showBatch(root: HTMLElement, header: BatchHeader, arrays: string): Promise<void> {
  const bytes = await inflate(arrays);
  const tables = Object.fromEntries(Object.entries(header.arrays).map(([n, e]) => [n, unpack(e, bytes)]));
  let theme: Theme = window.matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
  let zoom = 1;
  root.classList.add("batch");

  const compared = element("div");
  const list = new RunList(header);
  const distributions = new Distributions(header, tables);
  const choice = element("select", { "aria-label": "Traffic, agents and category" });
  const options = choices(header);
  options.forEach((option, i) => choice.append(element("option", { value: String(i) }, option.label)));
  const show = () => {
    document.documentElement.dataset.theme = theme;
    document.documentElement.style.setProperty("--zoom", String(zoom));
    const option = options[Number(choice.value)] ?? options[0];
    const within = (row: { traffic: Cell; agents: Cell; category: Cell }) =>
      row.traffic === option.traffic && row.agents === option.agents && row.category === option.category;
    const inside = (part: { traffic: string; agents: string; category: string }) =>
      part.traffic === option.traffic && part.agents === option.agents && (option.category === "all" || part.category === option.category);
    compared.replaceChildren(
      comparison(header, header.table.filter((row) => within(row as never))),
      differences(header, header.differences.filter((row) => within(row as never))),
    );
    list.restrict(inside);
    distributions.draw(inside, theme, zoom);
    root.dataset.ready = "true";
  };
  choice.addEventListener("change", show);
  const finished = header.runs.filter((run) => run.status === "finished").length;
  const head = element(
    "header",
    { class: "head" },
    element("h1", {}, header.name),
    element("span", { class: "said" }, `${header.runs.length} runs, ${finished} finished, interdrive ${header.version.join(", ")}`),
    element("span", { class: "space" }),
    choice,
    button("A+", "Larger text (A)", () => ((zoom = zoom >= 1.5 ? 1 : zoom + 0.25), show())),
    button("◐", "Light or dark (T)", () => ((theme = theme === "light" ? "dark" : "light"), show())),
  );
  document.addEventListener("keydown", (event) => {
    if (event.target instanceof HTMLInputElement || event.ctrlKey || event.metaKey) return;
    if (event.key === "t" || event.key === "A") head.querySelectorAll("button")[event.key === "A" ? 0 : 1].click();
  });
  const notes = [...header.missing.map((m) => m.text), ...header.reservations];
  const main = element("main", {}, compared, element("h2", {}, "Distributions over agents"), distributions.root);
  if (notes.length)
    main.append(element("h2", {}, "What the numbers do not prove"), element("ul", {}, ...notes.map((n) => element("li", {}, n))));
  main.append(element("h2", {}, "Runs"), list.root);
  root.replaceChildren(head, main);
  show();
  new ResizeObserver(() => distributions.resize()).observe(main);
}

function choices(header: BatchHeader): { traffic: string; agents: string; category: string; label: string }[] {
  const rows = header.table.length ? (header.table as unknown as BatchHeader["parts"]) : header.parts;
  const found = new Map<string, { traffic: string; agents: string; category: string; label: string }>();
  for (const { traffic, agents, category } of rows)
    found.set([traffic, agents, category].join("|"), {
      traffic,
      agents,
      category,
      label: `traffic ${traffic}, agents ${agents}, ${category === "all" ? "all categories" : category}`,
    });
  return [...found.values()];
}

function number(value: Cell, digits: number): string {
  return typeof value === "string" ? value.replace("inf", "∞") : text(value, digits);
}

function comparison(header: BatchHeader, rows: Row[]): HTMLElement {
  if (!rows.length) return element("p", { class: "hint" }, "Nothing to compare.");
  const head = element("tr", {}, ...["planner", "outcomes", "runs", "agents"].map((name) => element("th", {}, name)));
  head.append(...header.metrics.map((metric) => element("th", { class: "number" }, metric.heading)));
  const best = new Map(
    header.metrics.map((metric) => {
      const values = rows.map((row) => row[metric.name]).filter((v): v is number => typeof v === "number");
      return [metric.name, metric.better > 0 ? Math.max(...values) : metric.better < 0 ? Math.min(...values) : NaN];
    }),
  );
  const body = rows.map((row) => {
    const lost = Number(row.runs_lost) > 0 ? ` (${row.runs_lost} lost)` : "";
    const line = element(
      "tr",
      {},
      element("th", {}, String(row.variant)),
      element("td", {}, bar(row)),
      element("td", { class: "number" }, `${row.runs}${lost}`),
      element("td", { class: "number" }, String(row.n_agents)),
    );
    for (const metric of header.metrics) {
      const differ = rows.some((other) => other[metric.name] !== row[metric.name]);
      const chosen = differ && row[metric.name] === best.get(metric.name);
      const title: Record<string, string> = chosen ? { class: "number best", title: "the best of these" } : { class: "number" };
      line.append(element("td", title, number(row[metric.name], metric.digits)));
    }
    return line;
  });
  const legend = element("div", { class: "chips legend" });
  for (const outcome of ORDER) legend.append(element("span", {}, markIcon(outcome), mark(outcome).text));
  const table = element("table", { class: "wide" }, element("thead", {}, head), element("tbody", {}, ...body));
  return element("section", {}, element("h2", {}, "Planners"), element("div", { class: "scroll" }, table), legend);
}

/** Shares of outcomes as a bar. */
function bar(row: Row): HTMLElement {
  const made = element("div", { class: "shares" });
  for (const outcome of ORDER) {
    const share = Number(row[SHARES[outcome] ?? outcome] ?? 0);
    if (!(share > 0)) continue;
    const part = element("span", { title: `${mark(outcome).text}: ${share.toFixed(1)} %` });
    part.style.width = `${share}%`;
    part.style.background = mark(outcome).color;
    made.append(part);
  }
  return made;
}

function differences(header: BatchHeader, rows: Row[]): HTMLElement {
  const known = rows.filter((row) => typeof row.difference === "number" && Number(row.n_agents) > 0);
  if (!known.length) return element("section");
  const pairs = new Map<string, Row[]>();
  for (const row of known) {
    const name = `${row.variant} minus ${row.other}`;
    pairs.set(name, [...(pairs.get(name) ?? []), row]);
  }
  const section = element("section", {}, element("h2", {}, "Differences"));
  const percent = Math.round(100 * (header.level ?? 0));
  section.append(element("p", { class: "hint" }, `Over agents that both drove; intervals of ${percent} % over scenarios. Those in bold do not contain 0.`));
  for (const [name, found] of pairs) {
    const body = found.map((row) => {
      const metric = header.metrics.find((m) => m.name === row.metric)!;
      const [low, high] = [row.low, row.high];
      const sure = typeof low === "number" && typeof high === "number" && (low > 0 || high < 0);
      const interval = typeof low === "number" ? `${number(low, metric.digits)} to ${number(high, metric.digits)}` : "–";
      const better = sure && metric.better !== 0 ? (metric.better * Number(row.difference) > 0 ? "better" : "worse") : "";
      return element(
        "tr",
        { class: sure ? "sure" : "" },
        element("td", {}, metric.heading),
        element("td", { class: "number" }, number(row.difference, metric.digits)),
        element("td", { class: "number" }, interval),
        element("td", {}, better),
        element("td", { class: "number" }, String(row.n_agents)),
      );
    });
    const head = element("tr", {}, ...["metric", "difference", "interval", "", "agents"].map((h) => element("th", {}, h)));
    section.append(element("details", { open: "" }, element("summary", {}, name), element("table", {}, element("thead", {}, head), element("tbody", {}, ...body))));
  }
  return section;
}

/** All runs; a word in the field keeps those that contain it, a click on a heading sorts. */
class RunList {
  readonly root = element("section");
  private readonly lines: { run: BatchRun; line: HTMLElement }[];
  private readonly count = element("span", { class: "hint" });
  private readonly filter = element("input", { type: "search", placeholder: "Find runs: scenario, planner, outcome, status", "aria-label": "Find runs" });
  private inside: (part: BatchRun) => boolean = () => true;

  constructor(header: BatchHeader) {
    const keys: [string, (run: BatchRun) => number | string][] = [
      ["scenario", (run) => run.scenario],
      ["category", (run) => run.category],
      ["planner", (run) => run.variant],
      ["seed", (run) => run.seed],
      ["status", (run) => run.status],
      ["agents", (run) => run.n_agents],
      ["reached %", (run) => (run.outcomes.goal_reached ?? 0) / Math.max(1, run.n_agents)],
      ["collisions", (run) => run.outcomes.collision ?? 0],
      ["min TTC [s]", (run) => run.ttc_min ?? Infinity],
      ["", () => 0],
    ];
    const body = element("tbody");
    this.lines = header.runs.map((run) => ({ run, line: line(run) }));
    const head = element("tr");
    for (const [name, key] of keys) {
      let up = false;
      const sort = () => {
        up = !up;
        this.lines.sort(({ run: a }, { run: b }) => (key(a) < key(b) ? -1 : key(a) > key(b) ? 1 : 0) * (up ? 1 : -1));
        body.append(...this.lines.map(({ line: l }) => l));
      };
      head.append(element("th", {}, name ? button(name, `Sort by ${name}`, sort) : ""));
    }
    body.append(...this.lines.map(({ line: l }) => l));
    this.filter.addEventListener("input", () => this.show());
    this.root.append(this.filter, this.count, element("table", { class: "runs" }, element("thead", {}, head), body));
  }

  restrict(inside: (part: BatchRun) => boolean): void {
    this.inside = inside;
    this.show();
  }

  private show(): void {
    const words = this.filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const { run, line: l } of this.lines) {
      const said = [run.scenario, run.category, run.variant, run.status, ...Object.keys(run.outcomes)].join(" ").toLowerCase();
      l.hidden = !this.inside(run) || !words.every((word) => said.includes(word));
      shown += Number(!l.hidden);
    }
    this.count.textContent = `${shown} of ${this.lines.length} runs`;
  }
}

function line(run: BatchRun): HTMLElement {
  const link = run.page === null ? element("span", { class: "hint", title: command(run) }, "not kept") : element("a", { href: encodeURI(run.page) }, "look");
  const name = run.page === null ? run.scenario : element("a", { href: encodeURI(run.page) }, run.scenario);
  const finished = run.status === "finished";
  const status = element("td", {}, run.status);
  if (run.error) status.append(element("small", {}, run.error));
  return element(
    "tr",
    { class: finished ? "" : "lost" },
    element("td", {}, name),
    element("td", {}, run.category),
    element("td", {}, run.variant),
    element("td", { class: "number" }, String(run.seed)),
    status,
    element("td", { class: "number" }, String(run.n_agents)),
    element("td", { class: "number" }, finished ? ((100 * (run.outcomes.goal_reached ?? 0)) / Math.max(1, run.n_agents)).toFixed(0) : ""),
    element("td", { class: "number" }, finished ? String(run.outcomes.collision ?? 0) : ""),
    element("td", { class: "number" }, text(run.ttc_min, 2)),
    element("td", {}, link),
  );
}

/** How to see a run whose folder was not kept. */
function command(run: BatchRun): string {
  return `interdrive run ${run.path} --planner ${run.planner} --predictor ${run.predictor} --report (with the batch's settings)`;
}
