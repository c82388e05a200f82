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
  n_agents: number;
  /** Who is under test alone. */
  agent: number | null;
  outcomes: Record<string, number>;
  ttc_min: number | null;
  page: string | null;
  /** Why there is no page of a run whose folder was kept. */
  damage: string;
  /** Does a finished run without a page again; null if one command cannot. */
  command?: string | null;
}

interface Metric {
  name: string;
  heading: string;
  better: number;
  digits: number;
  outcome: boolean;
}

/** What is shown: runs with this traffic and agents, of one category or all. */
interface Choice {
  traffic: string;
  agents: string;
  category: string;
  title: string;
  size: string;
}

export interface BatchHeader {
  format: number;
  kind: "batch";
  name: string;
  version: string[];
  variants: string[];
  parts: { traffic: string; agents: string; category: string }[];
  sets: { traffic: string; agents: string; title: string; size: string }[];
  metrics: Metric[];
  table: Row[];
  differences: Row[];
  level: number | null;
  /** Differences over fewer scenarios are not marked. */
  scenarios_min: number;
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
  for (const title of new Set(options.map((option) => option.title))) {
    const group = element("optgroup", { label: title });
    options.forEach((option, i) => {
      if (option.title === title) group.append(element("option", { value: String(i) }, CATEGORY(option.category)));
    });
    choice.append(group);
  }
  const show = () => {
    document.documentElement.dataset.theme = theme;
    document.documentElement.style.setProperty("--zoom", String(zoom));
    const option = options[Number(choice.value)] ?? options[0];
    const within = (row: { traffic: Cell; agents: Cell; category: Cell }) =>
      row.traffic === option.traffic && row.agents === option.agents && row.category === option.category;
    const inside = (part: { traffic: string; agents: string; category: string }) =>
      part.traffic === option.traffic && part.agents === option.agents && (option.category === "all" || part.category === option.category);
    const whole = option.category === "all";
    const [title, said] = [whole ? option.title : `${option.title}: ${option.category}`, whole ? option.size : ""];
    const apart = header.differences.filter((row) => within(row as never));
    const enough = apart.some((row) => Number(row.n_scenarios) >= header.scenarios_min);
    compared.replaceChildren(
      element("section", {}, element("h2", {}, title), element("p", { class: "hint" }, said)),
      comparison(header, header.table.filter((row) => within(row as never)), enough),
      differences(header, apart),
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
    button("A+", "Larger text (Shift+A)", () => ((zoom = zoom >= 1.5 ? 1 : zoom + 0.25), show())),
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

const CATEGORY = (name: string) => (name === "all" ? "all categories" : name);

/** Sets that are compared with their categories; then those of runs of which none has finished. */
function choices(header: BatchHeader): Choice[] {
  const found = new Map<string, Choice>();
  const add = (traffic: string, agents: string, category: string, title: string, size: string) =>
    found.set([traffic, agents, category].join("|"), { traffic, agents, category, title, size });
  for (const { traffic, agents, title, size } of header.sets) {
    add(traffic, agents, "all", title, size);
    for (const row of header.table)
      if (row.traffic === traffic && row.agents === agents) add(traffic, agents, String(row.category), title, size);
  }
  for (const { traffic, agents } of header.runs)
    if (!found.has([traffic, agents, "all"].join("|")))
      add(traffic, agents, "all", `Traffic ${traffic}, agents ${agents}`, "None of these runs has finished.");
  return [...found.values()];
}

/** A cell as a number: JSON knows no infinity, "inf" stands for it. */
function size(value: Cell): number {
  return value === "inf" ? Infinity : value === "-inf" ? -Infinity : typeof value === "number" ? value : NaN;
}

function number(value: Cell, digits: number): string {
  return typeof value === "string" ? value.replace("inf", "∞") : text(value, digits);
}

/** Planners below each other; the best values are marked if there are enough scenarios. */
function comparison(header: BatchHeader, rows: Row[], enough: boolean): HTMLElement {
  if (!rows.length) return element("section");
  const head = element("tr", {}, ...["planner", "outcomes", "runs", "agents"].map((name, i) => element("th", i > 1 ? NUMBER : {}, name)));
  const metrics = header.metrics.filter((metric) => happened(metric, rows));
  head.append(...metrics.map((metric) => element("th", { class: "number" }, metric.heading)));
  const best = new Map(
    header.metrics.map((metric) => {
      const values = rows.map((row) => size(row[metric.name])).filter((v) => !Number.isNaN(v));
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
    for (const metric of metrics) {
      const differ = enough && rows.some((other) => other[metric.name] !== row[metric.name]);
      const chosen = differ && size(row[metric.name]) === best.get(metric.name);
      const title: Record<string, string> = chosen ? { class: "number best", title: "the best of these" } : { class: "number" };
      line.append(element("td", title, number(row[metric.name], metric.digits)));
    }
    return line;
  });
  const legend = element("div", { class: "chips legend" });
  for (const outcome of ORDER.filter((name) => rows.some((row) => Number(row[SHARES[name] ?? name]) > 0))) legend.append(element("span", {}, markIcon(outcome), mark(outcome).text));
  const table = element("table", { class: "wide" }, element("thead", {}, head), element("tbody", {}, ...body));
  return element("section", {}, element("div", { class: "scroll" }, table), legend);
}

/** What happened to nobody needs no column, but that nobody collided is worth one. */
function happened(metric: Metric, rows: Row[]): boolean {
  return !metric.outcome || metric.better > 0 || metric.name === "collisions" || rows.some((row) => Number(row[metric.name]) > 0);
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
  const extents = new Map(header.metrics.map((metric) => [metric.name, extent(known.filter((row) => row.metric === metric.name))]));
  const pairs = new Map<string, Row[]>();
  for (const row of known) {
    if (!extents.get(String(row.metric))) continue;
    const name = `${row.variant} − ${row.other}`;
    pairs.set(name, [...(pairs.get(name) ?? []), row]);
  }
  const section = element("section", {}, element("h2", {}, "Differences"));
  const percent = Math.round(100 * (header.level ?? 0));
  const few = known.filter((row) => Number(row.n_scenarios) < header.scenarios_min).length;
  const marked = "Those in bold, with filled dots, do not contain 0";
  const most = Math.max(...known.map((row) => Number(row.n_scenarios)));
  const claims =
    few === known.length
      ? `Over fewer than ${header.scenarios_min} scenarios (here ${most}) intervals are much too narrow: nothing is in bold, no dot is filled, and nobody is called better.`
      : `${marked}${few ? `; never those over fewer than ${header.scenarios_min} scenarios` : ""}.`;
  const said = `Over the same agents; intervals of ${percent} % over scenarios. ${claims}`;
  section.append(element("p", { class: "hint" }, said));
  const grid = element("div", { class: "pairs" });
  for (const [name, found] of pairs) {
    const body = found.map((row) => difference(header.metrics.find((m) => m.name === row.metric)!, row, extents.get(String(row.metric))!));
    const head = element("tr", {}, ...["metric", "difference", "interval", "", ""].map((h, i) => element("th", i === 1 || i === 2 ? NUMBER : {}, h)));
    grid.append(element("details", { open: "" }, element("summary", {}, name), element("table", {}, element("thead", {}, head), element("tbody", {}, ...body))));
  }
  section.append(grid);
  return section;
}

function difference(metric: Metric, row: Row, most: number): HTMLElement {
  const [low, high] = [row.low, row.high];
  const sure = row.sure === 1;
  const digits = enough([row.difference, low, high], metric.digits, sure);
  const interval = low === null ? "–" : `${number(low, digits)} to ${number(high, digits)}`;
  const better = sure && metric.better !== 0 ? (metric.better * Number(row.difference) > 0 ? "better" : "worse") : "";
  return element(
    "tr",
    { class: sure ? "sure" : "" },
    element("td", {}, metric.heading),
    element("td", { class: "number" }, number(row.difference, digits)),
    element("td", { class: "number" }, interval),
    element("td", {}, whisker(row, most, sure)),
    element("td", {}, better),
  );
}

/** Digits with which not all values round to zero, or none does; zero itself needs none. */
function enough(values: Cell[], digits: number, none: boolean): number {
  const sizes = values.map(size).filter((value) => Number.isFinite(value) && value !== 0);
  const rounded = (by: number) => sizes.filter((value) => Number(value.toFixed(by)) === 0).length;
  let by = digits;
  while (by < digits + 4 && rounded(by) > (none ? 0 : sizes.length - 1)) by++;
  return sizes.length ? by : digits;
}

/** How far from zero differences of a metric and their intervals reach. */
function extent(rows: Row[]): number {
  const ends = rows.flatMap((row) => [row.low, row.difference, row.high]).filter((v): v is number => typeof v === "number");
  return Math.max(0, ...ends.map(Math.abs));
}

const NUMBER = { class: "number" };

const SVG = "http://www.w3.org/2000/svg";

/** A difference as a dot, its interval as a line, zero in the middle; equal scales for equal metrics. */
function whisker(row: Row, most: number, sure: boolean): SVGElement {
  const made = document.createElementNS(SVG, "svg");
  const at = (value: number) => 60 + (54 * value) / most;
  const add = (name: string, attributes: Record<string, number | string>) => {
    const part = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) part.setAttribute(key, String(value));
    made.append(part);
  };
  made.setAttribute("class", "whisker");
  made.setAttribute("viewBox", "0 0 120 16");
  made.setAttribute("aria-hidden", "true");
  add("line", { x1: 60, x2: 60, y1: 0, y2: 16, class: "zero" });
  if (typeof row.low === "number" && typeof row.high === "number") add("line", { x1: at(row.low), x2: at(row.high), y1: 8, y2: 8 });
  add("circle", { cx: at(Number(row.difference)), cy: 8, r: 3.5, class: sure ? "sure" : "" });
  return made;
}

/** Headings of columns of numbers in the list of runs. */
const NUMBERS = new Set(["seed", "agents", "reached %", "collisions", "min TTC [s]"]);

/** All runs; a word in the field keeps those that contain it, a click on a heading sorts. */
class RunList {
  readonly root = element("section");
  private readonly lines: { run: BatchRun; line: HTMLElement }[];
  private readonly count = element("span", { class: "hint" });
  private readonly filter = element("input", { type: "search", placeholder: "Find runs: scenario, planner, outcome, status", "aria-label": "Find runs" });
  private inside: (part: BatchRun) => boolean = () => true;

  constructor(header: BatchHeader) {
    const keys: [string, (run: BatchRun) => number | string][] = [
      ["scenario", (run) => `${run.scenario} ${String(run.agent ?? "").padStart(12)}`],
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
      head.append(element("th", NUMBERS.has(name) ? NUMBER : {}, name ? button(name, `Sort by ${name}`, sort) : ""));
    }
    body.append(...this.lines.map(({ line: l }) => l));
    this.filter.addEventListener("input", () => this.show());
    const table = element("table", { class: "runs" }, element("thead", {}, head), body);
    this.root.append(this.filter, this.count, element("div", { class: "scroll" }, table));
  }

  restrict(inside: (part: BatchRun) => boolean): void {
    this.inside = inside;
    this.show();
  }

  private show(): void {
    const words = this.filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const { run, line: l } of this.lines) {
      const said = [run.scenario, run.agent ?? "", run.category, run.variant, run.status, ...Object.keys(run.outcomes)].join(" ").toLowerCase();
      l.hidden = !this.inside(run) || !words.every((word) => said.includes(word));
      shown += Number(!l.hidden);
    }
    this.count.textContent = `${shown} of ${this.lines.length} runs`;
  }
}

/** A path as a link: folders may have # or ? in their names. */
function address(page: string): string {
  return page.split("/").map(encodeURIComponent).join("/");
}

function line(run: BatchRun): HTMLElement {
  const title = run.agent === null ? run.scenario : `${run.scenario}, agent ${run.agent}`;
  const name = run.page === null ? title : element("a", { href: address(run.page) }, title);
  const finished = run.status === "finished";
  const status = element("td", {}, run.status);
  for (const said of [run.error, run.damage]) if (said) status.append(element("small", {}, said));
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
    element("td", {}, look(run)),
  );
}

/** The page of a run, or how to get one. */
function look(run: BatchRun): HTMLElement | string {
  if (run.page !== null) return element("a", { href: address(run.page) }, "look");
  if (run.command === undefined) return "";
  const how =
    run.command === null
      ? ["`interdrive run` cannot repeat this run. ", element("code", {}, "interdrive batch ... --keep all"), " into a new folder keeps it."]
      : [element("code", {}, run.command)];
  return element("details", {}, element("summary", {}, run.damage ? "damaged" : "not kept"), ...how);
}
